// SPDX-License-Identifier: Apache-2.0
// Channels that others contradict: for a while they have no part in a sample. And those of which one is
// wrong, while nothing says which: all of them count on, and are told.
// Theory: docs/theory.md, section 3.4.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class LeftOut {
 public:
  explicit LeftOut(const ChannelLayout& at)
      : at_(at),
        until_(at.count(), -kAbsurd),
        unsure_until_(at.count(), -kAbsurd),
        left_(at.count()) {}

  // From the next sample on a channel counts no more, until then [s].
  void leave_out(std::size_t channel, double until) {
    until_[channel] = until;
    any_ = true;
  }
  // Until then [s] a channel is one of several of which one is wrong.
  void be_unsure_of(std::size_t channel, double until) {
    unsure_until_[channel] = until;
    any_unsure_ = true;
  }

  bool any() const { return any_; }
  bool any_unsure() const { return any_unsure_; }
  bool is_unsure(std::size_t channel, double time) const { return time < unsure_until_[channel]; }

  // What is left of a sample, valid until the next call. A channel whose time is over counts again: what
  // it has been wrong by is an offset that the whole robot begins with.
  Sample without(const Sample& sample) {
    const std::size_t n = at_.joints, w = 6 * at_.sensors;
    std::copy_n(sample.q, n, left_.data() + at_.q());
    std::copy_n(sample.qd, n, left_.data() + at_.qd());
    std::copy_n(sample.tau, n, left_.data() + at_.tau());
    std::copy_n(sample.wrench, w, left_.data() + at_.wrench());
    any_ = false;
    for (std::size_t c = at_.tau(); c < at_.count(); ++c) {
      if (sample.time >= until_[c]) until_[c] = -kAbsurd;
      if (!(until_[c] > -kAbsurd)) continue;
      left_[c] = kUnknown;
      any_ = true;
    }
    return {sample.time, left_.data() + at_.q(), left_.data() + at_.qd(), left_.data() + at_.tau(),
            left_.data() + at_.wrench()};
  }

  // Tells, where nothing else is told.
  void tell(std::vector<Fault>& faults) const {
    for (std::size_t c = 0; c < faults.size(); ++c)
      if (faults[c] == Fault::none && until_[c] > -kAbsurd) faults[c] = Fault::disagrees;
  }
  void tell_unsure(std::vector<Fault>& faults, double time) {
    any_unsure_ = false;
    for (std::size_t c = 0; c < faults.size(); ++c) {
      if (!is_unsure(c, time)) continue;
      any_unsure_ = true;
      if (faults[c] == Fault::none) faults[c] = Fault::suspect;
    }
  }

 private:
  ChannelLayout at_;
  std::vector<double> until_, unsure_until_;  // per channel [s]
  std::vector<double> left_;                  // of a sample
  bool any_ = false, any_unsure_ = false;
};

}  // namespace touchline
