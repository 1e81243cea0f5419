// SPDX-License-Identifier: Apache-2.0
// A velocity is the derivative of its position: what positions and velocities differ by, over some
// samples, is compared with what they have differed by so far. And which of the two stands still.
// Of a joint that is slow little is enough: what a velocity is wrong by grows with itself, and, as it
// comes late, with its changes. A position is at most a sample behind.
// Theory: docs/theory.md, section 3.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/gates/tuning.hpp"

namespace touchline {

class SpeedWatch {
 public:
  // Of so many joints, `period` of the samples [s]. One that has not changed for `silent` samples needs
  // little to be told from one that is right.
  SpeedWatch(std::size_t joints, double period, int silent, const GatesTuning& tuning)
      : joints_(joints),
        silent_(silent),
        period_(period),
        tuning_(tuning),
        over_(std::max(tuning.speed_window, tuning.speed_window_samples * period)),
        kept_(std::exp(-period / over_)),
        least_(tuning.speed_error * over_),
        drift_(joints),
        way_(joints),
        turn_(joints),
        usual_(joints),
        most_(joints),
        grain_(2 * joints, std::numeric_limits<double>::infinity()),
        same_(2 * joints),
        often_(2 * joints) {}

  // A sample dt [s] after the last one: positions of all joints, then velocities. `learned`: what it
  // teaches of what is usual. Returns whether any two disagree, or a velocity may be dead.
  bool compare(const std::vector<double>& readings, const std::vector<double>& before, double dt,
               double learned) {
    const std::size_t n = joints_;
    const double* __restrict now = readings.data();
    const double* __restrict last = before.data();
    double* __restrict drift = drift_.data();
    double* __restrict way = way_.data();
    double* __restrict turn = turn_.data();
    double* __restrict usual = usual_.data();
    double* __restrict limit = most_.data();
    double* __restrict grain = grain_.data();
    const double silent = silent_, rate = learned, kept = kept_;
    const double stands = tuning_.stands, surely = tuning_.surely, stale = tuning_.stale;
    const double disagrees = tuning_.disagrees, lively = tuning_.lively;
    const double slight = tuning_.speed_slight * over_, part = tuning_.speed_part,
                 late = tuning_.speed_late, period = period_;
    double* __restrict same = same_.data();
    double* __restrict often = often_.data();
    for (std::size_t c = 0; c < 2 * n; ++c) {
      const bool changes = !(now[c] == last[c]);
      const double change = std::fabs(now[c] - last[c]);
      grain[c] = change > 0.0 && change < grain[c] ? change : grain[c];
      same[c] = changes ? 0.0 : same[c] + 1.0;
      often[c] += same[c] < stands ? rate * ((changes ? 1.0 : 0.0) - often[c]) : 0.0;
    }
    const double least = least_;
    double worst = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      const double step = now[j] - last[j], travel = 0.5 * dt * (now[n + j] + last[n + j]);
      const double sum = kept * drift[j] + step - travel, size = std::fabs(sum);
      const double by_speed = kept * way[j] + travel;
      const double faster = kept * turn[j] + now[n + j] - last[n + j];
      drift[j] = sum == sum ? sum : 0.0;
      way[j] = by_speed == by_speed ? by_speed : 0.0;
      turn[j] = faster == faster ? faster : 0.0;
      const bool alive = same[n + j] < stands && often[n + j] > lively && often[j] > lively;
      const double lag = turn[j] * drift[j] > 0.0 ? late : period;
      const double clear = slight + part * std::fabs(way[j]) + lag * std::fabs(turn[j]) +
                           kGrains * grain[j];
      const double error = alive && clear < least ? clear : least;
      const double most = disagrees * usual[j] > error ? disagrees * usual[j] : error;
      const double clipped = size < most ? size : most;
      usual[j] += rate * (clipped - usual[j]);
      limit[j] = most;
      const bool dead = same[n + j] >= stands && often[n + j] > surely;
      const double over = dead ? 2.0 : (same[n + j] < silent ? size : stale * size) / most;
      worst = over > worst ? over : worst;
    }
    return worst > 1.0;
  }

  // Do position and velocity of joint j disagree?
  bool far(std::size_t j) const {
    const double off = std::fabs(drift_[j]) * (same_[joints_ + j] >= silent_ ? tuning_.stale : 1.0);
    return off > most_[j];
  }
  // Has a velocity that changes with each sample stopped to do so?
  bool is_still(std::size_t j) const {
    return same_[joints_ + j] >= tuning_.stands && often_[joints_ + j] > tuning_.surely;
  }
  // For how many samples a position (c = j) or velocity (c = joints + j) has been the same.
  double same(std::size_t c) const { return same_[c]; }
  // Is what a position or velocity has changed by no more than what rounding makes of it?
  bool is_rounding(std::size_t c, double change) const { return change <= kGrains * grain_[c]; }
  // Does it change in too few samples for two that are alike to say anything?
  bool is_dull(std::size_t c) const { return often_[c] < tuning_.lively; }

  // What joint j has differed by counts no more; that of all.
  void forget(std::size_t j) { drift_[j] = way_[j] = turn_[j] = 0.0; }
  void forget_all() {
    for (std::vector<double>* sums : {&drift_, &way_, &turn_})
      std::fill(sums->begin(), sums->end(), 0.0);
  }

 private:
  static constexpr double kGrains = 2.0;  // what is rounded stands until it has come by one of them

  std::size_t joints_;
  int silent_;  // [samples]
  double period_;  // [s]
  const GatesTuning& tuning_;
  double over_, kept_, least_;  // [s]; of a sum from sample to sample; [rad or m]
  std::vector<double> drift_, way_;    // per joint: what they differ by; its way by its velocity [rad or m]
  std::vector<double> turn_;           // by what its velocity has changed [rad/s or m/s]
  std::vector<double> usual_, most_;   // of what they differ by: the mean, and what is believed [rad or m]
  std::vector<double> grain_;          // the smallest change of each position, then velocity
  std::vector<double> same_, often_;   // per position, then per velocity: samples; of the samples
};

}  // namespace touchline
