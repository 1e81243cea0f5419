// SPDX-License-Identifier: Apache-2.0
// How far a row goes from its baseline while the arm moves: friction and errors of the model, which
// no noise figure tells. No allocation.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>

#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class MotionSpread {
 public:
  // A residual less its baseline [N or Nm], for a time dt [s] of motion. While it is taken for a
  // contact (`touched`) it counts for more: an error that begins with motion ends as an event soon.
  void add(double off, double dt, bool touched, const DetectorTuning& tuning) {
    const double news = touched ? tuning.motion_touched * dt : dt;
    time_ = std::min(time_ + news, tuning.motion_memory);
    if (time_ > 0.0) square_ += (off * off - square_) * std::min(1.0, news / time_);
  }

  // What motion alone hardly exceeds [N or Nm]. A friction that changes sign exceeds its own root
  // mean square twofold, against a baseline from before; an error that grows steadily 1.7-fold.
  double limit(const DetectorTuning& tuning) const {
    return tuning.motion_sigmas * std::sqrt(square_);
  }

  // Mean square of what it has been off beyond noise of one sigma `noise` [N2 or N2 m2]. In the first
  // moments that alone makes the mean of its squares up to twice as large as expected.
  double variance_beyond(double noise) const {
    return std::max(0.0, square_ - 2.0 * noise * noise);
  }

 private:
  double time_ = 0.0, square_ = 0.0;
};

}  // namespace touchline
