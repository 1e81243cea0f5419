// SPDX-License-Identifier: Apache-2.0
// How large the force on each segment was over the last moments, and how fast it grows. No
// allocation per sample.
// Theory: docs/theory.md, section 7.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace touchline {

class ForceHistory {
 public:
  // `window`: over which the rate of a force is taken [s].
  ForceHistory(std::size_t segments, double window)
      : segments_(segments), window_(window), times_(kMost), sizes_(kMost * segments) {}

  // The sizes [N] of the forces on all segments; `time` [s] must not go back.
  void add(double time, const double* sizes) {
    if (count_ == kMost) drop();
    const std::size_t at = index(count_++);
    times_[at] = time;
    std::copy(sizes, sizes + segments_, sizes_.data() + at * segments_);
    while (count_ > 1 && times_[index(1)] <= time - window_) drop();
  }

  // How fast the force on segment g grew over the window, or since the beginning [N/s].
  double rate(int g) const {
    const std::size_t now = index(count_ - 1);
    const double span = times_[now] - times_[first_];
    return span > 0.0 ? (size(now, g) - size(first_, g)) / span : 0.0;
  }

 private:
  static constexpr std::size_t kMost = 512;  // room for samples: 10 ms at 51 kHz

  std::size_t index(std::size_t i) const { return (first_ + i) % kMost; }
  double size(std::size_t at, int g) const { return sizes_[at * segments_ + g]; }
  void drop() {
    first_ = index(1);
    --count_;
  }

  std::size_t segments_, first_ = 0, count_ = 0;
  double window_;
  std::vector<double> times_, sizes_;
};

}  // namespace touchline
