// SPDX-License-Identifier: Apache-2.0
// Speed and acceleration of a robot from its noisy velocities.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"

namespace touchline {

class ActivityMeter {
 public:
  explicit ActivityMeter(std::size_t joints) : speed_(joints, 0.0) {}

  // Both are low-passed over `kTime`, so that a collision does not raise its own threshold.
  void add(const double* qd, double dt) {
    const double gain = started_ ? std::min(1.0, dt / kTime) : 1.0;
    double speed2 = 0.0, acceleration2 = 0.0;
    for (std::size_t j = 0; j < speed_.size(); ++j) {
      const double off = started_ ? qd[j] - speed_[j] : 0.0;
      speed_[j] = started_ ? speed_[j] + gain * off : qd[j];
      speed2 += speed_[j] * speed_[j];
      acceleration2 += off * off;
    }
    started_ = true;
    activity_ = {speed2, std::sqrt(acceleration2) / kTime};
  }

  const Activity& activity() const { return activity_; }

 private:
  static constexpr double kTime = 0.05;  // [s]

  std::vector<double> speed_;
  Activity activity_;
  bool started_ = false;
};

}  // namespace touchline
