// SPDX-License-Identifier: Apache-2.0
// What rows' residuals would be if no single sample could move them: the load that each sample adds
// passes a median of three first. One odd velocity, or one packet that is logged twice and then
// replaced, is a blow and a counterblow for the filter and decays for 1 / K; a force lasts. The
// median lags by one sample. All rows side by side. No allocation after construction.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/row_lanes.hpp"

namespace touchline {

class BorneOut {
 public:
  // Of rows whose filters have these bandwidths [rad/s].
  explicit BorneOut(const std::vector<double>& bandwidths)
      : kept_(bandwidths, [](double x) { return std::exp(-x); }),
        running_(bandwidths.size()),
        value_(bandwidths.size()),
        last_(bandwidths.size()),
        first_(bandwidths.size()),
        second_(bandwidths.size()) {}

  // The next residuals [N or Nm], `dt` [s] after those before. Where one is not known (0 in `known`),
  // samples were lost: what comes next follows nothing.
  void add(const RowLanes& residual, const RowLanes& known, double dt) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const RowLanes* kept = dt > 0.0 ? &kept_.after(dt) : nullptr;
    for (std::size_t i = 0; i < value_.size(); i += kLanes) {
      const Lanes r = residual.at(i), runs = running_.at(i);
      Lanes value = value_.at(i), first = first_.at(i), second = second_.at(i), last = last_.at(i);
      if (kept != nullptr) {
        const Lanes k = kept->at(i);
        const Lanes load = (r - k * last) / (one - k);
        const Lanes low = second < load ? second : load, high = load < second ? second : load;
        const Lanes upper = first < high ? first : high, median = low < upper ? upper : low;
        value = k * value + (one - k) * median;
        first = second;
        second = load;
        last = r;
      }
      value_.put(i, runs > zero ? value : r);
      first_.put(i, runs > zero ? first : r);
      second_.put(i, runs > zero ? second : r);
      last_.put(i, runs > zero ? last : r);
      running_.put(i, known.at(i));
    }
  }

  double value(std::size_t row) const { return value_[row]; }  // of a known row [N or Nm]

 private:
  PerStep kept_;  // what a filter keeps from one sample to the next
  RowLanes running_;
  RowLanes value_, last_;
  RowLanes first_, second_;  // the two loads before
};

}  // namespace touchline
