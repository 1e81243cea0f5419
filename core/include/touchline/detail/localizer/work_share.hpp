// SPDX-License-Identifier: Apache-2.0
// How much work a sample may do on searches: all segments that search in it share it. Those that need
// little leave the rest to others. No allocation.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <limits>

namespace touchline {

class WorkShare {
 public:
  // Units in a sample.
  explicit WorkShare(int units) : units_(units) {}

  // Units for the searches of one segment in the sample of `time` [s], of which it tells what it has
  // spent: that may be a few more. `first`: of its touch. All touches that begin in a sample share a part
  // of it, as no cache has what they need.
  int take(double time, bool first) {
    if (time != time_) {
      before_ = searching_;
      searching_ = 0;
      left_ = units_;
      left_first_ = units_ / kFirst;
      time_ = time;
    }
    first_ = first;
    const int own = left_ / std::max(1, before_ - searching_);
    return first ? std::min(own, left_first_) : own;
  }
  void spend(int units) {
    left_ = std::max(0, left_ - units);
    if (first_) left_first_ = std::max(0, left_first_ - units);
    searching_ += units > units_ / kLittle ? 1 : 0;
  }
  // Has a search been at work in the sample at hand?
  bool searched() const { return searching_ > 0; }

 private:
  static constexpr int kLittle = 16;  // so small a part of a sample's work is no search
  static constexpr int kFirst = 8;    // touches have such a part in their first sample

  int units_;
  // Of the sample of this time [s]: how many have searched, and in the one before; units that are left.
  double time_ = -std::numeric_limits<double>::infinity();
  int searching_ = 0, before_ = 0, left_ = 0, left_first_ = 0;
  bool first_ = false;  // was it the first sample of the touch that has taken last?
};

}  // namespace touchline
