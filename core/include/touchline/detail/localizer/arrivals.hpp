// SPDX-License-Identifier: Apache-2.0
// Something that the known contacts on a segment do not explain: one of them slides or lets go,
// all their forces have changed, or there is a new contact. That is located in what is left without
// them, as they were known before it could be felt, and admitted once its place has been found for
// a while. No allocation per sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/localizer/slides.hpp"
#include "touchline/detail/place/single_contact.hpp"

namespace touchline {

class Arrivals {
 public:
  Arrivals(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
           JointFit& fit, KnownFit& known, Reports& reports, double period)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        fit_(fit),
        known_(known),
        reports_(reports),
        slides_(single, measurement, settings, fit, known, reports),
        period_(period) {}

  // From this sample on something is not explained.
  void begin(SegmentContacts& s, const SegmentSample& now) const {
    s.arriving = true;
    s.since = now.time;
    s.is_calm = s.is_placed = false;
    s.newcomer = s.slider = -1;
    s.slid = s.rests = -1.0;
    s.weighed = now.time;
    std::fill(s.against, s.against + JointEstimate::kMost, 0.0);
    s.new_age.restart(now.time - period_);
    s.refer_at_last(now.time);
  }

  // One sample more of it: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(SegmentContacts& s, const SegmentSample& now, Read&& read) {
    now_ = now;
    JointEstimate& before = s.before.contacts;
    before.creep(std::max(0.0, now.time - s.before.time), now.bandwidth, settings_);
    s.before.time = now.time;
    before.age(now.bandwidth, now.time, settings_);
    if (subsided(s)) return;
    switch (slides_.follow(s, now, read)) {
      case Slides::Outcome::none:
        break;
      case Slides::Outcome::slides:
        return;
      case Slides::Outcome::rests:
        end(s);
        return;
    }
    read();
    Answer& a = remainder(s);
    if (!placed(a) && changed(s, read)) return;
    if (lets_go(s, a)) return;
    if (a.status == Status::not_separable) free(s, read);
    if (is_found(s, a)) {
      admit(s, a, read);
    } else {
      suspect(s, a);
    }
  }

 private:
  // Has it been placed for a while, and has it lasted?
  bool is_found(SegmentContacts& s, const Answer& a) const {
    const bool found = placed(a);
    if (found && !s.is_placed) s.placed = now_.time;
    s.is_placed = found;
    return found && now_.time - s.placed >= now_.brief() &&
           now_.time - s.since >= settings_.young * now_.brief() &&
           s.contacts.count < SegmentContacts::kMost;
  }

  // It is reported beside the known ones, but not known yet.
  void suspect(SegmentContacts& s, Answer& a) {
    const bool lasting = now_.time - s.since >= settings_.suspected * now_.brief();
    for (int c = 0; c < s.contacts.count; ++c) {
      reports_.add(s.before.contacts.known[c]);
      if (lasting && !placed(a)) reports_.doubt_last();
    }
    if (!placed(a) && !lasting) return;
    if (a.count == 0) a.status = Status::not_separable;  // no force is left, but it does not fit
    if (s.newcomer < 0) s.newcomer = reports_.next();
    reports_.add(s.newcomer, a);
  }

  // Do the known contacts explain all again?
  bool subsided(SegmentContacts& s) {
    fit_.weigh(s.before.contacts, measurement_);
    if (!known_.explain(s.before.contacts)) {
      s.is_calm = false;
      return false;
    }
    resume(s);
    return true;
  }

  // Or do they with all their forces changed, where no single contact explains what is left?
  template <class Read>
  bool changed(SegmentContacts& s, Read&& read) {
    if (s.contacts.count == 1) return false;
    read();
    fit_.weigh(s.before.contacts, measurement_);
    if (!known_.explain_freely(s.before.contacts)) return false;
    resume(s);
    return true;
  }

  // Is what is left a known contact that lets go?
  bool lets_go(SegmentContacts& s, const Answer& a) {
    const JointEstimate& before = s.before.contacts;
    for (int c = 0; c < before.count; ++c) {
      const KnownContact& k = before.known[c];
      if (!takes_back(k, a, single_.surfaces(), settings_)) continue;
      for (int i = 0; i < before.count; ++i) reports_.add(before.known[i]);
      reports_.change_force(c, k.force + a.force);
      s.is_placed = false;  // what was suspected ends when all is explained
      return true;
    }
    return false;
  }

  // The known contacts explain all, with the forces of the last fit.
  void resume(SegmentContacts& s) {
    if (!s.is_calm) s.calm = now_.time;
    s.is_calm = true;
    s.contacts = s.before.contacts;
    fit_.accept(s.contacts, known_.change(), 0.0);
    for (int c = 0; c < s.contacts.count; ++c) reports_.add(s.contacts.known[c]);
    if (now_.time - s.calm >= now_.brief()) end(s);
  }

  void end(SegmentContacts& s) {
    s.arriving = false;
    s.crept = s.restless = now_.time;
    s.updated = std::max(s.updated, now_.time);
    s.forget_references();
    reports_.end(s.newcomer);
  }

  // What is left without the known contacts, their forces held, as one contact.
  Answer& remainder(SegmentContacts& s) {
    const JointEstimate& known = s.before.contacts;
    fit_.take_out(known, Change::none(), measurement_);
    new_lag_ = s.new_age.follow(measurement_.load(), now_.bandwidth, now_.time, settings_.oldest) *
               now_.brief();
    freed_ = false;
    return answer_ = single_.locate(now_.segment, new_lag_, measurement_);
  }

  // The same with their forces free, where there are equations enough: three for each, and five.
  template <class Read>
  void free(SegmentContacts& s, Read&& read) {
    const JointEstimate& known = s.before.contacts;
    read();
    fit_.take_out(known, Change::of_forces(known.count, settings_.force_scale), measurement_);
    const Answer& freed = single_.locate_beside_free_forces(now_.segment, new_lag_, measurement_);
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
    if (s.newcomer < 0) s.newcomer = reports_.next();
    s.contacts = s.before.contacts;
    const int old = s.contacts.count;
    for (int c = 0; c < old; ++c) reports_.add(s.contacts.known[c]);
    reports_.add(s.newcomer, a);
    read();
    Change change;
    if (freed_) change = Change::of_forces(old, settings_.force_scale);
    s.contacts.add(found_contact(s.newcomer, a, single_.surfaces(), s.new_age, now_.brief()),
                   settings_);
    fit_.weigh(s.contacts, measurement_);
    fit_.begin(measurement_, s.contacts);
    fit_.accept(s.contacts, change, 1.0);
    s.arriving = false;
    s.know(now_);
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit& fit_;
  KnownFit& known_;
  Reports& reports_;
  Slides slides_;
  double period_;
  SegmentSample now_;
  Answer answer_;
  bool freed_ = false;  // was it found with the forces of the known contacts free?
  double new_lag_ = 0.0;
};

}  // namespace touchline
