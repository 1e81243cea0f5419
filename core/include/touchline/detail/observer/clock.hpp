// SPDX-License-Identifier: Apache-2.0
// Judges time stamps: what is a sample, a repetition, a gap, a clock that was set back.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/observer/health.hpp"

namespace touchline {

class Clock {
 public:
  enum class Verdict { refused, accepted, set_back };

  Verdict take(double time, Health& health) {
    if (!std::isfinite(time)) return refuse(health);
    if (!running_) {
      time_ = time;
      running_ = true;
      return Verdict::accepted;
    }
    const double dt = time - time_;
    if (dt < kShortest) return look_back(time, health);
    refusals_ = 0;
    if (period_ == 0.0) {
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
  static constexpr double kGapPeriods = 3.5;  // up to two samples may be lost
  static constexpr double kShortest = 1e-9;   // stamps closer than this [s] are repetitions
  static constexpr double kLongest = 10.0;    // no robot reports less often
  static constexpr int kPatience = 10;        // stamps

  static Verdict refuse(Health& health) {
    health |= kBadTime;
    return Verdict::refused;
  }
  double limit() const { return kGapPeriods * period_; }

  // A stamp that does not go forward: a repetition or some disorder, unless it is far back or goes
  // on for so long, each stamp after the other, that the clock must have been set back.
  Verdict look_back(double time, Health& health) {
    health |= kBadTime;
    refusals_ = refusals_ > 0 && time >= refused_ + kShortest ? refusals_ + 1 : 1;
    refused_ = time;
    const bool far = time - time_ < -std::max(limit(), kShortest);
    if (!far && refusals_ < kPatience) return Verdict::refused;
    *this = Clock{};
    time_ = time;
    running_ = true;
    return Verdict::set_back;
  }

  // The period tends to the median whatever the jitter, and soon follows another rate.
  void follow(double dt, Health& health) {
    gap_ = dt > limit();
    if (gap_) health |= kGap;
    period_ = std::min(period_ * (gap_ ? 1.25 : dt > period_ ? 1.05 : 1.0 / 1.05), kLongest);
  }

  double time_ = 0.0, period_ = 0.0;  // of the last sample; typical, 0: not known yet
  double refused_ = 0.0;  // the last stamp that was, and how many in a row
  int refusals_ = 0;
  bool running_ = false, gap_ = false;
};

}  // namespace touchline
