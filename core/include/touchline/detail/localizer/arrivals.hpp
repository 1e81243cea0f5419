// SPDX-License-Identifier: Apache-2.0
// Something that the known contacts on a segment do not explain: one of them slides or lets go,
// all their forces have changed, or there is a new contact. That is located in what is left without
// them, as they were known before it could be felt, and admitted once its place has been found for
// a while. No allocation per sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/rival_places.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/localizer/slides.hpp"
#include "touchline/detail/place/lone_channel.hpp"
#include "touchline/detail/place/single_contact.hpp"

namespace touchline {

class Arrivals {
 public:
  Arrivals(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
           JointFit& fit, KnownFit& known, Reports& reports, LoneChannel& lone,
           std::vector<RivalPlaces>& rivals, double period)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        fit_(fit),
        lone_(lone),
        known_(known),
        reports_(reports),
        slides_(single, measurement, settings, fit, known, reports),
        rivals_(rivals),
        period_(period) {}

  // From this sample on something is not explained.
  void begin(SegmentContacts& s, const SegmentSample& now) const {
    s.unexplained = Unexplained{};
    s.unexplained.since = s.unexplained.slide.weighed = now.time;
    s.unexplained.age.restart(now.time - period_);
    s.refer_at_last(now.time);
    s.state.enter(Tracking::newcomer);
  }

  // One sample more of it: fills the reports. `read()` takes the measurement anew. Searches take at most
  // about so many units of work; returns what is left of them.
  template <class Read>
  int follow(SegmentContacts& s, const SegmentSample& now, int units, Read&& read) {
    left_ = units;
    now_ = now;
    follow(s, read);
    return std::max(0, left_);
  }

  // What may have arrived instead of a contact.
  const Suspect& suspect() const { return suspect_; }

 private:
  static constexpr int kSlides = 2, kFree = 4;  // parts of the work left: for slides, beside free forces

  template <class Read>
  void follow(SegmentContacts& s, Read&& read) {
    const SegmentSample& now = now_;
    suspect_ = {};
    Reference& before = s.known.before;
    before.contacts.creep(std::max(0.0, now.time - before.time), now.bandwidth, settings_,
                           settings_.unrest_lasts);
    before.time = now.time;
    before.contacts.age(now.bandwidth, now.time, settings_);
    if (subsided(s)) return;
    const int for_slides = left_ / kSlides;
    int left = for_slides;
    const Slides::Outcome outcome = slides_.follow(
        s, now, left, rivals_[now.segment].any(), read, [&](const KnownContact& k) { add_known(s, k); });
    left_ -= for_slides - left;
    switch (outcome) {
      case Slides::Outcome::none:
        s.state.enter(Tracking::newcomer);
        break;
      case Slides::Outcome::slides:
        s.state.enter(Tracking::sliding);
        return;
      case Slides::Outcome::rests:
        s.state.enter(Tracking::sliding);
        end(s);
        return;
    }
    read();
    Answer& a = remainder(s);
    if (!suspect_.any()) {
      if (!placed(a) && changed(s, read)) return;
      if (lets_go(s, a)) return;
      // A contact beside forces that are held has fewer unknowns than a channel beside free ones. But a
      // known contact that lets go is likelier than a new one that pushes against it.
      const bool contested = placed(a);
      const int against = contested ? opposed(s, a) : -1;
      if (!contested || against >= 0) suspect_ = suspect_beside_free_forces(s, against, read);
    }
    if (suspect_.any()) {  // what has come is no contact, as far as is felt
      for (int c = 0; c < s.known.contacts.count; ++c) add_known(s, before.contacts.known[c]);
      s.unexplained.placed.reset();
      return;
    }
    if (a.status == Status::not_separable) free(s, read);
    if (is_found(s, a)) {
      admit(s, a, read);
    } else {
      suspect(s, a);
    }
  }

  // Has it been placed for a while, and has it lasted?
  bool is_found(SegmentContacts& s, const Answer& a) const {
    Unexplained& u = s.unexplained;
    if (!placed(a)) {
      u.placed.reset();
      return false;
    }
    if (!u.placed) u.placed = now_.time;
    return !a.searching && now_.time - *u.placed >= now_.brief() &&
           now_.time - u.since >= settings_.young * now_.brief() &&
           s.known.contacts.count < SegmentContacts::kMost;
  }

  // It is reported beside the known ones, but not known yet. What no slide explains for a sample or
  // two is noise of one that slides.
  void suspect(SegmentContacts& s, Answer& a) {
    const Unexplained& u = s.unexplained;
    const double since = u.slide.seen ? std::max(u.since, *u.slide.seen) : u.since;
    const bool lasting = now_.time - since >= settings_.suspected * now_.brief();
    for (int c = 0; c < s.known.contacts.count; ++c) {
      add_known(s, s.known.before.contacts.known[c]);
      if (lasting && !placed(a)) reports_.doubt_last();
    }
    if (!placed(a) && !lasting) return;
    if (a.count == 0) a.status = Status::not_separable;  // no force is left, but it does not fit
    add_newcomer(s, a);
  }

  void add_newcomer(SegmentContacts& s, const Answer& a) {
    reports_.add(number(s), a);
    doubt_last_if_wide(s);
  }

  // Places are wider than they seem where it is not known well how restless the known ones are.
  void doubt_last_if_wide(const SegmentContacts& s) {
    const JointEstimate& known = s.known.before.contacts;
    reports_.doubt_last_if_wide(settings_, known.unrest_doubt(now_.bandwidth, settings_));
  }

  // One whose rivals have yet to decide is not sure in the meantime, nor is a wide one of several.
  void add_known(const SegmentContacts& s, const KnownContact& k) {
    reports_.add(k);
    if (s.known.contacts.count > 1) doubt_last_if_wide(s);
    if (rivals_[now_.segment].undecided(k.serial)) reports_.doubt_last();
  }

  // Under which number it is reported.
  int number(SegmentContacts& s) {
    if (!s.unexplained.newcomer) s.unexplained.newcomer = reports_.next();
    return *s.unexplained.newcomer;
  }

  // Do the known contacts explain all again?
  bool subsided(SegmentContacts& s) {
    fit_.weigh(s.known.before.contacts, measurement_);
    if (!known_.explain(s.known.before.contacts) || known_.moved()) {
      if (s.state.is(Tracking::ending)) s.state.enter(Tracking::newcomer);
      return false;
    }
    resume(s);
    return true;
  }

  // Or do they with all their forces changed, where no single contact explains what is left?
  template <class Read>
  bool changed(SegmentContacts& s, Read&& read) {
    if (s.known.contacts.count == 1) return false;
    read();
    fit_.weigh(s.known.before.contacts, measurement_);
    if (!known_.explain_freely(s.known.before.contacts)) return false;
    resume(s);
    return true;
  }

  // Is what is left a known contact that lets go?
  bool lets_go(SegmentContacts& s, const Answer& a) {
    const JointEstimate& before = s.known.before.contacts;
    for (int c = 0; c < before.count; ++c) {
      const KnownContact& k = before.known[c];
      if (!takes_back(k, a, single_.surfaces(), settings_)) continue;
      for (int i = 0; i < before.count; ++i) add_known(s, before.known[i]);
      reports_.change_force(c, k.force + a.force);
      s.unexplained.placed.reset();  // what was suspected ends when all is explained
      return true;
    }
    return false;
  }

  // Which known contact does what is left push against most? -1: none.
  int opposed(const SegmentContacts& s, const Answer& a) const {
    const JointEstimate& before = s.known.before.contacts;
    int most = -1;
    double along = 0.0;
    for (int c = 0; c < before.count; ++c) {
      const Vec3& f = before.known[c].force;
      const double here = dot(f, a.force) / std::max(norm(f), 1e-9);
      if (here >= along) continue;
      along = here;
      most = c;
    }
    return most;
  }

  // The known contacts explain all, with the forces of the last fit.
  void resume(SegmentContacts& s) {
    if (!s.state.is(Tracking::ending)) s.unexplained.calm = now_.time;
    s.state.enter(Tracking::ending);
    JointEstimate& known = s.known.contacts;
    known = s.known.before.contacts;
    fit_.accept(known, known_.change(), 0.0);
    for (int c = 0; c < known.count; ++c) add_known(s, known.known[c]);
    if (now_.time - s.unexplained.calm >= now_.brief()) end(s);
  }

  void end(SegmentContacts& s) {
    Known& known = s.known;
    known.crept = now_.time;
    known.updated = std::max(known.updated, now_.time);
    s.forget_references();
    if (s.unexplained.newcomer) reports_.end(*s.unexplained.newcomer);
    s.enter_known();
  }

  // What is left without the known contacts, their forces held, as one contact.
  Answer& remainder(SegmentContacts& s) {
    const JointEstimate& known = s.known.before.contacts;
    fit_.take_out(known, Change::none(), measurement_);
    const Vec3 load = measurement_.load();
    new_lag_ = now_.brief() *
               s.unexplained.age.follow(load, now_.bandwidth, now_.time, settings_.oldest);
    freed_ = false;
    suspect_ = lone_.find(now_.segment);
    const Ask ask{Ask::kRemainder, false, false, left_ - left_ / kFree};
    answer_ = single_.locate(now_.segment, new_lag_, measurement_, ask);
    left_ -= single_.units();
    return answer_;
  }

  // A channel that explains alone what the known contacts leave, their forces free. `opposed`: so does a
  // new contact, with their forces held, that pushes against this one. Then only that one's is free: with
  // all of them, a channel would explain nearly any new contact.
  template <class Read>
  Suspect suspect_beside_free_forces(SegmentContacts& s, int opposed, Read&& read) {
    const JointEstimate& known = s.known.before.contacts;
    const bool contested = opposed >= 0;
    const Change change = contested ? Change::of_force(opposed, settings_.force_scale)
                                    : Change::of_forces(known.count, settings_.force_scale);
    read();
    fit_.take_out(known, change, measurement_);
    return lone_.find(now_.segment, contested ? 3 : 3 * known.count, contested);
  }

  // The same with their forces free, where there are equations enough: three for each, and five.
  template <class Read>
  void free(SegmentContacts& s, Read&& read) {
    const JointEstimate& known = s.known.before.contacts;
    read();
    fit_.take_out(known, Change::of_forces(known.count, settings_.force_scale), measurement_);
    const Ask ask{Ask::kFreed, false, false, left_};
    const Answer& freed =
        single_.locate_beside_free_forces(now_.segment, new_lag_, measurement_, ask);
    left_ -= single_.units();
    if (!placed(freed)) return;
    const int node = single_.surfaces()[freed.candidates[0].surface].node;
    freed_ = rank(known, node) >= 3 * known.count + JointEstimate::kEach;
    if (freed_) answer_ = freed;
  }

  // Independent equations: of the wrench, and those that do not feel all of these bodies.
  int rank(const JointEstimate& known, int node) const {
    int count = measurement_.has_wrench() ? 6 : 0;
    for (int i = count; i < measurement_.size(); ++i) {
      bool tells = false;
      for (int c = 0; c < known.count; ++c)
        tells |= measurement_.feels(i, known.known[c].node) != measurement_.feels(i, node);
      count += tells;
    }
    return count;
  }

  // The newcomer is known, and with it what its place shares with the others.
  template <class Read>
  void admit(SegmentContacts& s, const Answer& a, Read&& read) {
    const int newcomer = number(s);
    JointEstimate& all = s.known.contacts;
    all = s.known.before.contacts;
    const int old = all.count;
    for (int c = 0; c < old; ++c) add_known(s, all.known[c]);
    add_newcomer(s, a);
    read();
    Change change;
    if (freed_) change = Change::of_forces(old, settings_.force_scale);
    KnownContact added =
        found_contact(newcomer, a, single_.surfaces(), s.unexplained.age, now_.brief());
    added.unrest.expect(all.unrest());
    rivals_[now_.segment].begin(all, change, added, a, now_.time);
    all.add(added, settings_);
    fit_.weigh(all, measurement_);
    fit_.begin(measurement_, all);
    fit_.accept(all, change, 1.0);
    s.know(now_);
    s.state.enter(Tracking::several);
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  LoneChannel& lone_;
  KnownFit& known_;
  Reports& reports_;
  Slides slides_;
  std::vector<RivalPlaces>& rivals_;  // per segment
  double period_;
  SegmentSample now_;
  Answer answer_;
  bool freed_ = false;  // was it found with the forces of the known contacts free?
  double new_lag_ = 0.0;
  int left_ = 0;  // units of work, in the sample at hand
  Suspect suspect_;
};

}  // namespace touchline
