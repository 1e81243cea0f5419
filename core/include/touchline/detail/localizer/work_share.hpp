// SPDX-License-Identifier: Apache-2.0
// How much work a sample may do on searches: all segments that search in it share it. Those that need
// little leave the rest to others. No allocation.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <limits>
#include <utility>

namespace touchline {

class WorkShare {
 public:
  // Units in a sample.
  explicit WorkShare(int units) : units_(units) {}

  // Units for the searches of one segment in the sample of `time` [s], of which it tells what it has
  // spent: that may be a few more. `first`: of its touch, when no cache has what they need.
  int take(double time, bool first) {
    if (time != time_) {
      before_ = searching_;
      searching_ = 0;
      left_ = all_ = units_ / pipelines_;
      begun_ = begun_pair_ = false;
      time_ = time;
    }
    const int own = left_ / std::max(1, before_ - searching_);
    return first ? std::min(own, all_ / kFirst) : own;
  }
  void spend(int units) {
    left_ = std::max(0, left_ - units);
    searching_ += units > units_ / kLittle ? 1 : 0;
  }
  // From the next sample on: so many pipelines take each sample, which share the work.
  void divide(int pipelines) { pipelines_ = pipelines; }
  // May the search of a touch begin? One does in a sample, which is dear as no cache has what it needs: those
  // of other segments wait for the next. So do searches for two contacts.
  bool begin() { return !std::exchange(begun_, true); }
  bool begin_pair() { return !std::exchange(begun_pair_, true); }
  // Has a search been at work in the sample at hand?
  bool searched() const { return searching_ > 0; }

 private:
  static constexpr int kLittle = 16;  // so small a part of a sample's work is no search
  static constexpr int kFirst = 8;    // a touch has such a part in its first sample

  int units_, pipelines_ = 1;
  // Of the sample of this time [s]: how many have searched, and in the one before; units in all, and left.
  double time_ = -std::numeric_limits<double>::infinity();
  int searching_ = 0, before_ = 0, all_ = 0, left_ = 0;
  bool begun_ = false, begun_pair_ = false;
};

}  // namespace touchline
