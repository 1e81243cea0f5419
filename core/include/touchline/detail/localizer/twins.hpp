// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant. No allocation per sample.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <memory>
#include <vector>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/pair_answer.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"

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
        said_(settings) {
    for (int g = 0; g < segments; ++g)
      parts_.push_back(std::make_unique<PairParts>(pairs_.view(), settings));
  }

  // One contact explains nothing, from the beginning: looks for two, again and again while their
  // forces rise, then ever more rarely.
  void follow(SegmentContacts& s, const Answer& one, const SegmentSample& now) {
    const double time = now.time;
    if (s.apart < 0.0) {
      s.apart = s.next_search = time;
      s.walked = false;
      parts_[now.segment]->drop();
    }
    if (time >= s.next_search) {
      pairs_.search(now.segment, now.lag, measurement_);
      take(s, one, now);
      s.searched = time;
      const double least = settings_.refit * now.brief();
      s.next_search = time + std::max(least, settings_.search_growth * (time - s.apart));
    } else if (s.paired) {
      if (known_.explain_freely(s.pair)) fit_.accept(s.pair, known_.change(), 0.0);
    } else {
      walk(s, *parts_[now.segment]);
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
    if (s.searched - s.apart < settings_.young * now.brief()) return;
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
  void take(SegmentContacts& s, const Answer& one, const SegmentSample& now) {
    PairParts& parts = *parts_[now.segment];
    s.paired = said_.separable(pairs_, measurement_.size());
    if (!s.paired) {
      if (!s.walked) {
        s.inseparable = one;
        said_.name_all(pairs_, s.inseparable);
      }
      if (!parts.working() && now.time - s.apart >= settings_.risen * now.brief()) {
        parts.begin(pairs_);
        conclude(s, parts);
      }
      return;
    }
    s.walked = false;
    parts.drop();
    s.pair.count = 0;
    for (int k = 0; k < 2; ++k) {
      said_.name(pairs_, k, measurement_.size(), answer_);
      s.pair.add(found_contact(-1, answer_, surfaces_, s.age, now.lag), settings_);
    }
    fit_.begin(measurement_, s.pair);
    fit_.judge(s.pair);
  }

  // Goes on with what explains as well; what was said before stands until all is met.
  void walk(SegmentContacts& s, PairParts& parts) {
    if (!parts.working()) return;
    parts.work(settings_.pair_steps);
    conclude(s, parts);
  }

  void conclude(SegmentContacts& s, const PairParts& parts) {
    if (parts.working()) return;
    if (parts.count() > 0) {
      said_.name_all(parts, surfaces_, s.inseparable);
      s.walked = true;
    } else if (pairs_.exhaustive()) {
      said_.name_none(pairs_, s.inseparable);
      s.walked = true;
    }
  }

  const LinkSurfaces& surfaces_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  PairSearch pairs_;
  std::vector<std::unique_ptr<PairParts>> parts_;  // per segment
  PairAnswer said_;
  Answer answer_;
};

}  // namespace touchline
