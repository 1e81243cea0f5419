// SPDX-License-Identifier: Apache-2.0
// What the sensors' unfiltered loads do to the joints, projected at their instant.
// Theory: docs/theory.md, section 2.4.
#pragma once

#include <cstddef>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/observer/balance.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/terms.hpp"

namespace touchline {

class Projections {
 public:
  Projections(const Layout& layout, const TermsLayout& at)
      : lines_(at.lines),
        first_(at.subspaces()),
        mean_(6 * at.lines),
        needed_(at.sensors, 0),
        values_(at.lines * at.sensors, 0.0) {
    values_.insert(values_.end(), {0.0, kNaN});
    for (const auto* pairs :
         {&layout.inboard_sensors, &layout.outboard_sensors, &layout.source_sensors}) {
      for (const std::vector<Projection>& of_joint : *pairs) {
        for (const Projection& pair : of_joint) needed_[pair.sensor] = 1;
      }
    }
  }

  // Where the value of a pair is found, a zero, a NaN.
  std::size_t at(const Projection& pair) const { return pair.sensor * lines_ + pair.line; }
  std::size_t zero() const { return values_.size() - 2; }
  std::size_t unknown() const { return values_.size() - 1; }
  const double* values() const { return values_.data(); }

  // Takes the terms at both ends of the interval: their mean subspace is exact to second order;
  // `e`: the loads of the sensors, six numbers each.
  void project(const double* terms_before, const double* terms, const double* e) {
    average(terms_before + first_, terms + first_, mean_.data(), mean_.size());
    for (std::size_t s = 0; s < needed_.size(); ++s) {
      if (needed_[s]) multiply(mean_.data(), lines_, e + 6 * s, values_.data() + s * lines_);
    }
  }

  // The same for samples side by side. `before`: the subspaces of the sample before the first, which
  // those of the last one replace.
  void project(double* before, const Lanes* terms, const Lanes* e, std::size_t used,
               Lanes* values) const {
    for (std::size_t i = 0; i < used; ++i) {
      Lanes S[6];
      for (std::size_t c = 0; c < 6; ++c) {
        const std::size_t at = c * lines_ + i;
        const Lanes& now = terms[first_ + at];
        S[c] = 0.5 * (move_on(before[at], now) + now);
      }
      for (std::size_t s = 0; s < needed_.size(); ++s) {
        if (!needed_[s]) continue;
        const Lanes* w = e + 6 * s;
        values[s * lines_ + i] = (S[0] * w[0] + S[1] * w[1] + S[2] * w[2]) +
                                 (S[3] * w[3] + S[4] * w[4] + S[5] * w[5]);
      }
    }
  }
  std::size_t room() const { return values_.size(); }

 private:
  static void average(const double* __restrict a, const double* __restrict b,
                      double* __restrict mean, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i) mean[i] = 0.5 * (a[i] + b[i]);
  }

  // out = S^T e for all lines at once.
  static void multiply(const double* __restrict S, std::size_t lines, const double* __restrict e,
                       double* __restrict out) {
    lines &= ~std::size_t{3};  // it is a multiple of four: tells the compiler
    const double x = e[0], y = e[1], z = e[2], a = e[3], b = e[4], c = e[5];
    for (std::size_t i = 0; i < lines; ++i) {
      out[i] = (S[i] * x + S[i + lines] * y + S[i + 2 * lines] * z) +
               (S[i + 3 * lines] * a + S[i + 4 * lines] * b + S[i + 5 * lines] * c);
    }
  }

  std::size_t lines_, first_;  // where the subspaces stand among the terms
  std::vector<double> mean_;
  std::vector<char> needed_;    // by sensor
  std::vector<double> values_;  // sensor by sensor, one number per line; then 0 and NaN
};

}  // namespace touchline
