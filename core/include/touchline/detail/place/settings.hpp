// SPDX-License-Identifier: Apache-2.0
// What the search for a place is told: its tuning, what pushes of this robot are like, and the
// rule.
// Theory: docs/theory.md, section 8.
#pragma once

#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/place/tuning.hpp"

namespace touchline {

struct PlaceSettings : PlaceTuning {
  double friction = 0.8;     // coefficient of the friction cone, as in `Pushes`
  double finger = 0.03;      // free space that a push comes from [m]: its `reach`
  bool first_entry = false;  // the paper's rule
  double gap_sigmas = DetectorTuning{}.gap_sigmas;  // of what a gap may have left
};

}  // namespace touchline
