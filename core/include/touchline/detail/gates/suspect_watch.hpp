// SPDX-License-Identifier: Apache-2.0
// Which channels alone explain what is felt, and have done so for long enough to be told. No
// allocation per sample.
// Theory: docs/theory.md, section 3.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/place/lone_channel.hpp"
#include "touchline/robot.hpp"

namespace touchline {

class SuspectWatch {
 public:
  // Of a robot whose parts fit; `layout` is its observer's.
  SuspectWatch(const Robot& robot, const Layout& layout)
      : at_{robot.joints.size(), robot.sensors.size()},
        least_(at_.count(), std::numeric_limits<double>::infinity()),
        now_(at_.count(), 0),
        told_(at_.count(), 0),
        since_(at_.count(), kNever),
        seen_(at_.count(), -kNever),
        until_(at_.count(), -kNever) {
    for (const DetectionRow& row : robot.rows) {
      const int sensor = layout.segments[row.segment].sensor;
      if (row.joint >= 0) least_[at_.tau() + row.joint] = kLeast * row.contact;
      if (row.component >= 0 && sensor >= 0)
        least_[at_.wrench() + 6 * sensor + row.component] = kLeast * row.contact;
    }
  }

  // A sample begins; `add` takes what is suspected of a segment; then `finish`.
  void begin() { std::fill(now_.begin(), now_.end(), 0); }
  void add(const Suspect& suspect) {
    if (!suspect.any() || !suspect.told || !(std::fabs(suspect.error) > least_[suspect.channel])) return;
    now_[suspect.channel] = 1;
    if (suspect.other >= 0) now_[suspect.other] = 1;
    any_ = true;
  }
  // Calls `out(channel, until)` for each that tells nothing until then [s].
  template <class Out>
  void finish(double time, Out&& out) {
    if (!any_) return;  // none is suspected or told, nor was it of late
    any_ = false;
    for (std::size_t c = 0; c < now_.size(); ++c) {
      if (now_[c] != 0) seen_[c] = time;
      if (!(time - seen_[c] < kMissed)) since_[c] = kNever;
      else if (!(since_[c] <= time)) since_[c] = time;
      if (now_[c] != 0 && time - since_[c] >= kDwell) out(static_cast<int>(c), until_[c] = time + kOut);
      told_[c] = time < until_[c];
      any_ = any_ || since_[c] < kNever || !(time >= until_[c]);
    }
  }

  // Per channel, as `ChannelLayout`: is it told?
  const std::vector<char>& told() const { return told_; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  static constexpr double kOut = 2.0;     // [s] for which it tells nothing after that
  static constexpr double kDwell = 0.02;  // [s] for which it explains all: a contact rises to more
  static constexpr double kMissed = 0.01; // [s] for which noise may hide it
  static constexpr double kLeast = 0.7;   // of the threshold of a contact: what it must be wrong by

  ChannelLayout at_;
  std::vector<double> least_;  // [N, Nm]
  std::vector<char> now_, told_;
  bool any_ = false;
  std::vector<double> since_, seen_, until_;  // [s]
};

}  // namespace touchline
