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
      : segments_(segments),
        window_(window),
        times_(kMost),
        sizes_(kMost * segments),
        since_(segments, -std::numeric_limits<double>::infinity()) {}

  // The sizes [N] of the forces on all segments; `time` [s] must not go back.
  void add(double time, const double* sizes) {
    if (count_ == kMost) drop();
    const std::size_t at = index(count_++);
    times_[at] = time;
    std::copy(sizes, sizes + segments_, sizes_.data() + at * segments_);
    while (count_ > 1 && times_[index(1)] <= time - window_) drop();
  }

  // From the last sample on the size on segment g is another one: it does not compare with those before.
  void begin_anew(std::size_t g) { since_[g] = times_[index(count_ - 1)]; }

  // How fast the force on segment g grew over the window, or since the first sample [N/s]; 0 as long as
  // the window goes back to before it began anew.
  double rate(std::size_t g) const {
    const std::size_t now = index(count_ - 1);
    if (times_[first_] < since_[g]) return 0.0;
    const double span = times_[now] - times_[first_];
    return span > 0.0 ? (size(now, g) - size(first_, g)) / span : 0.0;
  }

 private:
  static constexpr std::size_t kMost = 512;  // room for samples: 10 ms at 51 kHz

  std::size_t index(std::size_t i) const { return (first_ + i) % kMost; }
  double size(std::size_t at, std::size_t g) const { return sizes_[at * segments_ + g]; }
  void drop() {
    first_ = index(1);
    --count_;
  }

  std::size_t segments_, first_ = 0, count_ = 0;
  double window_;
  std::vector<double> times_, sizes_;
  std::vector<double> since_;  // per segment [s]
};

}  // namespace touchline
