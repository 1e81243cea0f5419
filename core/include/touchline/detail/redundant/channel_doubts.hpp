// SPDX-License-Identifier: Apache-2.0
// A channel that comes to be wrong, or right again, or is at another level from now on: what begins
// about then where it is felt may be no contact. It is doubted. None of it is a collision but a blow
// that shows without the channel: in a wrench, without a joint's torque; in what other joints show; in
// what a stand-in feels without that sensor.
// Theory: docs/theory.md, section 3.5.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/events/suspicion.hpp"
#include "touchline/detail/gates/channel_gates.hpp"
#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/redundant/deputy.hpp"
#include "touchline/detail/redundant/left_out.hpp"
#include "touchline/pipeline.hpp"

namespace touchline {

class ChannelDoubts {
 public:
  // All that is handed over stays the caller's.
  ChannelDoubts(Pipeline& whole, Deputies& deputies, ChannelGates& gates)
      : whole_(whole),
        deputies_(deputies),
        gates_(gates),
        suspicions_(whole.robot().segment_names.size()),
        before_(gates.layout().count(), Fault::none) {}

  // Was any channel told at the last sample?
  bool pending() const { return pending_; }

  // What is told of the channels of a sample at `time` [s], after it was taken.
  void follow(const std::vector<Fault>& told, const LeftOut& left_out, double time) {
    pending_ = false;
    for (std::size_t c = 0; c < told.size(); ++c) {
      const bool news = told[c] != before_[c] && (is_wrong(told[c]) || is_wrong(before_[c]));
      const Moved moved = gates_.take_moved(c);
      if (moved == Moved::wrongly || news) doubt(c, time, time - kUntold);
      else if (moved == Moved::alone) doubt(c, time, kNever);  // it is no collision
      else if (told[c] == Fault::suspect && before_[c] == Fault::none && !left_out.is_unsure(c, time))
        doubt(c, time, time - kUntold, kUntold);  // what it brought beside contacts
      before_[c] = told[c];
      pending_ = pending_ || told[c] != Fault::none;
    }
  }

  // The same of what the gates tell now, before anything is made of the sample: what begins with it,
  // or was about to become a collision, is doubted, too. So is a collision, but nothing else, where a
  // channel says nothing yet.
  void foresee(const std::vector<Fault>& faults, double time) {
    for (std::size_t c = 0; c < faults.size(); ++c) {
      const Moved moved = gates_.moved_lately(c);
      const bool news = is_wrong(faults[c]) && faults[c] != before_[c];
      if (moved == Moved::wrongly || news) doubt(c, time, time - kUntold);
      else if (moved == Moved::alone) doubt(c, time, kNever);
      else if (gates_.unproven(c)) doubt(c, time, kNever, kSample);
    }
  }

  // Is what began then [s] on segment g doubted?
  bool meets(std::size_t g, double time, double began) const {
    return suspicions_[g].meets(time, began);
  }
  std::size_t segments() const { return suspicions_.size(); }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();  // [s]
  static constexpr double kUntold = 0.06;   // [s] for which a channel may be wrong before it is told
  static constexpr double kDoubtful = 1.0;  // [s] in which more of it may come
  static constexpr double kSample = 1e-6;   // [s]: one sample, whatever its period

  static bool is_wrong(Fault fault) {
    return fault == Fault::step || fault == Fault::wild || fault == Fault::stuck ||
           fault == Fault::disagrees;
  }

  // What has begun since then [s] where a channel is felt. Who does without its sensor doubts nothing.
  void doubt(std::size_t channel, double time, double since, double lasts = kDoubtful) {
    const ChannelLayout& at = gates_.layout();
    const bool torque = at.tau() <= channel && channel < at.wrench();
    const auto has = [&](const Deputy& deputy) {
      return channel < at.wrench() || !deputy.is_without((channel - at.wrench()) / 6);
    };
    const double until = time + lasts;
    const auto tell = [&](auto& one, std::size_t g) {
      torque ? one.doubt_torque(g, channel - at.tau(), since, until) : one.doubt(g, since, until);
    };
    for (std::size_t g = 0; g < suspicions_.size(); ++g) {
      if (!feels(g, channel)) continue;
      suspicions_[g].extend(time, since, until);
      tell(whole_, g);
      deputies_.visit([&](Deputy& deputy) {
        if (has(deputy)) tell(deputy, g);
      });
    }
  }

  // Is a channel part of what segment g feels? Motion is part of all.
  bool feels(std::size_t g, std::size_t channel) const {
    const ChannelLayout& at = gates_.layout();
    if (channel < at.tau()) return true;
    if (channel < at.wrench()) {
      const int joint = static_cast<int>(channel - at.tau());
      const std::vector<DetectionRow>& rows = whole_.robot().rows;
      return std::any_of(rows.begin(), rows.end(), [&](const DetectionRow& row) {
        return row.joint == joint && row.segment == static_cast<int>(g);
      });
    }
    const int sensor = static_cast<int>((channel - at.wrench()) / 6);
    const Layout& layout = whole_.observer().layout();
    const std::vector<int>& outer = layout.segments[g].successors;
    return layout.segments[g].sensor == sensor ||
           std::find(outer.begin(), outer.end(), sensor) != outer.end() ||
           layout.segment_of_sensor[sensor] < 0;  // it makes torques of joints
  }

  Pipeline& whole_;
  Deputies& deputies_;
  ChannelGates& gates_;
  std::vector<Suspicion> suspicions_;  // per segment
  std::vector<Fault> before_;          // per channel, as told of the sample before
  bool pending_ = false;               // is any of these a fault?
};

}  // namespace touchline
