// SPDX-License-Identifier: Apache-2.0
// Do samples come as often as the noise figures, which are per sample, suppose?
#pragma once

namespace touchline {

class PeriodWatch {
 public:
  // `period`: that is supposed [s].
  explicit PeriodWatch(double period) : period_(period) {}

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
    if (++steps_ < kSteps) return;
    const double ratio = sum_ / (steps_ * period_);
    differs_ = ratio > kRatio || ratio * kRatio < 1.0;
    sum_ = 0.0;
    steps_ = 0;
  }

  // Did the last kSteps steps have another mean?
  bool differs() const { return differs_; }

 private:
  static constexpr int kSteps = 64;      // whose mean is taken: jitter of half a period is gone
  static constexpr double kRatio = 1.2;  // uncertainties err by its root, a tenth

  double period_, time_ = 0.0, sum_ = 0.0;
  int steps_ = 0;
  bool running_ = false, differs_ = false;
};

}  // namespace touchline
