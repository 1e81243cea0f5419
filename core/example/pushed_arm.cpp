// SPDX-License-Identifier: Apache-2.0
// A planar arm of two links on a six-axis base sensor is pushed at its tip while it moves: how a
// controller feeds the observer, sample by sample, and reads the external wrench.
//
//   c++ -std=c++17 -O2 -I core/include core/example/pushed_arm.cpp -o pushed_arm && ./pushed_arm
#include <cmath>
#include <cstdio>
#include <vector>

#include "touchline/detail/observer/observer.hpp"

using touchline::Vec3;

namespace {

constexpr double kLength = 0.4, kMass = 2.0, kGravity = 9.81;  // of each link [m, kg]; [m/s2]
constexpr double kPeriod = 1e-3;                               // of the controller [s]

// Frames: the world's x points along the stretched arm, z up. Joints turn about their own z axis,
// so one rotation by -90 degrees about x makes the first joint's axis the world's y.
touchline::Observer make_observer() {
  const touchline::Mat3 upright{{1, 0, 0}, {0, 0, -1}, {0, 1, 0}};
  std::vector<touchline::Node> nodes(3);
  nodes[0].mass = 1.0;  // the base plate on its sensor, which is fixed in the world
  for (int i = 1; i < 3; ++i) {
    touchline::Node& link = nodes[i];
    link.parent = i - 1;
    link.kind = touchline::NodeKind::revolute;
    link.coordinate = i - 1;
    link.mass = kMass;
    link.com = {kLength, 0, 0};  // a point mass at the far end keeps the simulation short
  }
  nodes[1].placement.R = upright;
  nodes[2].placement.p = {kLength, 0, 0};

  std::vector<touchline::JointRow> joints(2);
  joints[0].nodes = {1};
  joints[1].nodes = {2};
  std::vector<touchline::SensorRow> sensors(1);  // polarity: on the outboard body
  sensors[0].node = 0;
  for (auto& joint : joints) joint.bandwidth = 50.0;
  sensors[0].bandwidth = 50.0;
  return {touchline::Tree(nodes, {0, 0, -kGravity}), joints, sensors};
}

// What the sensors of the real arm would say.
struct Signals {
  double q[2], qd[2], tau[2], wrench[6];
};

// The arm follows sines; a push acts at its tip.
Signals simulate(double time, const Vec3& push) {
  const double w = 2.0, angle[2] = {0.4 * std::sin(w * time), 0.6 * std::sin(w * time)};
  const double rate[2] = {0.4 * w * std::cos(w * time), 0.6 * w * std::cos(w * time)};
  Signals s{};
  Vec3 position, velocity, acceleration, points[2], loads[2], pivots[2];
  double sum = 0.0, sum_rate = 0.0;
  for (int i = 0; i < 2; ++i) {
    s.q[i] = angle[i];
    s.qd[i] = rate[i];
    sum += angle[i];
    sum_rate += rate[i];
    const double sum_acceleration = -w * w * sum;  // both joints are sines of one frequency
    // A positive angle about the world's y axis turns x towards -z.
    const Vec3 along{std::cos(sum), 0, -std::sin(sum)}, across{-std::sin(sum), 0, -std::cos(sum)};
    pivots[i] = position;
    position = position + kLength * along;
    acceleration = acceleration + kLength * (sum_acceleration * across) -
                   kLength * (sum_rate * sum_rate * along);
    points[i] = position;
    loads[i] = kMass * (acceleration + Vec3{0, 0, kGravity});
  }
  loads[1] = loads[1] - push;  // what the joints must supply is less by what the push does
  Vec3 force{0, 0, 1.0 * kGravity}, moment;  // the base plate
  for (int i = 0; i < 2; ++i) {
    force = force + loads[i];
    moment = moment + cross(points[i], loads[i]);
    for (int j = 0; j <= i; ++j) s.tau[j] += cross(points[i] - pivots[j], loads[i]).y;
  }
  touchline::store({force, moment}, s.wrench);
  return s;
}

}  // namespace

int main() {
  touchline::Observer observer = make_observer();
  const touchline::RowLayout& row = observer.row_layout();
  std::printf("  time   fx [N]   fz [N]  my [Nm]  tau1 [Nm]  tau2 [Nm]  health\n");
  for (int i = 0; i <= 800; ++i) {
    const double time = i * kPeriod;
    const Vec3 push = time < 0.4 ? Vec3{} : Vec3{5.0, 0.0, -20.0};
    const Signals s = simulate(time, push);
    const double* estimate = observer.step(time, s.q, s.qd, s.tau, s.wrench);
    if (i % 100 != 0) continue;
    const double* wrench = estimate + row.sensor_wrench();
    std::printf("%6.3f %8.3f %8.3f %8.3f %10.3f %10.3f %7.0f\n", time, wrench[0], wrench[2],
                wrench[4], estimate[row.tau_ext()], estimate[row.tau_ext() + 1],
                estimate[row.health()]);
  }
  return 0;
}
