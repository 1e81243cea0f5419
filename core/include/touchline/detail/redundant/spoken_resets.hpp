// SPDX-License-Identifier: Apache-2.0
// Resets of what is said, whoever says it: an estimate begins anew also where another one speaks.
// Theory: docs/theory.md, sections 2.5 and 3.6.
#pragma once

#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

#include "touchline/detail/observer/reset_watch.hpp"
#include "touchline/detail/redundant/deputy.hpp"
#include "touchline/result.hpp"

namespace touchline {

class SpokenResets {
 public:
  SpokenResets(const RowLayout& row, std::size_t joints, std::size_t segments)
      : joints_(joints), watch_(row), restarts_(joints + segments, 0) {}

  // A result with the resets of the one that speaks; null: the whole robot. Puts in those of what is said.
  void count(Result& result, const Deputy* speaker) {
    if (speaker != std::exchange(spoke_, speaker)) watch_.begin_anew();
    const std::size_t n = joints_;
    for (std::size_t i = 0; i < result.resets.size(); ++i) {
      const std::size_t g =
          i < n || speaker == nullptr ? i : n + speaker->given().segments[i - n];
      restarts_[g] = result.resets[i].count;
    }
    watch_.step(result.estimate.row().data(), [this](std::size_t i) { return restarts_[i]; });
    result.resets = all();
  }

  Span<Reset> all() const { return {watch_.resets().data(), watch_.resets().size()}; }
  void go_on_from(const SpokenResets& before) { watch_.go_on_from(before.watch_); }

 private:
  std::size_t joints_;
  ResetWatch watch_;
  std::vector<std::uint32_t> restarts_;  // per joint, then per segment: as told by who speaks
  const Deputy* spoke_ = nullptr;        // at the last sample
};

}  // namespace touchline
