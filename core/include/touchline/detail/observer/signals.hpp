// SPDX-License-Identifier: Apache-2.0
// From what the robot reports to what acts on the model: gains, signs, biases, friction, axes,
// polarity, and what a driver has already taken out.
// Theory: docs/theory.md, section 2.1.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/model/spatial.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/learned_rest.hpp"

namespace touchline {

enum class Torque { sensor, motor, none, from };
enum class Compensated { none, gravity, model };

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct JointRow {
  Torque torque = Torque::sensor;
  Compensated compensated = Compensated::none;
  double sign = 1.0, gain = 1.0, bias = 0.0, range = kInfinity;
  double rotor_inertia = 0.0;
  double coulomb = 0.0, viscous = 0.0, coulomb_width = 0.05;
  double stribeck = 0.0, stribeck_speed = 0.0;  // what dry friction has more of at slow speeds
  LearnedRest rest;
  double lower = -kInfinity, upper = kInfinity;
  double bandwidth = 100.0;
  std::vector<int> nodes;    // that move with this joint: itself, then those that mimic it
  std::vector<int> sources;  // Torque::from: the sensors its torque is read from

  bool measured() const { return torque == Torque::sensor || torque == Torque::motor; }
  bool rough() const { return coulomb != 0.0 || stribeck != 0.0; }
  // Dry friction [Nm or N] at a speed: with `stribeck`, it falls to `coulomb` as the speed grows.
  double dry_friction(double speed) const {
    double size = coulomb;
    if (stribeck != 0.0) {
      const double part = speed / stribeck_speed;
      size += stribeck * std::exp(-part * part);
    }
    return size * std::tanh(speed / coulomb_width);
  }
};

struct SensorRow {
  int node = 0;  // whose frame is the sensor's
  bool axes[6] = {true, true, true, true, true, true};
  double sign = 1.0;  // +1: reports the wrench on the outboard body
  // The axes of the log: those of a node, turned by `R_node_log`; node -1 is the world. Without
  // `turned` the log gives sensor axes.
  bool turned = false;
  int log_node = -1;
  Mat3 R_node_log;
  bool gravity_compensated = false;
  double bias[6] = {0, 0, 0, 0, 0, 0};
  double range[6] = {kInfinity, kInfinity, kInfinity, kInfinity, kInfinity, kInfinity};
  double bandwidth = 100.0;

  bool six_axis() const {
    return axes[0] && axes[1] && axes[2] && axes[3] && axes[4] && axes[5];
  }
};

}  // namespace touchline
