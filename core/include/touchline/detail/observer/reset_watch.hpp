// SPDX-License-Identifier: Apache-2.0
// Counts how often an estimate begins anew, and by how much it jumps then. Without a reset no
// estimate moves in a sample by more than its filter does; who follows it takes the jump off.
// Theory: docs/theory.md, section 2.5.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "touchline/detail/observer/row.hpp"

namespace touchline {

// How often an estimate has begun anew since it first was known. It does so after a gap that is too
// long, and once a channel that was out is back. It also does so where others step in for a lost
// sensor or stand back, and after a reset, a tare or another load.
struct Reset {
  std::uint32_t count = 0;
  // What the last one has changed the estimate by, from the last known value to that of the first
  // sample after it. Of a joint: its external torque [Nm], the first number alone. Of a segment: its
  // wrench [N, Nm], world axes, about the world origin.
  double jump[6] = {};
};

class ResetWatch {
 public:
  explicit ResetWatch(const RowLayout& row)
      : row_(row),
        resets_(row.joints + row.segments),
        seen_(resets_.size(), 0),
        begins_(resets_.size(), 0),
        last_(row.joints + 6 * row.segments, kNaN) {}

  // Takes a row of the observer. `restarts(i)`: a number that changes whenever the filter of joint
  // i, or of segment i - joints, begins anew.
  template <class Restarts>
  void step(const double* row, Restarts&& restarts) {
    const std::size_t n = row_.joints;
    double* last = last_.data();
    for (std::size_t j = 0; j < n; ++j) follow<1>(j, row + row_.tau_ext() + j, restarts(j), last++);
    for (std::size_t i = n; i < resets_.size(); ++i, last += 6)
      follow<6>(i, row + row_.segment_wrench() + 6 * (i - n), restarts(i), last);
  }

  // All begin anew: others make the estimate from now on.
  void begin_anew() { std::fill(begins_.begin(), begins_.end(), 1); }

  // Goes on with the counts of another one of the same robot, from which all begins anew.
  void go_on_from(const ResetWatch& before) {
    resets_ = before.resets_;
    last_ = before.last_;
    begin_anew();
  }

  // Per joint, then per segment.
  const std::vector<Reset>& resets() const { return resets_; }

 private:
  template <int Size>
  void follow(std::size_t i, const double* now, std::uint32_t restarts, double* last) {
    if (restarts != std::exchange(seen_[i], restarts)) begins_[i] = 1;
    for (int k = 0; k < Size; ++k) {
      if (!(now[k] == now[k])) return;
    }
    if (std::exchange(begins_[i], 0) != 0 && last[0] == last[0]) {
      ++resets_[i].count;
      for (int k = 0; k < Size; ++k) resets_[i].jump[k] = now[k] - last[k];
    }
    std::copy_n(now, Size, last);
  }

  RowLayout row_;
  std::vector<Reset> resets_;
  std::vector<std::uint32_t> seen_;
  std::vector<char> begins_;  // with the next known value
  std::vector<double> last_;  // known value of each
};

}  // namespace touchline
