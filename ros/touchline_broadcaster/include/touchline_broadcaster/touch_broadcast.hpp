// SPDX-License-Identifier: Apache-2.0
// From the state interfaces of a ros2_control robot to what is felt, without ROS: which interfaces
// are read, which are given, and what goes on in between. `TouchBroadcaster` is its shell.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "touchline/touchline.hpp"

namespace touchline_broadcaster {

// One number under the name that ros2_control gives it: PREFIX/NAME.
struct Channel {
  std::string prefix, name;
  std::string full() const { return prefix + "/" + name; }
};

// The topic of a segment's wrench; a name of ROS has letters, digits and underscores.
inline std::string wrench_topic(std::string segment) {
  const auto is = [](char c, char from, char to) { return from <= c && c <= to; };
  for (char& c : segment)
    if (!is(c, 'a', 'z') && !is(c, 'A', 'Z') && !is(c, '0', '9')) c = '_';
  if (!segment.empty() && is(segment[0], '0', '9')) segment.insert(segment.begin(), '_');
  return "~/" + segment + "/wrench";
}

// Belongs to one thread at a time. `set`, `step` and `silence` neither allocate, lock nor throw.
class TouchBroadcast {
 public:
  // `joints` and `sensors` are the names of the robot's joints (n) and sensors (k) in ros2_control;
  // empty: its own. Throws std::invalid_argument where their number differs.
  explicit TouchBroadcast(touchline::Robot robot, const std::vector<std::string>& joints = {},
                          const std::vector<std::string>& sensors = {})
      : robot_(std::move(robot)) {
    const std::vector<std::string> j = named("joints", joints, robot_.joint_names);
    const std::vector<std::string> s = named("sensors", sensors, robot_.sensor_names);
    const std::size_t n = j.size();
    signals_.assign(3 * n + 6 * s.size(), touchline::kUnknown);
    for (std::size_t i = 0; i < n; ++i) {
      read(j[i], "position", i);
      read(j[i], "velocity", n + i);
      if (robot_.joints[i].measured()) read(j[i], "effort", 2 * n + i);
      exports_.push_back({j[i], "external_effort"});
    }
    for (std::size_t k = 0; k < s.size(); ++k) {
      for (std::size_t axis = 0; axis < 6; ++axis)
        if (robot_.sensors[k].axes[axis]) read(s[k], kAxes[axis], 3 * n + 6 * k + axis);
    }
    for (const std::string& segment : robot_.segment_names)
      for (const char* axis : kAxes) exports_.push_back({segment, axis});
    values_.assign(exports_.size(), touchline::kUnknown);
    begin();
  }

  // What is read: position [rad or m] and velocity of each joint, effort [Nm or N] of those whose
  // torque is measured, then the measured axes of each sensor [N, Nm].
  const std::vector<std::string>& reads() const { return reads_; }
  // What is given: JOINT/external_effort [Nm] (n), then SEGMENT/force.x to torque.z [N, Nm] (m, 6) on
  // that segment alone, world axes, about the world origin.
  const std::vector<Channel>& exports() const { return exports_; }
  // The value of export i; stays where it is as long as this object.
  double* value(std::size_t i) { return &values_[i]; }
  const touchline::Robot& robot() const { return robot_; }

  // Tells the order in which `set` will give the interfaces, by their names; others are left out.
  // Returns those that are read and are not there. Allocates.
  std::vector<std::string> assign(const std::vector<std::string>& offered) {
    std::vector<std::string> missing;
    places_.assign(offered.size(), kNone);
    for (std::size_t i = 0; i < reads_.size(); ++i) {
      const auto at = std::find(offered.begin(), offered.end(), reads_[i]);
      if (at == offered.end()) missing.push_back(reads_[i]);
      else places_[static_cast<std::size_t>(at - offered.begin())] = targets_[i];
    }
    return missing;
  }

  // The past is forgotten: the estimate starts anew, a latched collision is cleared. Allocates.
  void begin() {
    pipeline_ = std::make_unique<touchline::RedundantPipeline>(robot_);
    std::fill(signals_.begin(), signals_.end(), touchline::kUnknown);
    silence();
    collided_ = false;
  }

  // The interface that was offered as number i reads `value`; NaN: not measured.
  void set(std::size_t i, double value) {
    if (places_[i] != kNone) signals_[places_[i]] = value;
  }

  // Feels with what was set, at a time of the control loop's clock [s].
  touchline::Result step(double time) {
    const std::size_t n = robot_.joints.size();
    const double* q = signals_.data();
    const touchline::Result result = pipeline_->update({time, q, q + n, q + 2 * n, q + 3 * n});
    const touchline::Span<double> torques = result.estimate.tau_ext();
    double* out = std::copy(torques.begin(), torques.end(), values_.data());
    for (std::size_t g = 0; g < robot_.segment_names.size(); ++g) {
      const touchline::Span<double> wrench = result.estimate.segment_wrench(static_cast<int>(g));
      out = std::copy(wrench.begin(), wrench.end(), out);
    }
    for (const touchline::Contact& contact : result.contacts)
      collided_ = collided_ || contact.level == touchline::ContactLevel::collision;
    return result;
  }

  // There is no estimate: all that is given becomes NaN.
  void silence() { std::fill(values_.begin(), values_.end(), touchline::kUnknown); }

  // Has there been a collision since `begin`?
  bool collided() const { return collided_; }

 private:
  static constexpr std::size_t kNone = static_cast<std::size_t>(-1);
  static constexpr const char* kAxes[6] = {"force.x",  "force.y",  "force.z",
                                           "torque.x", "torque.y", "torque.z"};

  static std::vector<std::string> named(const char* what, const std::vector<std::string>& given,
                                        const std::vector<std::string>& own) {
    if (given.empty()) return own;
    if (given.size() == own.size()) return given;
    throw std::invalid_argument(std::string(what) + ": " + std::to_string(given.size()) +
                                " names, but the robot has " + std::to_string(own.size()));
  }

  void read(const std::string& prefix, const char* name, std::size_t target) {
    reads_.push_back(Channel{prefix, name}.full());
    targets_.push_back(target);
  }

  touchline::Robot robot_;
  std::unique_ptr<touchline::RedundantPipeline> pipeline_;
  std::vector<std::string> reads_;
  std::vector<std::size_t> targets_;  // of `reads_`, in `signals_`
  std::vector<std::size_t> places_;   // of what is offered, in `signals_`
  std::vector<Channel> exports_;
  std::vector<double> signals_;  // q (n), qd (n), tau (n), wrench (k, 6)
  std::vector<double> values_;   // of `exports_`
  bool collided_ = false;
};

}  // namespace touchline_broadcaster
