// SPDX-License-Identifier: Apache-2.0
// From what the robot reports to what acts on the model: gains, signs, biases, friction, axes,
// polarity, and what a driver has already taken out.
#pragma once

#include <cmath>
#include <limits>
#include <vector>

#include "touchline/health.hpp"
#include "touchline/spatial.hpp"
#include "touchline/tree.hpp"

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
  double lower = -kInfinity, upper = kInfinity;
  double bandwidth = 100.0;
  std::vector<int> nodes;    // that move with this joint: itself, then those that mimic it
  std::vector<int> sources;  // Torque::from: the sensors its torque is read from

  bool measured() const { return torque == Torque::sensor || torque == Torque::motor; }
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

// Torque of joint j that is not friction [Nm], from the logged number.
inline double read_torque(const JointRow& joint, double logged, double qd, Health& health) {
  const double reading = joint.gain * logged;
  if (std::fabs(reading) >= joint.range) health |= kSaturated;
  double friction = joint.viscous * qd;
  if (joint.coulomb != 0.0) friction += joint.coulomb * std::tanh(qd / joint.coulomb_width);
  return joint.sign * reading - joint.bias - friction;
}

// The wrench on the outboard body in the sensor frame, from six logged numbers; `health` tells of
// those among the sensor's own axes that cannot be used.
inline Spatial read_wrench(const SensorRow& sensor, const Tree& tree, const double* logged,
                           Health& health) {
  double w[6];
  for (int i = 0; i < 6; ++i) {
    if (sensor.axes[i]) health |= judge(logged[i]);
    w[i] = sensor.axes[i] ? logged[i] : 0.0;
  }
  Spatial wrench{{w[0], w[1], w[2]}, {w[3], w[4], w[5]}};
  if (sensor.turned) {
    const Mat3& R_world_sensor = tree.state(sensor.node).pose.R;
    const Mat3 R_world_log = sensor.log_node < 0
                                 ? sensor.R_node_log
                                 : tree.state(sensor.log_node).pose.R * sensor.R_node_log;
    wrench.linear = transposed_times(R_world_sensor, R_world_log * wrench.linear);
    wrench.angular = transposed_times(R_world_sensor, R_world_log * wrench.angular);
  }
  double* parts[6] = {&wrench.linear.x,  &wrench.linear.y,  &wrench.linear.z,
                      &wrench.angular.x, &wrench.angular.y, &wrench.angular.z};
  for (int i = 0; i < 6; ++i) {
    if (std::fabs(*parts[i]) >= sensor.range[i]) health |= kSaturated;
    *parts[i] = sensor.axes[i] ? sensor.sign * *parts[i] - sensor.bias[i] : 0.0;
  }
  return wrench;
}

}  // namespace touchline
