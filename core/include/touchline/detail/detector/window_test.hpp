// SPDX-License-Identifier: Apache-2.0
// A generalized likelihood ratio on the loads of the last N samples, not filtered. With e the mean
// external load over an interval, S_N = sum e dt = p_k - p_k-N - sum u dt. Velocity noise enters at
// both ends only. So its covariance is 2 A + N dt^2 B + T^2 C for the covariances A of the
// momentum, B of the readings and C of the model's errors. Of several N the largest ratio counts.
// Over lost samples S_N spans more than N periods: its covariance is taken to grow with the square
// of the time, as that of C does. No allocation in `add` and `statistic`.
// Theory: docs/theory.md, section 4.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/model/dense.hpp"

namespace touchline {

class WindowTest {
 public:
  WindowTest(std::size_t rows, const std::vector<double>& windows, double period)
      : rows_(rows), period_(period), scratch_(rows * rows) {
    for (const double window : windows) {
      const auto count = static_cast<std::size_t>(std::max(1.0, std::round(window / period)));
      if (std::find(counts_.begin(), counts_.end(), count) == counts_.end())
        counts_.push_back(count);
    }
    room_ = *std::max_element(counts_.begin(), counts_.end()) + 1;
    impulses_.assign(room_ * rows, 0.0);
    for (auto* times : {&times_, &lost_}) times->assign(room_, 0.0);
    factors_.assign(counts_.size() * rows * rows, 0.0);
    usable_.assign(counts_.size(), 0);
  }

  // Begins anew, with `size` rows in use.
  void restart(std::size_t size) {
    size_ = size;
    filled_ = 1;
    at_ = 0;
    std::fill(impulses_.begin(), impulses_.end(), 0.0);
    times_[0] = lost_[0] = 0.0;
  }

  // Covariances (size, size) of one sample; `model` (size): variances.
  void weigh(const double* momentum, const double* reading, const double* model) {
    for (std::size_t w = 0; w < counts_.size(); ++w) {
      const double T = static_cast<double>(counts_[w]) * period_;
      double* f = scratch_.data();
      for (std::size_t i = 0; i < size_ * size_; ++i)
        f[i] = 2.0 * momentum[i] + T * period_ * reading[i];
      for (std::size_t i = 0; i < size_; ++i) f[i * size_ + i] += T * T * model[i];
      usable_[w] = cholesky(f, static_cast<int>(size_), 1e-15);
      if (usable_[w]) invert_lower(f, static_cast<int>(size_), factors_.data() + w * rows_ * rows_);
    }
  }

  // The mean loads e of an interval dt, with samples lost in it if it is a `gap`.
  void add(const double* e, double dt, bool gap) {
    const double* last = impulses_.data() + at_ * rows_;
    const double time = times_[at_] + dt, lost = lost_[at_] + (gap ? dt - period_ : 0.0);
    at_ = at_ + 1 == room_ ? 0 : at_ + 1;
    double* next = impulses_.data() + at_ * rows_;
    for (std::size_t i = 0; i < size_; ++i) next[i] = last[i] + e[i] * dt;
    times_[at_] = time;
    lost_[at_] = lost;
    filled_ = std::min(filled_ + 1, room_);
  }

  // The root of the largest ratio; `offset`: loads that count as none.
  double statistic(const double* offset) {
    double most = 0.0;
    const double* now = impulses_.data() + at_ * rows_;
    for (std::size_t w = 0; w < counts_.size(); ++w) {
      if (!usable_[w] || counts_[w] >= filled_) continue;
      const std::size_t from = (at_ + room_ - counts_[w]) % room_;
      const double* then = impulses_.data() + from * rows_;
      const double T = times_[at_] - times_[from];
      const double shorter = 1.0 - (lost_[at_] - lost_[from]) / T;
      for (std::size_t i = 0; i < size_; ++i)
        scratch_[i] = shorter * (now[i] - then[i] - T * offset[i]);
      most = std::max(most, squared_norm(factors_.data() + w * rows_ * rows_, scratch_.data(),
                                         static_cast<int>(size_)));
    }
    return std::sqrt(most);
  }

 private:
  std::size_t rows_, size_ = 0, room_ = 0, at_ = 0, filled_ = 0;
  double period_;
  std::vector<std::size_t> counts_;  // samples of each window
  std::vector<double> impulses_, times_, lost_, scratch_;
  std::vector<double> factors_;  // inverse, by window
  std::vector<char> usable_;
};

}  // namespace touchline
