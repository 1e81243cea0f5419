// SPDX-License-Identifier: Apache-2.0
// What a stand-in says, in the words of the whole robot: each row, segment and sensor of its own stands
// where the whole robot has it.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/redundant/deputy.hpp"
#include "touchline/detail/redundant/told_events.hpp"
#include "touchline/pipeline.hpp"
#include "touchline/result.hpp"

namespace touchline {

class WholeWords {
 public:
  explicit WholeWords(const Pipeline& whole)
      : layout_(whole.row_layout()),
        row_(layout_.width()),
        levels_(whole.robot().segment_names.size()),
        quiet_(levels_.size()),
        normalized_(whole.robot().rows.size()),
        drift_(normalized_.size()),
        contacts_(levels_.size() * Reports::kMost) {}

  // Valid until the next call.
  Result of(Deputy& deputy, const Result& r, ToldEvents& events) {
    const StandIn& by = deputy.given();
    put_row(deputy, r);
    put_detection(by, r);
    Result told = r;
    told.estimate = Estimate(row_.data(), layout_);
    told.levels = {levels_.data(), levels_.size()};
    told.normalized = {normalized_.data(), normalized_.size()};
    told.drift = {drift_.data(), drift_.size()};
    told.quiet = {quiet_.data(), quiet_.size()};
    told.watch = {by.watch.data(), by.watch.size()};
    told.contacts = renumbered(&deputy, r, events);
    return told;
  }

  // The contacts of a sample under the numbers under which their events are told; null: the whole robot's.
  Span<Contact> renumbered(Deputy* speaker, const Result& r, ToldEvents& events) {
    const std::size_t count = std::min(r.contacts.size(), contacts_.size());
    for (std::size_t i = 0; i < count; ++i) {
      contacts_[i] = r.contacts[i];
      if (speaker != nullptr)
        contacts_[i].segment = speaker->given().segments[contacts_[i].segment];
      events.rename(speaker, contacts_[i]);
    }
    return {contacts_.data(), count};
  }

 private:
  void put_detection(const StandIn& by, const Result& r) {
    std::fill(levels_.begin(), levels_.end(), 0);
    std::fill(quiet_.begin(), quiet_.end(), 0.0);
    std::fill(normalized_.begin(), normalized_.end(), 0.0);
    std::fill(drift_.begin(), drift_.end(), 0.0);
    for (std::size_t g = 0; g < by.segments.size(); ++g) {
      levels_[by.segments[g]] = std::max(levels_[by.segments[g]], r.levels[g]);
      quiet_[by.segments[g]] = r.quiet[g];
    }
    for (std::size_t i = 0; i < by.rows.size(); ++i) {
      if (by.rows[i] < 0) continue;
      normalized_[by.rows[i]] = r.normalized[i];
      drift_[by.rows[i]] = r.drift[i];
    }
  }

  void put_row(const Deputy& deputy, const Result& r) {
    const StandIn& by = deputy.given();
    const RowLayout &to = layout_, &from = deputy.pipeline().row_layout();
    const double* in = r.estimate.row().data();
    double* out = row_.data();
    std::fill(row_.begin(), row_.end(), kUnknown);
    std::copy_n(in, 4 * from.joints, out);  // torques, own ones, parity, innovations
    std::copy_n(in + from.joint_settled(), from.joints, out + to.joint_settled());
    std::copy_n(in + from.joint_gap_std(), from.joints, out + to.joint_gap_std());
    std::fill_n(out + to.segment_settled(), to.segments, 0.0);
    for (int s = 0; s < from.sensors; ++s)
      std::copy_n(in + from.sensor_wrench() + 6 * s, 6, out + to.sensor_wrench() + 6 * by.sensors[s]);
    for (int g = 0; g < from.segments; ++g) {
      const int h = by.segments[g];
      std::copy_n(in + from.segment_wrench() + 6 * g, 6, out + to.segment_wrench() + 6 * h);
      std::copy_n(in + from.segment_innovation() + 6 * g, 6, out + to.segment_innovation() + 6 * h);
      out[to.segment_settled() + h] = in[from.segment_settled() + g];
      std::copy_n(in + from.segment_gap_std() + 2 * g, 2, out + to.segment_gap_std() + 2 * h);
    }
    out[to.health()] = static_cast<double>(r.health);
  }

  const RowLayout& layout_;
  std::vector<double> row_;
  std::vector<int> levels_;  // per segment
  std::vector<double> quiet_, normalized_, drift_;
  std::vector<Contact> contacts_;
};

}  // namespace touchline
