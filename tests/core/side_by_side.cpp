// SPDX-License-Identifier: Apache-2.0
// Random robots, samples and faults: a recording in parts of any size, with some single steps
// between, gives the numbers of single steps to the last bit. Prints how many numbers differ. With an
// argument a sum of each recording's numbers comes before: it tells kernels apart.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <limits>
#include <random>
#include <vector>

#include "touchline/detail/observer/observer.hpp"

namespace {

using namespace touchline;

constexpr int kJoints = 7, kSamples = 400;
constexpr double kBad[] = {std::numeric_limits<double>::quiet_NaN(),
                           std::numeric_limits<double>::infinity(), 1e300, -1e7};

struct Chance {
  std::mt19937 engine{1};
  double operator()() { return std::uniform_real_distribution<double>(0.0, 1.0)(engine); }
  int below(int n) { return static_cast<int>((*this)() * n); }
};

struct Kind {
  int sensors;
  Method method;
  bool rough, two_bandwidths, from_sensors, few_axes;
};

// A chain of joints with a sensor at its root and others at its tip.
Observer make_observer(const Kind& kind) {
  std::vector<Node> nodes(1);
  std::vector<JointRow> joints(kJoints);
  std::vector<SensorRow> sensors(kind.sensors);
  int parent = 0, sensor = 1;
  for (int i = 0; i < kJoints; ++i) {
    Node node;
    node.parent = parent;
    node.kind = NodeKind::revolute;
    node.coordinate = i;
    node.mass = 1.0 + 0.1 * i;
    node.com = {0.1, 0.02, 0.05};
    node.inertia = {{0.1, 0, 0}, {0, 0.12, 0}, {0, 0, 0.13}};
    node.placement.p = {0.1, 0.2, 0.3};
    node.placement.R = {{1, 0, 0}, {0, 0, 1}, {0, -1, 0}};
    nodes.push_back(node);
    parent = static_cast<int>(nodes.size()) - 1;
    joints[i].nodes = {parent};
    if (i < kJoints - (kind.sensors - 1) || sensor >= kind.sensors) continue;
    node.parent = parent;
    node.kind = NodeKind::fixed;
    node.coordinate = -1;
    nodes.push_back(node);
    parent = static_cast<int>(nodes.size()) - 1;
    sensors[sensor++].node = parent;
  }
  if (kind.rough) {
    joints[1].coulomb = joints[4].coulomb = 0.3;
    joints[4].stribeck = joints[5].stribeck = 0.2;
    joints[4].stribeck_speed = joints[5].stribeck_speed = 0.1;
  }
  if (kind.two_bandwidths) joints[2].bandwidth = 40.0;
  if (kind.from_sensors && kind.sensors > 0) {
    joints[0].torque = Torque::from;
    joints[0].sources = {0};
  }
  joints[3].compensated = Compensated::gravity;
  if (kind.few_axes && kind.sensors > 1) sensors[1].axes[2] = false;
  return {Tree(nodes, {0, 0, -9.81}), joints, sensors, kind.method};
}

struct Recording {
  std::vector<double> time, q, qd, tau, wrench;
  Sample at(int i, int sensors) const {
    return {time[i], &q[kJoints * i], &qd[kJoints * i], &tau[kJoints * i],
            wrench.data() + 6 * sensors * i};
  }
};

// `faults`: 0 none, 1 jitter, 2 gaps, 3 stamps that go back; from 1 on bad numbers too.
Recording make_recording(int sensors, int faults, Chance& chance) {
  Recording r;
  double time = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    time += faults == 1 ? 1e-3 * (0.5 + chance()) : 1e-3;
    if (faults == 2 && chance() < 0.01) time += 1e-3 * chance.below(60);
    if (faults == 3 && chance() < 0.01) time -= 2e-3 * chance();
    r.time.push_back(time);
    for (int j = 0; j < kJoints; ++j) {
      r.q.push_back(std::sin(time * (j + 1)));
      r.qd.push_back((j + 1) * std::cos(time * (j + 1)));
      r.tau.push_back(std::sin(2.0 * time + j));
    }
    for (int k = 0; k < 6 * sensors; ++k) r.wrench.push_back(std::cos(3.0 * time + k));
    if (faults == 0 || chance() > 0.01) continue;
    const double bad = kBad[chance.below(4)];
    const int j = kJoints * i + chance.below(kJoints);
    switch (chance.below(6)) {
      case 0: r.q[j] = bad; break;
      case 1: r.qd[j] = bad; break;
      case 2: r.tau[j] = bad; break;
      case 3: r.time[i] = bad; break;
      case 4: std::fill_n(r.tau.end() - kJoints, kJoints, bad); break;  // no joint is left
      default: if (sensors > 0) r.wrench[6 * sensors * i + chance.below(6 * sensors)] = bad;
    }
  }
  return r;
}

bool same(double a, double b) { return std::memcmp(&a, &b, sizeof a) == 0 || (a != a && b != b); }

}  // namespace

int main(int arguments, char**) {
  Chance chance;
  long differ = 0, numbers = 0;
  for (int trial = 0; trial < 120; ++trial) {
    const Kind kind{trial % 5, chance() < 0.2 ? Method::paper : Method::segment, chance() < 0.3,
                    chance() < 0.3, chance() < 0.3, chance() < 0.2};
    const Recording r = make_recording(kind.sensors, trial % 4, chance);
    Observer parts = make_observer(kind), single = make_observer(kind);
    const std::size_t width = single.output().size();
    std::vector<double> rows(kSamples * width);
    for (int i = 0; i < kSamples;) {
      const int room = chance() < 0.3 ? 9 : 300, count = std::min(1 + chance.below(room), kSamples - i);
      const Sample s = r.at(i, kind.sensors);
      double* out = rows.data() + i * width;
      if (chance() < 0.2) {
        for (int k = 0; k < count; ++k)
          std::memcpy(out + k * width, parts.step(r.at(i + k, kind.sensors)), width * sizeof *out);
      } else {
        parts.run(count, &r.time[i], s.q, s.qd, s.tau, s.wrench, out);
      }
      i += count;
    }
    double sum = 0.0;
    for (int i = 0; i < kSamples; ++i) {
      const double* row = single.step(r.at(i, kind.sensors));
      for (std::size_t c = 0; c < width; ++c)
        sum += std::isfinite(row[c]) ? row[c] * static_cast<double>(1 + (c + i) % 11) : 0.5;
      for (std::size_t c = 0; c < width; ++c) differ += !same(row[c], rows[i * width + c]);
      numbers += static_cast<long>(width);
    }
    if (arguments > 1) std::printf("%.17g\n", sum);
  }
  std::printf("%ld of %ld differ\n", differ, numbers);
}
