// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant. No allocation per sample.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <memory>
#include <vector>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/pair_answer.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/localizer/work_share.hpp"

namespace touchline {

class Twins {
 public:
  Twins(const LinkSurfaces& surfaces, Measurement& measurement, const LocalizerSettings& settings,
        JointFit& fit, KnownFit& known, Reports& reports, std::size_t rows, int segments,
        double period)
      : surfaces_(surfaces),
        measurement_(measurement),
        settings_(settings),
        fit_(fit),
        known_(known),
        reports_(reports),
        said_(surfaces, settings),
        units_(settings.pair_work * period / settings.sample_work(period)) {
    for (int g = 0; g < segments; ++g)
      work_.push_back(std::make_unique<Work>(measurement.posture(), surfaces, settings, rows, g));
  }

  // One contact explains nothing, from the beginning: looks for two, again and again while their
  // forces rise, then ever more rarely. All of that takes many samples. `own`: units of work of the
  // segment in this sample (`PlaceSettings::sample_work`), of which the one contact has taken `spent`.
  // Returns what is taken of the rest.
  int follow(SegmentContacts& s, const Answer& one, const SegmentSample& now, int own, int spent,
             WorkShare& share) {
    Together& two = s.together;
    Work& work = *work_[now.segment];
    const bool first = !s.state.is(Tracking::pair);  // this sample has had enough to do
    if (first) {
      s.state.enter(Tracking::pair);
      s.touched.two = true;
      s.suspected.explained.reset();
      two = Together{};
      two.since = two.next_search = now.time;
      two.inseparable = one;
      two.inseparable.count = 0;
      work.search.drop();
      work.parts.drop();
    }
    const int all = static_cast<int>(std::clamp(std::round(units_ * own), 1.0, kMost));
    const int units = std::max(all - spent, all / kLeast);
    const bool worked = !first && go_on(s, work, one, now, units, share);
    const int taken = worked ? std::max(0, own - spent) : 0;
    if (!two.separable) {
      end_second(two);
      two.inseparable.force = one.force;
      two.inseparable.searching = !two.walked;
      reports_.add(s.touched.first, two.inseparable);
      return taken;
    }
    if (two.seen < now.time && known_.explain_freely(two.contacts))
      fit_.accept(two.contacts, known_.change(), 0.0);
    if (!two.second) two.second = reports_.next();
    two.contacts.known[0].serial = s.touched.first;
    two.contacts.known[1].serial = *two.second;
    const bool settled = two.seen - two.since >= settings_.young * now.brief();
    for (int k = 0; k < 2; ++k) {
      reports_.add(two.contacts.known[k]);
      reports_.answer(reports_.count() - 1).searching = !settled;
    }
    if (!settled) return taken;
    s.known.contacts = two.contacts;
    s.know(now);
    s.state.enter(Tracking::several);
    return taken;
  }

  // A single contact explains after all.
  void forget(SegmentContacts& s) {
    end_second(s.together);
    s.state.enter(Tracking::suspected);
  }

 private:
  static constexpr int kLeast = 4;  // so large a part of its work a sample does in any case
  static constexpr double kMost = 1e9;  // units in a sample: a bound on integers

  void end_second(Together& two) {
    if (two.second) reports_.end(*two.second);
    two.second.reset();
  }

  // The search for pairs on a segment, and the walk from where one has begun.
  struct Work {
    Work(const Posture& posture, const LinkSurfaces& surfaces, const LocalizerSettings& settings,
         std::size_t rows, int g)
        : search(posture, surfaces, settings, rows, g), parts(search.view(), settings) {}
    PairSearch search;
    PairParts parts;
  };

  // One sample's part of it, at most about so many units of work: what is done is taken over in a sample
  // of its own. Returns whether any work is done.
  bool go_on(SegmentContacts& s, Work& work, const Answer& one, const SegmentSample& now, int units,
             WorkShare& share) {
    Together& two = s.together;
    if (work.parts.done()) {
      conclude(two, work);
      work.parts.drop();
    } else if (work.search.done() && !two.taken) {
      take(s, work, one, now);
    } else if (work.parts.working()) {
      work.parts.work(units);
      return true;
    } else if (work.search.working()) {
      work.search.work(units, now, measurement_);
      return true;
    } else if (two.taken && !two.separable && !two.walking &&
               work.search.begun() - two.since >= settings_.risen * now.brief()) {
      two.walking = true;
      work.parts.begin(work.search, now, measurement_);
    } else if (now.time >= two.next_search && share.begin_pair()) {
      two.taken = two.walking = false;
      two.next_search = std::max(two.since + settings_.risen * now.brief(),
                                 now.time + settings_.search_growth * (now.time - two.since));
      work.search.begin(now, measurement_);
    }
    return false;
  }

  // Takes the outcome of a search over.
  void take(SegmentContacts& s, Work& work, const Answer& one, const SegmentSample& now) {
    Together& two = s.together;
    two.taken = true;
    two.seen = work.search.seen();
    two.separable = said_.separable(work.search);
    if (!two.separable) {
      if (!two.walked) {
        two.inseparable = one;
        said_.name_all(work.search, two.inseparable);
      }
      return;
    }
    two.walked = false;
    two.contacts.count = 0;
    for (int k = 0; k < 2; ++k) {
      said_.name(work.search, k, answer_);
      two.contacts.add(found_contact(-1, answer_, surfaces_, s.touched.age, now.lag), settings_);
    }
    fit_.begin(measurement_, two.contacts);
    fit_.judge(two.contacts);
  }

  // All that explains has been met.
  void conclude(Together& two, Work& work) {
    two.walked = true;
    if (work.parts.count() > 0) {
      said_.name_all(work.parts, two.inseparable);
    } else if (work.search.exhaustive()) {
      said_.name_none(work.search, two.inseparable);
    } else {
      two.walked = false;
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
  double units_;  // of work on a pair, for each of a sample
  Answer answer_;
};

}  // namespace touchline
