// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant. No allocation per sample.
#pragma once

#include <algorithm>

#include "touchline/localizer/known_fit.hpp"
#include "touchline/localizer/pair_answer.hpp"
#include "touchline/localizer/reports.hpp"
#include "touchline/localizer/segment_contacts.hpp"

namespace touchline {

class Twins {
 public:
  Twins(const LinkSurfaces& surfaces, Measurement& measurement, const LocalizerSettings& settings,
        JointFit& fit, KnownFit& known, Reports& reports, std::size_t rows, int segments)
      : surfaces_(surfaces),
        measurement_(measurement),
        settings_(settings),
        fit_(fit),
        known_(known),
        reports_(reports),
        pairs_(measurement.posture(), surfaces, settings, rows, segments),
        said_(settings) {}

  // One contact explains nothing, from the beginning: looks for two, again and again while their
  // forces rise, then ever more rarely.
  void follow(SegmentContacts& s, const Answer& one, const SegmentSample& now) {
    const double time = now.time;
    if (s.apart < 0.0) {
      s.apart = time;
      s.next_search = time;
    }
    if (time >= s.next_search) {
      pairs_.search(now.segment, now.lag, measurement_);
      take(s, one, now.lag);
      s.searched = time;
      const double least = SegmentContacts::kRefit * now.brief();
      s.next_search = time + std::max(least, 0.5 * (time - s.apart));
    } else if (s.paired) {
      if (known_.explain_freely(s.pair)) fit_.accept(s.pair, known_.change(), 0.0);
    }
    if (!s.paired) {
      reports_.end(s.twin);
      s.twin = -1;
      s.inseparable.force = one.force;
      reports_.add(s.first, s.inseparable);
      return;
    }
    if (s.twin < 0) s.twin = reports_.next();
    s.pair.known[0].serial = s.first;
    s.pair.known[1].serial = s.twin;
    for (int k = 0; k < 2; ++k) reports_.add(s.pair.known[k]);
    if (s.searched - s.apart < SegmentContacts::kYoung * now.brief()) return;
    s.contacts = s.pair;
    s.twin = -1;
    s.paired = false;
    s.apart = -1.0;
    s.know(now);
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
    s.pair.count = 0;
    for (int k = 0; k < 2; ++k) {
      said_.name(pairs_, k, measurement_.size(), answer_);
      s.pair.add(found_contact(-1, answer_, surfaces_, s.age, lag), settings_.force_scale);
    }
    fit_.begin(measurement_, s.pair);
    fit_.judge(s.pair);
  }

  const LinkSurfaces& surfaces_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  PairSearch pairs_;
  PairAnswer said_;
  Answer answer_;
};

}  // namespace touchline
