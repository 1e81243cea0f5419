// SPDX-License-Identifier: Apache-2.0
// Speed and acceleration of a robot from its noisy velocities.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"

namespace touchline {

class ActivityMeter {
 public:
  // `time`: the time constant [s].
  ActivityMeter(std::size_t joints, double time) : time_(time), speed_(joints, 0.0) {}

  // Both are low-passed, so that a collision does not raise its own threshold.
  void add(const double* qd, double dt) {
    const double gain = started_ ? std::min(1.0, dt / time_) : 1.0;
    double speed2 = 0.0, acceleration2 = 0.0;
    for (std::size_t j = 0; j < speed_.size(); ++j) {
      const double off = started_ ? qd[j] - speed_[j] : 0.0;
      speed_[j] = started_ ? speed_[j] + gain * off : qd[j];
      speed2 += speed_[j] * speed_[j];
      acceleration2 += off * off;
    }
    started_ = true;
    activity_ = {speed2, std::sqrt(acceleration2) / time_};
  }

  const Activity& activity() const { return activity_; }

 private:
  double time_;
  std::vector<double> speed_;
  Activity activity_;
  bool started_ = false;
};

}  // namespace touchline
