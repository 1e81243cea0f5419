// SPDX-License-Identifier: Apache-2.0
// Counts the allocations of `step` and `run` on good and bad samples: prints them, and their sum
// of outputs so that nothing is optimized away.
#include <cstdio>
#include <limits>
#include <vector>

#include "touchline/detail/observer/observer.hpp"

long allocations = 0;  // counting.cpp counts them

namespace {

using namespace touchline;

constexpr int kJoints = 7, kSamples = 400;
constexpr double kBad[] = {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), 1e300, -1e7};

// A chain of joints of both kinds with a sensor at its root, one at its tip, one of few axes.
Observer make_observer(Method method) {
  std::vector<Node> nodes(1);
  std::vector<JointRow> joints(kJoints);
  for (int i = 0; i < kJoints; ++i) {
    Node node;
    node.parent = i;
    node.kind = i == 3 ? NodeKind::prismatic : NodeKind::revolute;
    node.coordinate = i;
    node.mass = 1.0;
    node.com = {0.1, 0.0, 0.05};
    node.placement.p = {0.1, 0.2, 0.3};
    node.placement.R = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};
    nodes.push_back(node);
    joints[i].nodes = {i + 1};
    joints[i].coulomb = 0.1;
    joints[i].stribeck = 0.05;
    joints[i].stribeck_speed = 0.1;
  }
  joints[0].torque = Torque::from;
  joints[0].sources = {0};
  nodes.push_back(nodes.back());
  nodes.back().parent = kJoints;
  nodes.back().kind = NodeKind::fixed;
  std::vector<SensorRow> sensors(3);
  sensors[1].node = kJoints + 1;
  sensors[2].node = 4;
  sensors[2].axes[1] = false;
  return {Tree(nodes, {0, 0, -9.81}), joints, sensors, method};
}

struct Recording {
  std::vector<double> time, q, qd, tau, wrench;
};

Recording make_recording() {
  Recording r;
  for (int i = 0; i < kSamples; ++i) {
    r.time.push_back(i * 1e-3 + (i > 300 ? 5.0 : 0.0) - (i == 200 ? 0.002 : 0.0));
    for (int j = 0; j < kJoints; ++j) {
      r.q.push_back(0.01 * i * (j + 1));
      r.qd.push_back(10.0);
      r.tau.push_back(1.0);
    }
    for (int k = 0; k < 18; ++k) r.wrench.push_back(0.1 * k);
    if (i % 10 == 9) {
      r.tau[i * kJoints + i % kJoints] = kBad[i % 4];
      r.wrench[i * 18 + i % 18] = kBad[i % 4];
    }
    if (i % 50 == 49) r.q[i * kJoints + 2] = kBad[i % 4];
  }
  r.time[350] = kBad[0];
  return r;
}

double add_up(const double* row, int width) {
  double sum = 0.0;
  for (int i = 0; i < width; ++i) sum += row[i] == row[i] ? row[i] : 0.0;
  return sum;
}

}  // namespace

int main() {
  const Recording r = make_recording();
  for (const Method method : {Method::segment, Method::paper}) {
    Observer single = make_observer(method), whole = make_observer(method);
    const int width = single.row_layout().width();
    std::vector<double> rows(static_cast<std::size_t>(kSamples * width));
    double stepped = 0.0, ran = 0.0;
    const long before = allocations;
    if (before == 0) return 1;  // nothing is counted
    for (int i = 0; i < kSamples; ++i) {
      stepped += add_up(single.step(r.time[i], &r.q[i * kJoints], &r.qd[i * kJoints],
                                    &r.tau[i * kJoints], &r.wrench[i * 18]),
                        width);
    }
    whole.run(kSamples, r.time.data(), r.q.data(), r.qd.data(), r.tau.data(), r.wrench.data(),
              rows.data());
    single.reset();
    const long counted = allocations - before;
    for (int i = 0; i < kSamples; ++i) ran += add_up(&rows[i * width], width);
    std::printf("%ld %.17g %.17g\n", counted, stepped, ran);
  }
  return 0;
}
