// SPDX-License-Identifier: Apache-2.0
// A copy of the last sample, for who steps in with the next one. No allocation after construction.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/observer/balance.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class KeptSample {
 public:
  KeptSample(std::size_t joints, std::size_t sensors)
      : joints_(joints), values_(3 * joints + 6 * sensors) {}

  void keep(const Sample& sample) {
    double* to = std::copy_n(sample.q, joints_, values_.data());
    to = std::copy_n(sample.qd, joints_, to);
    to = std::copy_n(sample.tau, joints_, to);
    std::copy_n(sample.wrench, values_.size() - 3 * joints_, to);
    time_ = sample.time;
  }

  // Valid until the next one is kept; its time is NaN if there is none.
  Sample sample() const {
    const double* first = values_.data();
    return {time_, first, first + joints_, first + 2 * joints_, first + 3 * joints_};
  }

 private:
  std::size_t joints_;
  std::vector<double> values_;
  double time_ = kNaN;
};

}  // namespace touchline
