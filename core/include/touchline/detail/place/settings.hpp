// SPDX-License-Identifier: Apache-2.0
// What the search for a place is told: its tuning, what pushes of this robot are like, and the
// rule.
// Theory: docs/theory.md, section 8.
#pragma once

#include <algorithm>

#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/place/tuning.hpp"

namespace touchline {

// What touches: pushes come within the cone of the coefficient `friction`, and need `reach` [m] of
// free space in front of the surface.
struct Pushes {
  double friction = 0.8, reach = 0.03;
};

struct PlaceSettings : PlaceTuning {
  double friction = Pushes{}.friction;
  double finger = Pushes{}.reach;
  bool first_entry = false;  // the paper's rule
  double gap_sigmas = DetectorTuning{}.gap_sigmas;  // of what a gap may have left

  // Units of work in a sample of `period` [s].
  int sample_work(double period) const {
    return std::max(1, static_cast<int>(search_work * std::min(1.0, period / short_sample)));
  }
};

}  // namespace touchline
