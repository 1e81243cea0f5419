// SPDX-License-Identifier: Apache-2.0
// Where a position or a velocity is not believed the other stands in for it. A position is the way that
// its joint has come by its speed, for a while; a speed is what positions show, low-passed.
// Theory: docs/theory.md, section 3.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/gates/tuning.hpp"

namespace touchline {

class JointWays {
 public:
  // Of so many joints, `period` of the samples [s].
  JointWays(std::size_t joints, double period, const GatesTuning& tuning)
      : tracked_(joints), speed_(joints), acceleration_(joints), anchor_(joints), blind_(joints) {
    const double pole = std::exp(-std::min(tuning.tracking, 0.5 / period) * period),
        off = 1.0 - pole;
    follows_[0] = 1.0 - pole * pole * pole;
    follows_[1] = 1.5 * off * off * (1.0 + pole) / period;
    follows_[2] = off * off * off / (period * period);
  }

  double tracked(std::size_t j) const { return tracked_[j]; }
  double speed(std::size_t j) const { return speed_[j]; }
  double anchor(std::size_t j) const { return anchor_[j]; }
  double blind(std::size_t j) const { return blind_[j]; }

  // A position that is believed, dt [s] after the one before.
  void follow(std::size_t j, double position, double dt) {
    const double v = speed_[j], a = acceleration_[j], ahead = tracked_[j] + dt * (v + 0.5 * dt * a);
    const double off = position - ahead;
    tracked_[j] = ahead + follows_[0] * off;
    speed_[j] = v + dt * a + follows_[1] * off;
    acceleration_[j] = a + follows_[2] * off;
  }
  // Is followed anew at `time` [s] from a position; `speed`: null where it is not believed.
  void begin(std::size_t j, double position, const double* speed, double time) {
    tracked_[j] = position;
    if (speed != nullptr) speed_[j] = *speed;
    acceleration_[j] = 0.0;
    followed(time);
  }
  // All have been followed until then [s].
  void followed(double time) { at_ = time; }
  void turn(std::size_t j, double way) { tracked_[j] += way; }

  // A position is not believed any more: it is where the joint was at the last sample, and has come since
  // by its speed; null: by what positions showed.
  void lose(std::size_t j, const double* speed, double time) {
    anchor_[j] = tracked_[j] + (time - at_) * (speed != nullptr ? *speed : speed_[j]);
    blind_[j] = 0.0;
  }
  // It is where it had stood still, and has missed that way since.
  void lose_at(std::size_t j, double position) { anchor_[j] = position; }
  // Goes on by its speed for dt [s]; NaN: that is not believed either.
  void carry(std::size_t j, double speed, double dt) {
    anchor_[j] += dt * speed;
    blind_[j] += dt;
  }

 private:
  std::vector<double> tracked_, speed_, acceleration_;  // of positions that are believed
  std::vector<double> anchor_;                          // where one is that is not
  std::vector<double> blind_;                           // [s] since then
  double follows_[3] = {};
  double at_ = std::numeric_limits<double>::quiet_NaN();  // [s]
};

}  // namespace touchline
