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
        said_(surfaces, settings) {
    for (int g = 0; g < segments; ++g)
      work_.push_back(std::make_unique<Work>(measurement.posture(), surfaces, settings, rows, g));
  }

  // One contact explains nothing, from the beginning: looks for two, again and again while their
  // forces rise, then ever more rarely.
  void follow(SegmentContacts& s, const Answer& one, const SegmentSample& now) {
    const double time = now.time;
    Together& two = s.together;
    Work& work = *work_[now.segment];
    if (!s.state.is(Tracking::pair)) {
      s.state.enter(Tracking::pair);
      s.suspected.explained.reset();
      two = Together{};
      two.since = two.next_search = time;
      work.parts.drop();
    }
    if (time >= two.next_search) {
      work.search.search(now.lag, measurement_);
      take(s, work, one, now);
      two.searched = time;
      const double least = settings_.refit * now.brief();
      two.next_search = time + std::max(least, settings_.search_growth * (time - two.since));
    } else if (two.separable) {
      if (known_.explain_freely(two.contacts)) fit_.accept(two.contacts, known_.change(), 0.0);
    } else {
      walk(two, work);
    }
    if (!two.separable) {
      end_second(two);
      two.inseparable.force = one.force;
      reports_.add(s.touched.first, two.inseparable);
      return;
    }
    if (!two.second) two.second = reports_.next();
    two.contacts.known[0].serial = s.touched.first;
    two.contacts.known[1].serial = *two.second;
    for (int k = 0; k < 2; ++k) reports_.add(two.contacts.known[k]);
    if (two.searched - two.since < settings_.young * now.brief()) return;
    s.known.contacts = two.contacts;
    s.know(now);
    s.state.enter(Tracking::several);
  }

  // A single contact explains after all.
  void forget(SegmentContacts& s) {
    end_second(s.together);
    s.state.enter(Tracking::suspected);
  }

 private:
  void end_second(Together& two) {
    if (two.second) reports_.end(*two.second);
    two.second.reset();
  }

  // The search for pairs on a segment, and the walk from where one has ended.
  struct Work {
    Work(const Posture& posture, const LinkSurfaces& surfaces, const LocalizerSettings& settings,
         std::size_t rows, int g)
        : search(posture, surfaces, settings, rows, g), parts(search.view(), settings) {}
    PairSearch search;
    PairParts parts;
  };

  // Takes the outcome of a search over.
  void take(SegmentContacts& s, Work& work, const Answer& one, const SegmentSample& now) {
    Together& two = s.together;
    two.separable = said_.separable(work.search);
    if (!two.separable) {
      if (!two.walked) {
        two.inseparable = one;
        said_.name_all(work.search, two.inseparable);
      }
      if (!work.parts.working() && now.time - two.since >= settings_.risen * now.brief()) {
        work.parts.begin(work.search);
        conclude(two, work);
      }
      return;
    }
    two.walked = false;
    work.parts.drop();
    two.contacts.count = 0;
    for (int k = 0; k < 2; ++k) {
      said_.name(work.search, k, answer_);
      two.contacts.add(found_contact(-1, answer_, surfaces_, s.touched.age, now.lag), settings_);
    }
    fit_.begin(measurement_, two.contacts);
    fit_.judge(two.contacts);
  }

  // Goes on with what explains as well; what was said before stands until all is met.
  void walk(Together& two, Work& work) {
    if (!work.parts.working()) return;
    work.parts.work(settings_.pair_steps);
    conclude(two, work);
  }

  void conclude(Together& two, const Work& work) {
    if (work.parts.working()) return;
    if (work.parts.count() > 0) {
      said_.name_all(work.parts, two.inseparable);
      two.walked = true;
    } else if (work.search.exhaustive()) {
      said_.name_none(work.search, two.inseparable);
      two.walked = true;
    }
  }

  const LinkSurfaces& surfaces_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  std::vector<std::unique_ptr<Work>> work_;  // per segment
  PairAnswer said_;
  Answer answer_;
};

}  // namespace touchline
