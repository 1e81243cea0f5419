// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment over time. Contacts rarely begin at the same instant: as long as the
// known ones, with their forces free, explain what is measured, nothing has begun. When they no
// longer do, what is left without them is a single contact again. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/localizer/known_fit.hpp"
#include "touchline/localizer/merging.hpp"
#include "touchline/localizer/reports.hpp"
#include "touchline/localizer/segment_contacts.hpp"
#include "touchline/localizer/slides.hpp"
#include "touchline/localizer/twins.hpp"
#include "touchline/place/past.hpp"
#include "touchline/place/single_contact.hpp"

namespace touchline {

class Tracks {
 public:
  Tracks(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
         std::size_t rows, int segments, double period)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        period_(period),
        fit_(measurement.posture(), single.surfaces(), rows),
        known_(measurement, fit_, settings.force_scale),
        reports_(single.surfaces()),
        pasts_(segments, Past(measurement.posture().nodes().size())),
        slides_(single, measurement, settings, fit_, known_, reports_),
        merging_(single.surfaces(), settings, fit_, known_, reports_),
        twins_(single.surfaces(), measurement, settings, fit_, known_, reports_, rows, segments) {}

  // One sample of segment g: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(SegmentContacts& s, int g, double bandwidth, double time, Read&& read) {
    reports_.clear();
    g_ = g;
    bandwidth_ = bandwidth;
    time_ = time;
    if (!read()) {
      report(s.contacts.count > 0 ? s.contacts.known[0].serial : s.first, single_.clear());
      return;
    }
    if (!measurement_.can_be_followed() || settings_.first_entry) {
      report(s.first, single_.locate(g, 0.0, measurement_, again(s)));
      return;
    }
    lag_ = s.age.follow(measurement_.load(), bandwidth, time) / bandwidth;
    if (measurement_.has_wrench())
      pasts_[g].follow(measurement_.load(), bandwidth, time, measurement_.posture());
    if (!s.arriving || s.contacts.count > 1) age_all(s.contacts);
    if (s.arriving) {
      arrive(s, read);
    } else if (s.contacts.count < 2) {
      sole(s, read);
    } else {
      several(s, read);
    }
  }

  // Segment g is touched anew.
  int begin(int g) {
    pasts_[g].restart();
    return reports_.next();
  }

  // What is said after the last sample.
  const Reports& reports() const { return reports_; }

 private:
  static constexpr double kLook = 0.35;        // times 1 / K, between searches
  static constexpr double kNear = 2e-3;        // places that differ by less are the same [m]
  static constexpr double kLasting = 2.0;      // times 1 / K: the age of a reference in calm

  double young() const { return SegmentContacts::kYoung / bandwidth_; }
  double brief() const { return 1.0 / bandwidth_; }

  void age_all(JointEstimate& contacts) const {
    for (int c = 0; c < contacts.count; ++c) {
      KnownContact& k = contacts.known[c];
      k.lag = k.age.follow(k.force, bandwidth_, time_) / bandwidth_;
    }
  }

  void report(int serial, const Answer& answer) { reports_.add(serial, answer); }
  void report(const KnownContact& k) { reports_.add(k); }
  void end(int serial) { reports_.end(serial); }

  // --- one contact, as far as is known ---
  template <class Read>
  void sole(SegmentContacts& s, Read&& read) {
    const Past& past = pasts_[g_];
    const Answer& a = past.known() ? single_.locate(g_, past, measurement_, again(s))
                                   : single_.locate(g_, lag_, measurement_, again(s));
    if (s.contacts.count == 0) {
      if (a.status == Status::not_separable) {
        s.explains = false;
        twins_.follow(s, g_, a, lag_, bandwidth_, time_);
        return;
      }
      report(s.first, a);
      if (placed(a)) twins_.forget(s);
      if (!placed(a)) {
        s.explains = false;
      } else if (!s.explains) {
        s.explains = true;
        s.explained = time_;
      } else if (time_ - s.explained >= young()) {
        settle(s, a);
      }
      return;
    }
    const KnownContact& known = s.contacts.known[0];
    if (agrees(known, a, single_.surfaces(), kNear)) {
      report(known.serial, a);
      if (time_ - s.updated < SegmentContacts::kRefit / bandwidth_) return;
      creep(s.contacts, s.crept);
      if (explains(s.contacts)) accept(s);
      return;
    }
    if (explains(s.contacts)) {
      report(known.serial, a);
      return;
    }
    begin_arrival(s);
    read();
    arrive(s, read);
  }

  // Was the contact looked for a moment ago? Filtered noise does not change much in the meantime.
  bool again(SegmentContacts& s) const {
    if (s.contacts.count == s.looked_for && time_ - s.looked < kLook / bandwidth_) return true;
    s.looked = time_;
    s.looked_for = s.contacts.count;
    return false;
  }

  // Does a sole contact explain all, with its force free?
  bool explains(const JointEstimate& one) {
    const Past& past = pasts_[g_];
    const int node = one.known[0].node;
    return past.known() ? known_.explain_alone(one, measurement_.quadratic(node), past.mean(node))
                        : known_.explain_freely(one);
  }

  // The first contact has become known.
  void settle(SegmentContacts& s, const Answer& a) {
    s.contacts.count = 0;
    add(s.contacts, s.first, a, s.age);
    if (explains(s.contacts)) fit_.judge(s.contacts);
    known_as_of_now(s);
  }

  // A contact at the place where it has been found.
  void add(JointEstimate& contacts, int serial, const Answer& a, const Age& age) const {
    KnownContact k;
    k.serial = serial;
    keep(a, single_.surfaces(), k);
    k.lag = brief();
    k.age = age;
    contacts.add(k, settings_.force_scale);
  }

  // All that this sample tells has been taken over.
  void known_as_of_now(SegmentContacts& s) {
    s.updated = time_ + brief();
    s.crept = s.restless = time_;
    s.forget_references();
  }

  // Takes the last explanation over, and keeps what was known for when something arrives.
  void accept(SegmentContacts& s) {
    const double passed = std::max(0.0, std::min(time_ - s.updated, brief()));
    if (passed > 0.0) s.updated = time_;
    if (!known_.held()) s.restless = time_;
    fit_.accept(s.contacts, known_.change(), 0.5 * bandwidth_ * passed);
    const bool calm = time_ - s.restless > 2.0 * brief();
    s.refer(time_, (calm ? kLasting : SegmentContacts::kRefit) / bandwidth_);
  }

  void creep(JointEstimate& contacts, double& since) const {
    contacts.creep(std::max(0.0, time_ - since), bandwidth_);
    since = time_;
  }

  // --- something new ---
  void begin_arrival(SegmentContacts& s) {
    s.arriving = true;
    s.since = time_;
    s.is_calm = s.is_placed = false;
    s.newcomer = s.slider = -1;
    s.slid = s.rests = -1.0;
    s.weighed = time_;
    std::fill(s.against, s.against + JointEstimate::kMost, 0.0);
    s.new_age.restart(time_ - period_);
    s.refer_at_last(time_);
  }

  template <class Read>
  void arrive(SegmentContacts& s, Read&& read) {
    creep(s.before.contacts, s.before.time);
    age_all(s.before.contacts);
    if (subsided(s)) return;
    switch (slides_.follow(s, g_, lag_, bandwidth_, time_, read)) {
      case Slides::Outcome::none:
        break;
      case Slides::Outcome::slides:
        return;
      case Slides::Outcome::rests:
        end_arrival(s);
        return;
    }
    read();
    Answer& a = remainder(s);
    if (!placed(a) && changed(s, read)) return;
    if (lets_go(s, a)) return;
    if (a.status == Status::not_separable) free(s, read);
    const bool found = placed(a);
    if (found && !s.is_placed) s.placed = time_;
    s.is_placed = found;
    const int count = s.contacts.count;
    if (found && time_ - s.placed >= brief() && time_ - s.since >= young() &&
        count < SegmentContacts::kMost) {
      commit(s, a, read);
      return;
    }
    const bool lasting = time_ - s.since >= 2.0 * brief();
    for (int c = 0; c < count; ++c) {
      report(s.before.contacts.known[c]);
      if (lasting && !found) reports_.doubt_last();
    }
    if (!found && !lasting) return;
    if (a.count == 0) a.status = Status::not_separable;  // no force is left, but it does not fit
    if (s.newcomer < 0) s.newcomer = reports_.next();
    report(s.newcomer, a);
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
      if (!takes_back(k, a, single_.surfaces(), settings_.place_radius)) continue;
      for (int i = 0; i < before.count; ++i) report(before.known[i]);
      reports_.change_force(c, k.force + a.force);
      end(s.newcomer);
      s.newcomer = -1;
      s.is_placed = false;
      return true;
    }
    return false;
  }

  // The known contacts explain all, with the forces of the last fit.
  void resume(SegmentContacts& s) {
    if (!s.is_calm) s.calm = time_;
    s.is_calm = true;
    s.contacts = s.before.contacts;
    fit_.accept(s.contacts, known_.change(), 0.0);
    for (int c = 0; c < s.contacts.count; ++c) report(s.contacts.known[c]);
    if (time_ - s.calm >= brief()) end_arrival(s);
  }

  void end_arrival(SegmentContacts& s) {
    s.arriving = false;
    s.crept = s.restless = time_;
    s.updated = std::max(s.updated, time_);
    s.forget_references();
    end(s.newcomer);
  }

  // What is left without the known contacts, their forces held, as one contact.
  Answer& remainder(SegmentContacts& s) {
    const JointEstimate& known = s.before.contacts;
    fit_.take_out(known, Change::none(), measurement_);
    new_lag_ = s.new_age.follow(measurement_.load(), bandwidth_, time_) / bandwidth_;
    freed_ = false;
    return answer_ = single_.locate(g_, new_lag_, measurement_);
  }

  // The same with their forces free, where there are equations enough: three for each, and five.
  template <class Read>
  void free(SegmentContacts& s, Read&& read) {
    const JointEstimate& known = s.before.contacts;
    read();
    fit_.take_out(known, Change::of_forces(known.count, settings_.force_scale), measurement_);
    const Answer& freed = single_.locate_beside_free_forces(g_, new_lag_, measurement_);
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
  void commit(SegmentContacts& s, const Answer& a, Read&& read) {
    if (s.newcomer < 0) s.newcomer = reports_.next();
    s.contacts = s.before.contacts;
    const int old = s.contacts.count;
    for (int c = 0; c < old; ++c) report(s.contacts.known[c]);
    report(s.newcomer, a);
    read();
    Change change;
    if (freed_) change = Change::of_forces(old, settings_.force_scale);
    add(s.contacts, s.newcomer, a, s.new_age);
    fit_.weigh(s.contacts, measurement_);
    fit_.begin(measurement_, s.contacts);
    fit_.accept(s.contacts, change, 1.0);
    s.arriving = false;
    known_as_of_now(s);
  }

  // --- several contacts, all known ---
  template <class Read>
  void several(SegmentContacts& s, Read&& read) {
    creep(s.contacts, s.crept);
    fit_.weigh(s.contacts, measurement_);
    if (!known_.explain(s.contacts)) {
      begin_arrival(s);
      read();
      arrive(s, read);
      return;
    }
    accept(s);
    if (merging_.follow(s, bandwidth_, time_)) known_as_of_now(s);
    for (int c = 0; c < s.contacts.count; ++c) report(s.contacts.known[c]);
    release(s);
  }

  // Contacts without force have gone; the last one stays until the segment is quiet.
  void release(SegmentContacts& s) {
    for (int c = s.contacts.count - 1; c >= 0 && s.contacts.count > 1; --c) {
      KnownContact& k = s.contacts.known[c];
      const double sigma = s.contacts.force_sigma(c);
      const bool gone = norm(k.force) < std::max(settings_.least_force, 4.0 * sigma) &&
                        sigma < settings_.least_force;
      if (!gone) k.gone = 0.0;
      if (gone && k.gone == 0.0) k.gone = time_;
      if (!gone || time_ - k.gone < brief()) continue;
      end(k.serial);
      s.contacts.remove(c);
      s.forget_references();
    }
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  double period_;
  JointFit fit_;
  KnownFit known_;
  Answer answer_;
  bool freed_ = false;  // was it found with the forces of the known contacts free?
  Reports reports_;
  std::vector<Past> pasts_;  // per segment: of its whole wrench
  Slides slides_;
  Merging merging_;
  Twins twins_;
  int g_ = 0;
  double bandwidth_ = 0.0, time_ = 0.0, lag_ = 0.0, new_lag_ = 0.0;
};

}  // namespace touchline
