// SPDX-License-Identifier: Apache-2.0
// The signals of all joints and sensors, read into the rows of the balances.
// Theory: docs/theory.md, section 2.1.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/spatial.hpp"
#include "touchline/detail/observer/balance.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/signals.hpp"

namespace touchline {

// Joint torques: the settings of all joints side by side.
class JointReadings {
 public:
  explicit JointReadings(const std::vector<JointRow>& joints) : joints_(joints) {
    for (std::size_t j = 0; j < joints.size(); ++j) {
      const JointRow& joint = joints[j];
      measured_.push_back(joint.measured());
      slope_.push_back(joint.sign * joint.gain);
      offset_.push_back(joint.measured() ? joint.bias : kNaN);
      viscous_.push_back(joint.viscous);
      if (joint.measured() && joint.rough()) rough_.push_back(j);
      if (joint.measured() && !joint.rest.empty()) learned_.push_back(j);
      const double range = joint.range / std::fabs(joint.gain);
      limits_.push_back(joint.measured() ? safe_limit(range) : kNoLimit);
      if (joint.measured()) limited_.push_back({j, safe_value(range)});
    }
    present_ = measured_;
  }

  // The same for samples side by side, all of which are usable.
  void read(const Lanes* logged, const Lanes* q, const Lanes* qd, const Lanes* n_bar,
            Lanes* u) const {
    const std::size_t n = slope_.size();
    for (std::size_t j = 0; j < n; ++j)
      u[j] = slope_[j] * logged[j] - offset_[j] - viscous_[j] * qd[j] - n_bar[j];
    for (std::size_t j : rough_) {
      for (int k = 0; k < kLanes; ++k) {
        const double friction = joints_[j].dry_friction(lane(qd[j], k));
        set_lane(u[j], k, lane(u[j], k) - friction);
      }
    }
    for (std::size_t j : learned_) {
      for (int k = 0; k < kLanes; ++k)
        set_lane(u[j], k, lane(u[j], k) - joints_[j].rest(lane(q[j], k), lane(qd[j], k)));
    }
  }
  // Are all torques of samples side by side usable and within their ranges?
  bool sound(const Lanes* logged) const {
    LaneMask sound = between(Lanes{}, -1.0, 1.0);
    for (const Limited& of : limited_) sound &= between(logged[of.joint], -of.limit, of.limit);
    return all_of(sound);
  }

  // Per joint: was its last torque usable?
  const std::vector<char>& present() const { return present_; }

  // Writes the known loads u = tau - friction - rest - n [Nm] (NaN for joints that have no sensor);
  // returns whether all joints that should have one have a usable torque.
  bool read(const double* logged, const double* q, const double* qd, const double* n_bar,
            double* u, Health& health) {
    convert(logged, qd, n_bar, u);
    for (std::size_t j : rough_) u[j] -= joints_[j].dry_friction(qd[j]);
    for (std::size_t j : learned_) u[j] -= joints_[j].rest(q[j], qd[j]);
    if (all_below(logged, limits_.data(), limits_.size())) {
      if (incomplete_) present_ = measured_;
      incomplete_ = false;
    } else {
      incomplete_ = !judge_each(logged, health);
    }
    return !incomplete_;
  }

 private:
  void convert(const double* __restrict logged, const double* __restrict qd,
               const double* __restrict n_bar, double* __restrict u) const {
    const double *slope = slope_.data(), *offset = offset_.data(), *viscous = viscous_.data();
    for (std::size_t j = 0; j < slope_.size(); ++j)
      u[j] = slope[j] * logged[j] - offset[j] - viscous[j] * qd[j] - n_bar[j];
  }

  bool judge_each(const double* logged, Health& health) {
    bool complete = true;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (!measured_[j]) continue;
      const Health own = judge(logged[j]);
      if (std::fabs(joints_[j].gain * logged[j]) >= joints_[j].range) health |= kSaturated;
      present_[j] = own == 0;
      complete &= own == 0;
      health |= own;
    }
    return complete;
  }

  const std::vector<JointRow>& joints_;
  std::vector<char> measured_, present_;
  std::vector<double> slope_, offset_, viscous_;
  std::vector<std::uint64_t> limits_;
  struct Limited {
    std::size_t joint;
    double limit;
  };
  std::vector<Limited> limited_;  // joints that are measured
  std::vector<std::size_t> rough_, learned_;  // joints with dry friction, with a learned rest
  bool incomplete_ = false;
};

// The wrench on a sensor's outboard body, in the sensor frame.
class SensorReading {
 public:
  explicit SensorReading(const SensorRow& sensor)
      : sensor_(sensor), usual_(sensor.six_axis() && !sensor.turned) {
    for (int i = 0; i < 6; ++i) limits_[i] = safe_limit(sensor.range[i]);
    for (int i = 0; i < 6; ++i) safe_[i] = safe_value(sensor.range[i]);
  }

  // All axes, logged in those of the sensor?
  bool usual() const { return usual_; }
  // Are readings of such a sensor, of samples side by side, usable and within its range?
  bool sound(const Lanes* logged) const {
    LaneMask sound = between(Lanes{}, -1.0, 1.0);
    for (int i = 0; i < 6; ++i) sound &= between(logged[i], -safe_[i], safe_[i]);
    return all_of(sound);
  }
  // Of such a sensor, for samples side by side that are sound.
  BasicSpatial<Lanes> read(const Lanes* logged) const {
    Lanes w[6];
    for (int i = 0; i < 6; ++i) w[i] = sensor_.sign * logged[i] - sensor_.bias[i];
    return touchline::load(w);
  }

  // From six logged numbers. `R_world_sensor`, `R_world_log`: of the sensor frame and, for a
  // turned sensor, of the axes of the log.
  Spatial read(const double* logged, const Mat3& R_world_sensor, const Mat3& R_world_log,
               Health& health) const {
    double w[6];
    if (usual_ && all_below(logged, limits_, 6)) {
      for (int i = 0; i < 6; ++i) w[i] = sensor_.sign * logged[i] - sensor_.bias[i];
    } else {
      read_each(logged, R_world_sensor, R_world_log, w, health);
    }
    return load(w);
  }

 private:
  void read_each(const double* logged, const Mat3& R_world_sensor, const Mat3& R_world_log,
                 double* w, Health& health) const {
    for (int i = 0; i < 6; ++i) {
      w[i] = sensor_.axes[i] ? logged[i] : 0.0;
      health |= judge(w[i]);
    }
    if (sensor_.turned) {
      const Spatial turned = load(w);
      store({transposed_times(R_world_sensor, R_world_log * turned.linear),
             transposed_times(R_world_sensor, R_world_log * turned.angular)}, w);
    }
    for (int i = 0; i < 6; ++i) {
      if (std::fabs(w[i]) >= sensor_.range[i]) health |= kSaturated;
      w[i] = sensor_.axes[i] ? sensor_.sign * w[i] - sensor_.bias[i] : 0.0;
    }
  }

  const SensorRow& sensor_;
  bool usual_;  // all axes, logged in those of the sensor
  std::uint64_t limits_[6];
  double safe_[6];
};

}  // namespace touchline
