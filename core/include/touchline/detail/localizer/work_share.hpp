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
  // spent: that may be a few more.
  int take(double time) {
    if (time != time_) {
      before_ = searching_;
      searching_ = 0;
      left_ = units_;
      time_ = time;
    }
    return left_ / std::max(1, before_ - searching_);
  }
  void spend(int units) {
    left_ = std::max(0, left_ - units);
    searching_ += units > units_ / kLittle ? 1 : 0;
  }

 private:
  static constexpr int kLittle = 16;  // so small a part of a sample's work is no search

  int units_;
  // Of the sample of this time [s]: how many have searched, and in the one before; units that are left.
  double time_ = -std::numeric_limits<double>::infinity();
  int searching_ = 0, before_ = 0, left_ = 0;
};

}  // namespace touchline
