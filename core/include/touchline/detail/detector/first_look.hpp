// SPDX-License-Identifier: Apache-2.0
// How noisy a row is in the first moments: by third differences of its residual, which neither hands
// nor motion reach, so that a touch does not count as noise. No allocation.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class FirstLook {
 public:
  // The residual's variances that are told: of readings, which its filter keeps at a rate of
  // `bandwidth` [rad/s] and samples `dt` [s] apart; of velocities, which are nearly white.
  void tell(double of_readings, double of_velocities, double bandwidth, double dt) {
    if (over()) return;
    const double a = std::exp(-bandwidth * dt);
    // Of r[k] = a r[k-1] + (1 - a) (x[k] + x[k-1]) / 2, whose autocorrelations are (1 + a) / 2 times
    // 1, a and a^2.
    const double kept = kWhite - (1.0 + a) * (15.0 - 6.0 * a + a * a);
    rough_ = std::sqrt(kept * of_readings + kWhite * of_velocities);
  }

  bool ready(const DetectorTuning& t) const { return count_ >= few(t); }
  bool over() const { return count_ == kMost; }
  // What has been seen is all: later samples may be a hand's.
  void end() { count_ = kMost; }

  void add(double value, const DetectorTuning& t) {
    if (over()) return;
    const double third = value - 3.0 * (last_[0] - last_[1]) - last_[2];
    last_ = {value, last_[0], last_[1]};
    if (seen_ < last_.size()) {
      ++seen_;
    } else {
      sizes_[count_++] = std::fabs(third);
      if (count_ % static_cast<std::size_t>(t.first_often) == 0) ratio_ = measured(t);
    }
  }

  // How many times as large as told the third differences are, and so, most likely, the noise; 1
  // where they are too few, or not clearly larger.
  double ratio() const { return ratio_; }

 private:
  double measured(const DetectorTuning& t) const {
    if (count_ < few(t) || !(rough_ > 0.0)) return 1.0;
    std::array<double, kMost> sizes = sizes_;
    const auto middle = sizes.begin() + count_ / 2;
    std::nth_element(sizes.begin(), middle, sizes.begin() + count_);
    const double ratio = *middle / (kMedian * rough_);
    return ratio > t.first_clearly ? ratio : 1.0;
  }

  static std::size_t few(const DetectorTuning& t) { return static_cast<std::size_t>(t.first_few); }

  static constexpr double kWhite = 20.0;    // 1 + 9 + 9 + 1: of white noise
  static constexpr double kMedian = 0.6745;  // of the size of a normal variable, in sigmas
  static constexpr std::size_t kMost = 64;  // room: the median is right by a sixth

  std::array<double, 3> last_{};
  std::array<double, kMost> sizes_{};
  std::size_t seen_ = 0, count_ = 0;
  double rough_ = 0.0, ratio_ = 1.0;  // one sigma of the third differences as told
};

}  // namespace touchline
