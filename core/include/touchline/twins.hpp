// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant. No allocation per sample.
#pragma once

#include <algorithm>

#include "touchline/known_fit.hpp"
#include "touchline/pair_answer.hpp"
#include "touchline/reports.hpp"
#include "touchline/segment_contacts.hpp"

namespace touchline {

class Twins {
 public:
  Twins(const LinkSurfaces& surfaces, Measurement& measurement, const LocalizerSettings& settings,
        JointFit& fit, KnownFit& known, Reports& reports, std::size_t rows, int segments)
      : surfaces_(surfaces),
        measurement_(measurement),
        fit_(fit),
        known_(known),
        reports_(reports),
        pairs_(measurement.posture(), surfaces, settings, rows, segments),
        said_(settings) {}

  // One contact explains nothing, from the beginning: looks for two, again and again while their
  // forces rise, then ever more rarely.
  void follow(SegmentContacts& s, int g, const Answer& one, double lag, double bandwidth,
              double time) {
    if (s.apart < 0.0) {
      s.apart = time;
      s.next_search = time;
    }
    if (time >= s.next_search) {
      pairs_.search(g, lag, measurement_);
      take(s, one, lag);
      s.searched = time;
      s.next_search = time + std::max(SegmentContacts::kRefit / bandwidth, 0.5 * (time - s.apart));
    } else if (s.paired) {
      known_.explain_freely(s.pair, 2);
      fit_.apply_forces(s.pair);
    }
    if (!s.paired) {
      reports_.end(s.twin);
      s.twin = -1;
      s.inseparable.force = one.force;
      reports_.add(s.first, s.inseparable);
      return;
    }
    if (s.twin < 0) s.twin = reports_.next();
    s.pair[0].serial = s.first;
    s.pair[1].serial = s.twin;
    for (const KnownContact& k : s.pair) reports_.add(k);
    if (s.searched - s.apart < SegmentContacts::kYoung / bandwidth) return;
    std::copy(s.pair, s.pair + 2, s.known);
    s.count = 2;
    s.twin = -1;
    s.paired = false;
    s.apart = -1.0;
    s.updated = time + 1.0 / bandwidth;
    s.forget_references();
  }

  void forget(SegmentContacts& s) {
    reports_.end(s.twin);
    s.twin = -1;
    s.paired = false;
    s.apart = -1.0;
  }

 private:
  // Takes the outcome of a search over.
  void take(SegmentContacts& s, const Answer& one, double lag) {
    s.inseparable = one;
    s.paired = said_.separable(pairs_, measurement_.size());
    if (!s.paired) return said_.name_all(pairs_, s.inseparable);
    for (int k = 0; k < 2; ++k) {
      said_.name(pairs_, k, measurement_.size(), answer_);
      keep(answer_, surfaces_, s.pair[k]);
      s.pair[k].lag = lag;
      s.pair[k].age = s.age;
    }
  }

  const LinkSurfaces& surfaces_;
  Measurement& measurement_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  PairSearch pairs_;
  PairAnswer said_;
  Answer answer_;
};

}  // namespace touchline
