// SPDX-License-Identifier: Apache-2.0
// Speed and acceleration of a robot from its noisy velocities, and for how long it has not moved.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class ActivityMeter {
 public:
  // `tuning` stays the caller's.
  ActivityMeter(std::size_t joints, const DetectorTuning& tuning)
      : tuning_(tuning), speed_(joints, 0.0), still_(tuning.pause) {}

  // Both are low-passed, so that a collision does not raise its own threshold.
  void add(const double* qd, double dt) {
    const double gain = started_ ? std::min(1.0, dt / tuning_.activity_time) : 1.0;
    double speed2 = 0.0, acceleration2 = 0.0;
    for (std::size_t j = 0; j < speed_.size(); ++j) {
      const double off = started_ ? qd[j] - speed_[j] : 0.0;
      speed_[j] = started_ ? speed_[j] + gain * off : qd[j];
      speed2 += speed_[j] * speed_[j];
      acceleration2 += off * off;
    }
    started_ = true;
    activity_ = {speed2, std::sqrt(acceleration2) / tuning_.activity_time};
    still_ = speed2 > tuning_.moving * tuning_.moving ? 0.0 : still_ + dt;
  }

  const Activity& activity() const { return activity_; }
  // Does the arm move? One that pauses for a moment goes on moving. Has it stopped within the last dt [s]?
  bool moves() const { return still_ < tuning_.pause; }
  bool has_stopped(double dt) const { return !moves() && still_ - dt < tuning_.pause; }
  // Does it stand, and not even yield to a hand?
  bool stands() const { return activity_.speed2 < tuning_.standing * tuning_.standing; }
  // It goes on standing, or moving, as another one does.
  void go_on_from(const ActivityMeter& other) { still_ = other.still_; }

 private:
  const DetectorTuning& tuning_;
  std::vector<double> speed_;
  Activity activity_;
  double still_;  // for how long it has not moved [s]
  bool started_ = false;
};

}  // namespace touchline
