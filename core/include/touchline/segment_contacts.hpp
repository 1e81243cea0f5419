// SPDX-License-Identifier: Apache-2.0
// What is remembered of the contacts on one segment from sample to sample.
#pragma once

#include <algorithm>

#include "touchline/joint_fit.hpp"

namespace touchline {

struct SegmentContacts {
  static constexpr int kMost = JointFit::kMost;
  static constexpr double kYoung = 3.0;  // times 1 / K, until a contact counts as known
  static constexpr double kRefit = 0.5;  // times 1 / K, between fits of a sole contact

  // Contacts at a time before anything new could have been felt.
  struct Reference {
    int count = 0;
    KnownContact known[kMost];
    JointFit::Uncertainty uncertainty;
  };

  bool touched = false;
  int first = -1;  // number of the contact that stands for the segment while none is known
  int count = 0;
  KnownContact known[kMost];
  Age age;               // of the segment's wrench
  double explained = 0;  // since when one contact has explained all [s]
  bool explains = false;
  // Time of the last fit of the places [s]. That which a contact was found by lies ahead: the noise
  // of a filtered sample tells nothing new for 1 / K.
  double updated = 0.0;
  double referred = 0.0; // and of the last reference [s]
  Reference now, before;

  // Two contacts that began at the same instant, until they count as known.
  double apart = -1.0;  // since when one contact does not explain all [s]
  double searched = -1.0, next_search = 0.0;
  int twin = -1;        // number of the second, once it is reported
  bool paired = false;
  KnownContact pair[2];
  Answer inseparable;

  bool arriving = false;  // is there something that the known contacts do not explain?
  int newcomer = -1;      // its number, once it is reported
  double since = 0.0, calm = 0.0, placed = 0.0;
  bool is_calm = false, is_placed = false;
  Age new_age;

  // Notes where the contacts were found by a fit, every `interval` [s].
  void refer(const JointFit& fit, double time, double interval) {
    if (time - referred < interval && now.count == count) return;
    referred = time;
    if (now.count == count) before = now;
    now.count = count;
    std::copy(known, known + count, now.known);
    fit.uncertainty(now.uncertainty);
    if (before.count != count) before = now;
  }

  // Without a fit to go back to, what is known now must do: forces to `sigma` [N].
  void refer(double sigma) {
    if (before.count == count) return;
    before.count = count;
    std::copy(known, known + count, before.known);
    JointFit::independent(known, count, sigma, before.uncertainty);
  }

  void forget_references() { now.count = before.count = 0; }
};

}  // namespace touchline
