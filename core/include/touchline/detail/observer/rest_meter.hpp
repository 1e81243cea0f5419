// SPDX-License-Identifier: Apache-2.0
// What is felt of an arm at rest: the mean external torques and wrenches since it stands still and
// no touch is felt. They are the offsets that a tare takes off. No allocation in `take`.
// Theory: docs/theory.md, section 2.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/row.hpp"
#include "touchline/detail/observer/tuning.hpp"

namespace touchline {

class RestMeter {
 public:
  explicit RestMeter(const RowLayout& row, const ObserverTuning& tuning = {})
      : speed_(tuning.rest_speed),
        window_(tuning.rest_window),
        row_(row),
        torque_(row.joints, 0.0),
        wrench_(6 * row.sensors, 0.0) {}

  // The observer's row of an accepted sample, with the velocities (n) and the time [s] of it; is a
  // touch felt? The mean forgets slowly: of a touch just before, a third would still be in it.
  void take(const double* row, const double* qd, double time, bool touched) {
    const double dt = time - time_;
    time_ = time;
    const Health health = static_cast<Health>(row[row_.health()]);
    const bool usable = dt > 0.0 && (health & (kSettling | kMissing | kNonFinite | kGap)) == 0;
    if (!usable || touched || !still(qd)) {
      seconds_ = 0.0;
      return;
    }
    seconds_ += dt;
    const double part = dt / std::min(seconds_, window_);
    follow(row + row_.tau_ext(), part, torque_);
    follow(row + row_.sensor_wrench(), part, wrench_);
  }

  // For how long the arm has been at rest and untouched, and everything settled [s].
  double seconds() const { return seconds_; }
  const std::vector<double>& torque() const { return torque_; }  // (n) [Nm]; NaN: not measured
  // (k, 6) [N, Nm] on all outboard of each sensor, in its frame, at its origin.
  const std::vector<double>& wrench() const { return wrench_; }

 private:
  bool still(const double* qd) const {
    return std::all_of(qd, qd + row_.joints, [this](double v) { return std::fabs(v) < speed_; });
  }

  void follow(const double* values, double part, std::vector<double>& mean) const {
    for (std::size_t i = 0; i < mean.size(); ++i) {
      const double before = part >= 1.0 || std::isnan(mean[i]) ? values[i] : mean[i];
      mean[i] = before + part * (values[i] - before);
    }
  }

  double speed_, window_;  // [rad/s or m/s], [s]
  RowLayout row_;
  std::vector<double> torque_, wrench_;
  double time_ = 0.0, seconds_ = 0.0;
};

}  // namespace touchline
