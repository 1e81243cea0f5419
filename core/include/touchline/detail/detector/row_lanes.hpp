// SPDX-License-Identifier: Apache-2.0
// A number per row of the detector, several rows side by side: what is done to all rows alike takes
// a part of the time. Each lane does what a plain double would, so that the numbers are the same to
// the last bit. No allocation after construction.
// Theory: docs/theory.md, section 4.1.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/model/lanes.hpp"

namespace touchline {

class RowLanes {
 public:
  // There is room up to a whole number of registers: what is there counts for no row.
  explicit RowLanes(std::size_t rows, double value = 0.0)
      : values_((rows + kLanes - 1) / kLanes * kLanes, value) {}

  std::size_t size() const { return values_.size(); }
  double* data() { return values_.data(); }
  double& operator[](std::size_t row) { return values_[row]; }
  double operator[](std::size_t row) const { return values_[row]; }
  Lanes at(std::size_t row) const { return load_lanes(values_.data() + row); }
  void put(std::size_t row, const Lanes& v) { store_lanes(v, values_.data() + row); }

 private:
  std::vector<double> values_;
};

// A function of bandwidth times the time step, per row. The stamps of a steady clock differ by two
// numbers that take turns, as they are rounded: both are remembered, since the function is dear.
class PerStep {
 public:
  using Function = double (*)(double);

  PerStep(const std::vector<double>& bandwidths, Function of)
      : of_(of), bandwidths_(bandwidths), known_(bandwidths.size()), other_(bandwidths.size()) {}

  // Of a step of dt [s] > 0.
  const RowLanes& after(double dt) {
    if (dt == known_.dt) return known_.values;
    std::swap(known_, other_);
    if (dt == known_.dt) return known_.values;
    known_.dt = dt;
    for (std::size_t i = 0; i < bandwidths_.size(); ++i) {
      const bool alike = i > 0 && bandwidths_[i] == bandwidths_[i - 1];
      known_.values[i] = alike ? known_.values[i - 1] : of_(bandwidths_[i] * dt);
    }
    return known_.values;
  }

  // Row i is like row `of` of another from now on.
  void take(const PerStep& other, std::size_t of, std::size_t i) {
    bandwidths_[i] = other.bandwidths_[of];
    known_.dt = other_.dt = 0.0;
  }

 private:
  struct Step {
    explicit Step(std::size_t rows) : values(rows, 0.5) {}
    double dt = 0.0;
    RowLanes values;
  };

  Function of_;
  std::vector<double> bandwidths_;
  Step known_, other_;
};

}  // namespace touchline
