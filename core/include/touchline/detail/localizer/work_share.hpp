// SPDX-License-Identifier: Apache-2.0
// How much work a sample may do on searches: a budget per time of the sensors' clock. So an answer takes
// as long at any sample rate. All that is searched in a sample shares it. No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

namespace touchline {

class WorkShare {
 public:
  // `rate`: units in a second. `period`: of the samples [s].
  WorkShare(double rate, double period)
      : units_(static_cast<int>(std::clamp(std::round(rate * period), 1.0, kMost))) {}

  // Units for one search in the sample of `time` [s].
  int take(double time) {
    if (time != time_) {
      before_ = taken_;
      taken_ = 0;
      left_ = units_;
      time_ = time;
    }
    const int own = std::min(left_, units_ / std::max(before_, ++taken_));
    left_ -= own;
    return own;
  }

  // In the same sample: so many of those that were taken last are not needed.
  void give_back(int units) { left_ += units; }

 private:
  static constexpr double kMost = 1e9;  // units in a sample: a bound on integers

  int units_;
  // How many have taken theirs in the sample of this time [s], so far, and in the one before; units that
  // are left in it.
  double time_ = -std::numeric_limits<double>::infinity();
  int taken_ = 0, before_ = 0, left_ = 0;
};

}  // namespace touchline
