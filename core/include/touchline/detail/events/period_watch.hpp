// SPDX-License-Identifier: Apache-2.0
// Do samples come as often as the noise figures, which are per sample, suppose?
// Theory: docs/theory.md, section 2.3.
#pragma once

#include "touchline/detail/events/tuning.hpp"

namespace touchline {

class PeriodWatch {
 public:
  // `period`: that is supposed [s].
  PeriodWatch(double period, const EventsTuning& tuning)
      : steps_most_(tuning.period_steps), ratio_most_(tuning.period_ratio), period_(period) {}

  // The time of the last accepted sample [s]; steps beyond `max_gap` [s] are gaps, not periods.
  void take(double time, double max_gap) {
    const double step = time - time_;
    time_ = time;
    if (!(step > 0.0)) return;
    if (!running_ || step > max_gap) {
      running_ = true;
      return;
    }
    sum_ += step;
    if (++steps_ < steps_most_) return;
    const double ratio = sum_ / (steps_ * period_);
    differs_ = ratio > ratio_most_ || ratio * ratio_most_ < 1.0;
    sum_ = 0.0;
    steps_ = 0;
  }

  // Did the last `period_steps` steps have another mean?
  bool differs() const { return differs_; }

 private:
  int steps_most_;
  double ratio_most_, period_, time_ = 0.0, sum_ = 0.0;
  int steps_ = 0;
  bool running_ = false, differs_ = false;
};

}  // namespace touchline
