// SPDX-License-Identifier: Apache-2.0
// What counts as noise where samples are so slow that a touch rises and falls from one to the next.
// Scatter about a short mean does not see a touch that rises more slowly than that mean; here the mean
// is one sample. So a value counts only once a few samples before and after it were quiet, too: all
// values come so much later. Elsewhere they come as they are. No allocation after construction.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/row_lanes.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class CalmValues {
 public:
  CalmValues(const DetectorRows& rows, const DetectorTuning& t)
      : rows_(rows),
        late_(rows.segments(), 0),
        quiet_(rows.segments(), 2 * kBeside + 1),
        past_(kBeside + 1, {RowLanes(rows.size()), RowLanes(rows.size()), RowLanes(rows.size())}),
        now_{RowLanes(rows.size()), RowLanes(rows.size()), RowLanes(rows.size())},
        these_(rows.size()) {
    for (std::size_t g = 0; g < rows.segments(); ++g) {
      late_[g] = rows.is_slow(g, std::exp(-t.noise_mean)) ? 1 : 0;
      any_ = any_ || late_[g] != 0;
    }
  }

  // Are the samples of a segment so slow?
  bool is_late(std::size_t g) const { return late_[g] != 0; }

  // The next sample: means of the last moments [N or Nm]; what `counts` as noise of it. Both stay the
  // caller's until the next one. Is a segment `quiet`?
  template <class Quiet>
  void add(const RowLanes& trends, const RowLanes& counts, Quiet quiet) {
    trends_ = &trends;
    counts_ = &counts;
    if (!any_) return;
    std::rotate(past_.begin(), past_.end() - 1, past_.end());
    write(past_[0]);
    write(now_);
    these_ = counts;
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      if (late_[g] == 0) continue;
      const bool calm = quiet(g);
      quiet_[g] = calm ? quiet_[g] + 1 : 0;
      for (const std::size_t i : rows_.of(g)) {
        for (RowLanes Row::* member : {&Row::values, &Row::trends, &Row::known})
          (now_.*member)[i] = (past_.back().*member)[i];
        const bool turns = !calm && counts[i] > 0.0;  // to and fro, as no hand does
        these_[i] = turns || quiet_[g] > 2 * kBeside ? 1.0 : 0.0;
      }
    }
  }

  const RowLanes& values() const { return any_ ? now_.values : rows_.residuals; }  // [N or Nm]
  const RowLanes& trends() const { return any_ ? now_.trends : *trends_; }         // [N or Nm]
  const RowLanes& known() const { return any_ ? now_.known : rows_.known; }
  const RowLanes& counts() const { return any_ ? these_ : *counts_; }

 private:
  struct Row {
    RowLanes values, trends, known;
  };

  void write(Row& row) const {
    row.values = rows_.residuals;
    row.trends = *trends_;
    row.known = rows_.known;
  }

  // Samples before and after a value that must be quiet for it to count: a touch rises and falls in
  // 0.1 s, two samples at 20 Hz. With one, more touches that are weak raise the thresholds.
  static constexpr std::size_t kBeside = 2;

  const DetectorRows& rows_;
  std::vector<char> late_;           // per segment
  std::vector<std::size_t> quiet_;   // per segment: samples without a break
  std::vector<Row> past_;            // the newest first
  Row now_;
  RowLanes these_;
  const RowLanes *trends_ = nullptr, *counts_ = nullptr;
  bool any_ = false;
};

}  // namespace touchline
