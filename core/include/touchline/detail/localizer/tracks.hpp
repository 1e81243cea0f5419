// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment over time. Contacts rarely begin at the same instant: as long as the
// known ones, with their forces free, explain what is measured, nothing has begun. When they no
// longer do, what is left without them is a single contact again. No allocation per sample.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/localizer/arrivals.hpp"
#include "touchline/detail/localizer/known_fit.hpp"
#include "touchline/detail/localizer/merging.hpp"
#include "touchline/detail/localizer/reports.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/localizer/twins.hpp"
#include "touchline/detail/place/past.hpp"
#include "touchline/detail/place/single_contact.hpp"

namespace touchline {

class Tracks {
 public:
  Tracks(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
         std::size_t rows, int segments, double period)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        fit_(measurement.posture(), single.surfaces(), settings, rows),
        known_(measurement, fit_, settings),
        reports_(single.surfaces()),
        pasts_(segments, Past(measurement.posture().nodes().size(), settings.past_worn)),
        arrivals_(single, measurement, settings, fit_, known_, reports_, period),
        merging_(single.surfaces(), settings, fit_, known_, reports_),
        twins_(single.surfaces(), measurement, settings, fit_, known_, reports_, rows, segments) {}

  // One sample of segment g: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(SegmentContacts& s, int g, double bandwidth, double time, Read&& read) {
    reports_.clear();
    now_ = {g, bandwidth, time, 0.0};
    if (!read()) {
      report(s.contacts.count > 0 ? s.contacts.known[0].serial : s.first, single_.clear());
      return;
    }
    if (!measurement_.can_be_followed() || settings_.first_entry) {
      report(s.first, single_.locate(g, 0.0, measurement_, again(s), true));
      return;
    }
    now_.lag = s.age.follow(measurement_.load(), bandwidth, time, settings_.oldest) / bandwidth;
    if (measurement_.has_wrench())
      pasts_[g].follow(measurement_.load(), bandwidth, time, measurement_.posture());
    if (!s.arriving || s.contacts.count > 1) s.contacts.age(bandwidth, time, settings_);
    if (s.arriving) {
      arrivals_.follow(s, now_, read);
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

  // Gives each body the probability that the evidence for links gives it, where one contact stands for
  // all that joint torques show.
  bool share_out(const std::vector<BodyShare>& shares) {
    if (measurement_.can_be_followed() || settings_.first_entry || reports_.count() != 1) return false;
    Answer& answer = reports_.answer(0);
    if (!placed(answer)) return false;
    single_.share_out(shares, measurement_, answer);
    return true;
  }

 private:
  void report(int serial, const Answer& answer) { reports_.add(serial, answer); }
  void report(const KnownContact& k) { reports_.add(k); }
  void end(int serial) { reports_.end(serial); }

  // --- one contact, as far as is known ---
  template <class Read>
  void sole(SegmentContacts& s, Read&& read) {
    const Past& past = pasts_[now_.segment];
    const Answer& a = past.known() ? single_.locate(now_.segment, past, measurement_, again(s))
                                   : single_.locate(now_.segment, now_.lag, measurement_, again(s));
    if (s.contacts.count == 0) {
      if (a.status == Status::not_separable) {
        s.explains = false;
        twins_.follow(s, a, now_);
        return;
      }
      report(s.first, a);
      if (placed(a)) twins_.forget(s);
      if (!placed(a)) {
        s.explains = false;
      } else if (!s.explains) {
        s.explains = true;
        s.explained = now_.time;
      } else if (now_.time - s.explained >= settings_.young * now_.brief()) {
        settle(s, a);
      }
      return;
    }
    const KnownContact& known = s.contacts.known[0];
    if (agrees(known, a, single_.surfaces(), settings_)) {
      report(known.serial, a);
      if (now_.time - s.updated < settings_.refit * now_.brief()) return;
      s.creep(now_, settings_);
      if (explains(s.contacts)) accept(s);
      return;
    }
    if (explains(s.contacts)) {  // where no single force does, now and then, that is noise
      a.status == Status::not_separable ? report(known) : report(known.serial, a);
      return;
    }
    arrivals_.begin(s, now_);
    read();
    arrivals_.follow(s, now_, read);
  }

  // Was the contact looked for a moment ago? Filtered noise does not change much in the meantime.
  bool again(SegmentContacts& s) const {
    const bool same = s.contacts.count == s.looked_for;
    if (same && now_.time - s.looked < settings_.look * now_.brief()) return true;
    s.looked = now_.time;
    s.looked_for = s.contacts.count;
    return false;
  }

  // Does a sole contact explain all, with its force free?
  bool explains(const JointEstimate& one) {
    const Past& past = pasts_[now_.segment];
    const int node = one.known[0].node;
    return past.known() ? known_.explain_alone(one, measurement_.quadratic(node), past.mean(node))
                        : known_.explain_freely(one);
  }

  // The first contact has become known.
  void settle(SegmentContacts& s, const Answer& a) {
    s.contacts.count = 0;
    s.contacts.add(found_contact(s.first, a, single_.surfaces(), s.age, now_.brief()),
                   settings_);
    if (explains(s.contacts)) fit_.judge(s.contacts);
    s.know(now_);
  }

  // Takes the last explanation over, and keeps what was known for when something arrives.
  void accept(SegmentContacts& s) {
    const double passed = std::max(0.0, std::min(now_.time - s.updated, now_.brief()));
    if (passed > 0.0) s.updated = now_.time;
    if (!known_.held()) s.restless = now_.time;
    fit_.accept(s.contacts, known_.change(), 0.5 * now_.bandwidth * passed);
    const bool calm = now_.time - s.restless > 2.0 * now_.brief();
    s.refer(now_.time, (calm ? settings_.lasting : settings_.refit) * now_.brief());
  }

  // --- several contacts, all known ---
  template <class Read>
  void several(SegmentContacts& s, Read&& read) {
    s.creep(now_, settings_);
    fit_.weigh(s.contacts, measurement_);
    if (!known_.explain(s.contacts)) {
      arrivals_.begin(s, now_);
      read();
      arrivals_.follow(s, now_, read);
      return;
    }
    accept(s);
    merging_.follow(s, now_);
    for (int c = 0; c < s.contacts.count; ++c) report(s.contacts.known[c]);
    release(s);
  }

  // Contacts without force have gone; the last one stays until the segment is quiet.
  void release(SegmentContacts& s) {
    for (int c = s.contacts.count - 1; c >= 0 && s.contacts.count > 1; --c) {
      KnownContact& k = s.contacts.known[c];
      const double sigma = s.contacts.force_sigma(c);
      const double least = std::max(settings_.least_force, settings_.gone_sigmas * sigma);
      const bool gone = norm(k.force) < least && sigma < settings_.least_force;
      if (!gone) k.gone = 0.0;
      if (gone && k.gone == 0.0) k.gone = now_.time;
      if (!gone || now_.time - k.gone < now_.brief()) continue;
      end(k.serial);
      s.contacts.remove(c);
      s.forget_references();
    }
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  JointFit fit_;
  KnownFit known_;
  Reports reports_;
  std::vector<Past> pasts_;  // per segment: of its whole wrench
  Arrivals arrivals_;
  Merging merging_;
  Twins twins_;
  SegmentSample now_;
};

}  // namespace touchline
