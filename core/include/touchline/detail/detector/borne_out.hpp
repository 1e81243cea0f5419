// SPDX-License-Identifier: Apache-2.0
// What a row's residual would be if no single sample could move it: the load that each sample adds
// passes a median of three first. One odd velocity, or one packet that is logged twice and then
// replaced, is a blow and a counterblow for the filter and decays for 1 / K; a force lasts. The
// median lags by one sample. No allocation.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <algorithm>
#include <cmath>

namespace touchline {

class BorneOut {
 public:
  // The next residual [N or Nm], `dt` [s] after the one before, of a filter with `bandwidth` [rad/s].
  void add(double residual, double dt, double bandwidth) {
    if (!running_) {
      running_ = true;
      value_ = last_ = first_ = second_ = residual;
      return;
    }
    if (!(dt > 0.0)) return;
    if (dt != dt_) kept_ = std::exp(-bandwidth * (dt_ = dt));
    const double load = (residual - kept_ * last_) / (1.0 - kept_);
    const double median =
        std::max(std::min(load, second_), std::min(std::max(load, second_), first_));
    value_ = kept_ * value_ + (1.0 - kept_) * median;
    first_ = second_;
    second_ = load;
    last_ = residual;
  }

  // Samples were lost: what comes next follows nothing.
  void interrupt() { running_ = false; }

  double value() const { return value_; }  // [N or Nm]

 private:
  double value_ = 0.0, last_ = 0.0;
  double first_ = 0.0, second_ = 0.0;  // the two loads before
  double dt_ = 0.0, kept_ = 1.0;           // what the filter keeps over `dt_` [s]
  bool running_ = false;
};

}  // namespace touchline
