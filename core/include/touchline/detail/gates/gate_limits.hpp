// SPDX-License-Identifier: Apache-2.0
// What is known of each channel before anything is measured: which steps are judged, which sensor must
// feel what it feels, whether a position may turn without end.
// Theory: docs/theory.md, section 3.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/gates/tuning.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/robot.hpp"

namespace touchline {

class GateLimits {
 public:
  // Of a robot whose parts fit; `period` of its samples [s].
  GateLimits(const Robot& robot, const ChannelLayout& at, double period, const GatesTuning& tuning)
      : floors_(at.count(), std::numeric_limits<double>::infinity()),
        witnesses_(at.count(), -1),
        pushable_(at.count(), 0),
        wraps_(at.joints, 0),
        early_(at.count(), 0) {
    const auto share = [period](double bandwidth) { return 1.0 - std::exp(-bandwidth * period); };
    const auto early = [&](double bandwidth) {
      return tuning.good * period * bandwidth <= kSettles;
    };
    std::vector<double> contact(at.count(), 0.0);
    const Tree tree(robot.nodes, robot.gravity);
    const Layout layout(tree, robot.joints, robot.sensors);
    for (const DetectionRow& row : robot.rows) {
      const int sensor = layout.segments[row.segment].sensor;
      if (row.joint >= 0) contact[at.tau() + row.joint] = row.contact;
      if (row.component >= 0 && sensor >= 0)
        contact[at.wrench() + 6 * sensor + row.component] = row.contact;
    }
    for (std::size_t j = 0; j < at.joints; ++j) {
      const JointRow& joint = robot.joints[j];
      floors_[at.q() + j] = std::max(tuning.least_travel, tuning.fastest * period);
      floors_[at.qd() + j] = tuning.hardest * period;
      wraps_[j] = robot.nodes[joint.nodes[0]].kind == NodeKind::revolute;
      if (!layout.inboard_sensors[j].empty())
        witnesses_[at.tau() + j] = layout.inboard_sensors[j][0].sensor;
      const double least = std::max(contact[at.tau() + j], tuning.least_step_torque);
      if (joint.measured())
        floors_[at.tau() + j] = least / share(joint.bandwidth) / std::fabs(joint.gain);
      pushable_[at.tau() + j] = witnesses_[at.tau() + j] < 0;
      early_[at.tau() + j] = early(joint.bandwidth);
    }
    for (std::size_t c = at.wrench(); c < at.count(); c += 3) {  // axes of the log may be turned
      const SensorRow& sensor = robot.sensors[(c - at.wrench()) / 6];
      const std::size_t axis = (c - at.wrench()) % 6;
      const double least = *std::max_element(contact.begin() + c, contact.begin() + c + 3);
      for (std::size_t t = 0; t < at.sensors; ++t) {
        const int inner = robot.sensors[t].node;
        const bool inboard = sensor.node != inner && layout.is_outboard(sensor.node, inner);
        if (inboard && robot.sensors[t].six_axis())
          std::fill_n(witnesses_.begin() + c, 3, static_cast<int>(t));
      }
      const double smallest = axis == 0 ? tuning.least_step_force : tuning.least_step_torque;
      for (int i = 0; i < 3; ++i) {
        pushable_[c + i] = axis == 0 && !sensor.turned && witnesses_[c + i] < 0;
        early_[c + i] = early(sensor.bandwidth);
        if (sensor.axes[axis + i]) floors_[c + i] = std::max(least, smallest) / share(sensor.bandwidth);
      }
    }
  }

  // Of steps that are judged: one that the filters make less of than the threshold of a contact can begin
  // no event. Infinite: not a channel.
  const std::vector<double>& floors() const { return floors_; }
  bool is_watched(std::size_t c) const {
    return floors_[c] < std::numeric_limits<double>::infinity();
  }
  // The sensor that feels all that a torque or wrench feels; -1: none.
  int witness(std::size_t c) const { return witnesses_[c]; }
  // May a push move it alone? A torque, if its line meets the axes of the others, or a force, if it runs
  // along that axis through the sensor. What stays is judged by all rows then (3.6). No push loads a moment
  // alone, and of a sensor whose log has other axes (3.6) judges none.
  bool pushable(std::size_t c) const { return pushable_[c] != 0; }
  // May joint j turn without end?
  bool wraps(std::size_t j) const { return wraps_[j] != 0; }
  // May a torque or an axis reach the filters before it counts, since they wait for longer?
  bool early(std::size_t c) const { return early_[c] != 0; }

 private:
  static constexpr double kSettles = 4.0;  // [1/K] that a filter waits at least before it counts

  std::vector<double> floors_;
  std::vector<int> witnesses_;
  std::vector<char> pushable_;
  std::vector<char> wraps_;  // per joint
  std::vector<char> early_;
};

}  // namespace touchline
