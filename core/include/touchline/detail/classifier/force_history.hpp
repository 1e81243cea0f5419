// SPDX-License-Identifier: Apache-2.0
// How large the force on each segment was over the last moments, and how fast it grows. No
// allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace touchline {

class ForceHistory {
 public:
  static constexpr double kWindow = 0.01;  // over which the rate of a force is taken [s]

  explicit ForceHistory(std::size_t segments)
      : segments_(segments), times_(kMost), sizes_(kMost * segments) {}

  // The sizes [N] of the forces on all segments; `time` [s] must not go back.
  void add(double time, const double* sizes) {
    if (count_ == kMost) drop();
    const std::size_t at = index(count_++);
    times_[at] = time;
    std::copy(sizes, sizes + segments_, sizes_.data() + at * segments_);
    while (count_ > 1 && times_[index(1)] <= time - kWindow) drop();
  }

  // How fast the force on segment g grew over the window, or since the beginning [N/s].
  double rate(int g) const {
    const std::size_t now = index(count_ - 1);
    const double span = times_[now] - times_[first_];
    return span > 0.0 ? (size(now, g) - size(first_, g)) / span : 0.0;
  }

 private:
  static constexpr std::size_t kMost = 512;  // samples: at more than 51 kHz the window is shorter

  std::size_t index(std::size_t i) const { return (first_ + i) % kMost; }
  double size(std::size_t at, int g) const { return sizes_[at * segments_ + g]; }
  void drop() {
    first_ = index(1);
    --count_;
  }

  std::size_t segments_, first_ = 0, count_ = 0;
  std::vector<double> times_, sizes_;
};

}  // namespace touchline
