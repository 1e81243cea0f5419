// SPDX-License-Identifier: Apache-2.0
// Torques and wrenches that keep a value while the arm moves. How often a channel changes from sample to
// sample is learned, and so is for how long it keeps a value. Logs that repeat samples repeat all of
// them, which counts for nothing.
// Theory: docs/theory.md, section 3.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/gates/tuning.hpp"

namespace touchline {

class StuckWatch {
 public:
  // Of channels from `first` on to `count`. Without a change for `silent` samples one may be stuck.
  StuckWatch(std::size_t first, std::size_t count, int silent, const GatesTuning& tuning)
      : first_(first),
        count_(count),
        silent_(silent),
        tuning_(tuning),
        often_(count),
        evidence_(count),
        run_(count),
        longest_(count),
        highest_(count, -std::numeric_limits<double>::infinity()),
        lowest_(count, std::numeric_limits<double>::infinity()) {}

  // A sample dt [s] after the last one; `learned`: what it teaches of what is usual. Returns whether any
  // channel may be stuck.
  bool count_changes(const std::vector<double>& readings, const std::vector<double>& before, double dt,
                     double learned) {
    const std::size_t first = first_, count = count_;
    const double* __restrict now = readings.data();
    const double* __restrict last = before.data();
    double* __restrict often = often_.data();
    double* __restrict evidence = evidence_.data();
    double* __restrict run = run_.data();
    double* __restrict longest = longest_.data();
    double* __restrict highest = highest_.data();
    double* __restrict lowest = lowest_.data();
    double changes = 0.0, most = 0.0;
    for (std::size_t c = 0; c < count; ++c) changes += std::fabs(now[c] - last[c]) > 0.0 ? 1.0 : 0.0;
    if (changes == 0.0) return false;  // a sample that was held or came twice
    const double kept = 1.0 - std::min(1.0, dt / tuning_.run_memory);
    const double silent = silent_, rate = learned;
    const double likely = tuning_.evidence, likely_at_end = tuning_.evidence_at_end;
    for (std::size_t c = first; c < count; ++c) {
      const double d = std::fabs(now[c] - last[c]);
      const double p = often[c], p2 = p * p, p8 = p2 * p2 * p2 * p2;
      const double before = longest[c] * kept;
      longest[c] = d > 0.0 && run[c] > before ? run[c] : before;
      run[c] = d == 0.0 ? run[c] + 1.0 : 0.0;
      evidence[c] = d == 0.0 ? evidence[c] + p + p2 + 2.0 * p8 : 0.0;  // about -log(1 - p) each
      const double off = (d > 0.0 ? 1.0 : 0.0) - p;
      often[c] += d == d && run[c] < silent ? rate * off : 0.0;
      const bool edge = now[c] >= highest[c] || now[c] <= lowest[c];
      highest[c] = now[c] > highest[c] ? now[c] : highest[c];
      lowest[c] = now[c] < lowest[c] ? now[c] : lowest[c];
      const double over = evidence[c] - (edge ? likely_at_end : likely);
      most = over > most ? over : most;
    }
    return most > 0.0;
  }

  // Has a channel kept this value for too long, or at the end of its range for long enough?
  bool is_stuck(std::size_t c, double value) const {
    if (run_[c] < tuning_.runs * longest_[c]) return false;
    const bool edge = value == highest_[c] || value == lowest_[c];
    const bool stuck = run_[c] >= silent_ && evidence_[c] > tuning_.evidence;
    const bool clipped = edge && run_[c] >= tuning_.least_at_end &&
                         evidence_[c] > tuning_.evidence_at_end;
    return stuck || clipped;
  }

  // Does a channel change in too few samples for two that are alike to say anything?
  bool is_dull(std::size_t c) const { return often_[c] < tuning_.lively; }

  // A channel counts again.
  void forget(std::size_t c) { evidence_[c] = run_[c] = 0.0; }

 private:
  std::size_t first_, count_;
  int silent_;  // [samples]
  const GatesTuning& tuning_;
  std::vector<double> often_;     // of the samples
  std::vector<double> evidence_;  // [nats]
  std::vector<double> run_, longest_;    // of values that stay [samples]
  std::vector<double> highest_, lowest_;
};

}  // namespace touchline
