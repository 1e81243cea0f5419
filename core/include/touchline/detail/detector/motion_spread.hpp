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
  // What motion has shown of a row beyond its noise: mean squares [N2 or N2 m2], and of how far the arm
  // was from where the baseline was averaged [rad2].
  struct Shown {
    double square = 0.0, way2 = 0.0;
    // Variance of what the arm is off by so far from there: an error of weight grows on the way.
    double at(double way2_now, const DetectorTuning& t) const {
      const double share = way2_now / (way2 + t.drift_least * t.drift_least);
      return square * std::max(t.drift_shown * t.drift_shown, t.drift_grown * t.drift_grown * share);
    }
  };

  // A residual less its baseline [N or Nm], for a time dt [s] of motion, so far from where that was
  // averaged [rad2]. While it `begins` to show it counts for more: what it makes an event of ends soon.
  void add(double off, double way2, double dt, bool begins, const DetectorTuning& tuning) {
    const double news = begins ? tuning.motion_touched * dt : dt;
    time_ = std::min(time_ + news, tuning.motion_memory);
    if (!(time_ > 0.0)) return;
    const double share = std::min(1.0, news / time_);
    square_ += (off * off - square_) * share;
    way2_ += (way2 - way2_) * share;
  }

  // What motion alone hardly exceeds [N or Nm]. A friction that changes sign exceeds its own root
  // mean square twofold, against a baseline from before; an error that grows steadily 1.7-fold.
  double limit(const DetectorTuning& tuning) const {
    return tuning.motion_sigmas * std::sqrt(square_);
  }

  // What it has been off beyond noise of one sigma `noise` [N or Nm]. In the first moments that alone
  // makes the mean of its squares up to twice as large as expected. A short motion has not shown all.
  Shown beyond(double noise, const DetectorTuning& tuning) const {
    if (!(time_ > 0.0)) return {};
    const double doubt = 1.0 + tuning.motion_few / time_;
    return {doubt * std::max(0.0, square_ - 2.0 * noise * noise), way2_};
  }

 private:
  double time_ = 0.0, square_ = 0.0, way2_ = 0.0;
};

}  // namespace touchline
