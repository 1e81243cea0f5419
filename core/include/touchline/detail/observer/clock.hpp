// SPDX-License-Identifier: Apache-2.0
// Judges time stamps: what is a sample, a repetition, a gap, a clock that was set back.
// Theory: docs/theory.md, section 2.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/tuning.hpp"

namespace touchline {

class Clock {
 public:
  enum class Verdict { refused, accepted, set_back };

  explicit Clock(const ObserverTuning& tuning) : tuning_(tuning) {}

  Verdict take(double time, Health& health) {
    if (!std::isfinite(time)) return refuse(health);
    if (!running_) {
      time_ = time;
      running_ = true;
      return Verdict::accepted;
    }
    const double dt = time - time_;
    if (dt < tuning_.shortest_step) return look_back(time, health);
    refusals_ = 0;
    usual_step_ = period_ > 0.0 ? limit() : std::numeric_limits<double>::infinity();
    if (period_ == 0.0) {
      period_ = std::min(dt, tuning_.longest_period);
    } else {
      follow(dt, health);
    }
    time_ = time;
    return Verdict::accepted;
  }

  // Between samples, typically [s]; 0: not known yet.
  double period() const { return period_; }
  // A step up to this [s], from the last sample, is no gap.
  double usual_step() const { return usual_step_; }
  // The next sample is the first one again.
  void forget() {
    period_ = 0.0;
    refusals_ = 0;
    running_ = false;
    usual_step_ = std::numeric_limits<double>::infinity();
  }

 private:
  static Verdict refuse(Health& health) {
    health |= kBadTime;
    return Verdict::refused;
  }
  double limit() const { return tuning_.gap_periods * period_; }

  // A stamp that does not go forward: a repetition or some disorder. If it is far back, or goes
  // on for so long, each stamp after the other, the clock must have been set back.
  Verdict look_back(double time, Health& health) {
    health |= kBadTime;
    refusals_ = refusals_ > 0 && time >= refused_ + tuning_.shortest_step ? refusals_ + 1 : 1;
    refused_ = time;
    const bool far = time - time_ < -std::max(limit(), tuning_.shortest_step);
    if (!far && refusals_ < tuning_.patience) return Verdict::refused;
    forget();
    time_ = time;
    running_ = true;
    return Verdict::set_back;
  }

  // The period tends to the median whatever the jitter, and soon follows another rate.
  void follow(double dt, Health& health) {
    const bool gap = dt > limit();
    if (gap) health |= kGap;
    const double up = gap ? tuning_.gap_growth : tuning_.period_growth;
    period_ = std::min(period_ * (dt > period_ ? up : 1.0 / up), tuning_.longest_period);
  }

  ObserverTuning tuning_;
  double time_ = 0.0, period_ = 0.0;  // of the last sample; typical, 0: not known yet
  double refused_ = 0.0;  // the last stamp that was, and how many in a row
  int refusals_ = 0;
  double usual_step_ = std::numeric_limits<double>::infinity();
  bool running_ = false;
};

}  // namespace touchline
