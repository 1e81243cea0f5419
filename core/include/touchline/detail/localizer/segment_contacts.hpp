// SPDX-License-Identifier: Apache-2.0
// What is remembered of the contacts on one segment from sample to sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/joint_estimate.hpp"

namespace touchline {

// A sample of a segment.
struct SegmentSample {
  int segment = 0;
  double bandwidth = 0.0, time = 0.0;  // of the filter [rad/s], [s]
  double lag = 0.0;                    // how old that is which the segment's wrench speaks of [s]

  double brief() const { return 1.0 / bandwidth; }  // the memory of the filter [s]
};

struct SegmentContacts {
  static constexpr int kMost = JointEstimate::kMost;

  // Contacts at a time before anything new could have been felt.
  struct Reference {
    JointEstimate contacts;
    double time = 0.0;
  };

  bool touched = false;
  int first = -1;  // number of the contact that stands for the segment while none is known
  JointEstimate contacts;
  Age age;               // of the segment's wrench
  double explained = 0;  // since when one contact has explained all [s]
  bool explains = false;
  double looked = -1.0;  // time of the last search for a sole contact [s]
  int looked_for = -1;   // and how many were known then
  // Time of the last fit [s]. That which a contact was found by lies ahead: the noise of a filtered
  // sample tells nothing new for 1 / K.
  double updated = 0.0;
  double crept = 0.0;     // up to when the contacts may have crept [s]
  double restless = 0.0;  // when a force changed last [s]
  Reference now, before;

  // Two contacts that began at the same instant, until they count as known.
  double apart = -1.0;  // since when one contact does not explain all [s]
  double searched = -1.0, next_search = 0.0;
  int twin = -1;        // number of the second, once it is reported
  bool paired = false;
  bool walked = false;  // are they all that explain, or a first look at it?
  JointEstimate pair;
  Answer inseparable;

  bool arriving = false;  // is there something that the known contacts do not explain?
  int newcomer = -1;      // its number, once it is reported
  double since = 0.0, calm = 0.0, placed = 0.0;
  bool is_calm = false, is_placed = false;
  Age new_age;

  double met = -1.0;  // since when two contacts are one place [s]

  // One contact that slides, as it is known from where it seems to have come to rest.
  int slider = -1;
  double slid = -1.0;  // when it was seen to last [s], and where
  Answer slide;
  double weighed = 0.0, against[kMost] = {};  // what speaks against each: sum of chi2, up to when
  double rests = -1.0;  // since when it does [s]
  JointEstimate rested;

  // Notes what is known, every `interval` [s].
  void refer(double time, double interval) {
    const bool same = now.contacts.count == contacts.count;
    if (time - now.time < interval && same) return;
    if (same) before = now;
    now.contacts = contacts;
    now.time = time;
    if (before.contacts.count != contacts.count) before = now;
  }

  // Without anything to go back to, what is known now must do.
  void refer_at_last(double time) {
    if (before.contacts.count == contacts.count) return;
    before.contacts = contacts;
    before.time = time;
  }

  // What may have become of the contacts up to an instant.
  void creep(const SegmentSample& now, const LocalizerTuning& t) {
    contacts.creep(std::max(0.0, now.time - crept), now.bandwidth, t);
    crept = now.time;
  }

  // All that the sample of this instant tells has been taken over.
  void know(const SegmentSample& now) {
    updated = now.time + now.brief();
    crept = restless = now.time;
    forget_references();
  }

  void forget_references() { now.contacts.count = before.contacts.count = 0; }
};

}  // namespace touchline
