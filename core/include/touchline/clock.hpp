// SPDX-License-Identifier: Apache-2.0
// Judges time stamps: what is a sample, a repetition, a gap, a clock that was set back.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/health.hpp"

namespace touchline {

class Clock {
 public:
  enum class Verdict { refused, accepted, set_back };

  Verdict take(double time, Health& health) {
    if (!std::isfinite(time)) return refuse(health);
    const double dt = time - time_;
    if (!running_) {
      running_ = true;
    } else if (dt < kShortest && (period_ == 0.0 || dt >= -limit())) {
      return refuse(health);
    } else if (dt < 0.0) {
      *this = Clock{};
      time_ = time;
      running_ = true;
      health |= kBadTime;
      return Verdict::set_back;
    } else if (period_ == 0.0) {
      period_ = std::min(dt, kLongest);
    } else {
      follow(dt, health);
    }
    time_ = time;
    return Verdict::accepted;
  }

  // An interval longer than this [s] is not integrated over.
  double max_gap() const {
    if (gap_) return 0.0;
    return period_ > 0.0 ? limit() : std::numeric_limits<double>::infinity();
  }

 private:
  static constexpr double kGapPeriods = 3.5;  // up to three samples may be lost
  static constexpr double kShortest = 1e-9;   // stamps closer than this [s] are repetitions
  static constexpr double kLongest = 10.0;    // no robot reports less often

  static Verdict refuse(Health& health) {
    health |= kBadTime;
    return Verdict::refused;
  }
  double limit() const { return kGapPeriods * period_; }

  // The period tends to the median whatever the jitter, and soon follows another rate.
  void follow(double dt, Health& health) {
    gap_ = dt > limit();
    if (gap_) health |= kGap;
    period_ = std::min(period_ * (gap_ ? 1.25 : dt > period_ ? 1.05 : 1.0 / 1.05), kLongest);
  }

  double time_ = 0.0, period_ = 0.0;  // of the last sample; typical, 0: not known yet
  bool running_ = false, gap_ = false;
};

}  // namespace touchline
