// SPDX-License-Identifier: Apache-2.0
// What is remembered of each row of the detector from sample to sample. All rows side by side. No
// allocation after construction.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <cstddef>
#include <vector>

#include "touchline/detail/detector/row_lanes.hpp"

namespace touchline {

// What may stand on a row while nothing touches.
struct Calm {
  double baseline = 0.0, anchor = 0.0, shown = 0.0;  // as of `RowStates`
};

struct RowStates {
  explicit RowStates(std::size_t rows)
      : baseline(rows),
        reference(rows),
        origin(rows),
        anchor(rows),
        shown(rows),
        seconds(rows),
        trend(rows),
        age(rows),
        referred(rows),
        side(rows, 1.0),
        turns(rows),
        known(rows),
        other(rows),
        started(rows, 0) {}

  // What stands on row i when observation begins is an offset.
  void begin(std::size_t i, double at) {
    baseline[i] = anchor[i] = origin[i] = reference[i] = trend[i] = at;
    started[i] = 1;
  }

  // Row i goes on for row `of` of other states, which here stands at `at`.
  void go_on_from(const RowStates& from, std::size_t of, std::size_t i, double at) {
    const double way = at - from.baseline[of];
    for (RowLanes RowStates::* member :
         {&RowStates::baseline, &RowStates::reference, &RowStates::origin, &RowStates::anchor,
          &RowStates::shown, &RowStates::seconds, &RowStates::age, &RowStates::referred,
          &RowStates::side, &RowStates::turns, &RowStates::known})
      (this->*member)[i] = (from.*member)[of];
    for (RowLanes RowStates::* member :
         {&RowStates::baseline, &RowStates::anchor, &RowStates::origin, &RowStates::reference})
      (this->*member)[i] += way;
    other[i] = from.other[of];
    other[i].baseline += way;
    other[i].anchor += way;
    started[i] = from.started[of];
    trend[i] = at;
  }

  RowLanes baseline, reference;
  RowLanes origin;  // what stood there at the start, or rests there since a contact
  RowLanes anchor;  // the same, with what it has drifted by since
  RowLanes shown;   // the largest of these so far
  RowLanes seconds;  // since the first settled sample
  RowLanes trend;    // mean of the last moments
  RowLanes age, referred;  // over how long baseline and reference have been averaged [s]
  RowLanes side, turns;  // of its trend it was last far off on, and how often of late
  RowLanes known;        // 1: at the last sample, else 0
  // What stood there before the last contact came to rest; the model's zero at first.
  std::vector<Calm> other;
  std::vector<char> started;  // was there a settled residual ever?
};

}  // namespace touchline
