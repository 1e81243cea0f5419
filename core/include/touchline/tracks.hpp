// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment over time. Contacts rarely begin at the same instant: as long as the
// known ones, with their forces free, explain what is measured, nothing has begun. When they no
// longer do, what is left without them is a single contact again. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/known_fit.hpp"
#include "touchline/past.hpp"
#include "touchline/reports.hpp"
#include "touchline/segment_contacts.hpp"
#include "touchline/single_contact.hpp"
#include "touchline/twins.hpp"

namespace touchline {

class Tracks {
 public:
  static constexpr int kMost = SegmentContacts::kMost;

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
        twins_(single.surfaces(), measurement, settings, fit_, known_, reports_, rows, segments) {}

  // One sample of segment g: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(SegmentContacts& s, int g, double bandwidth, double time, Read&& read) {
    reports_.clear();
    g_ = g;
    bandwidth_ = bandwidth;
    time_ = time;
    if (!read()) {
      report(s.count > 0 ? s.known[0].serial : s.first, single_.clear());
      return;
    }
    if (!measurement_.has_wrench() || settings_.first_entry) {
      report(s.first, single_.locate(g, 0.0, measurement_));
      return;
    }
    total_ = force();
    const double age = s.age.follow(total_, bandwidth, time);
    lag_ = age / bandwidth;
    pasts_[g].follow(total_, bandwidth, time, measurement_.posture());
    for (int c = 0; c < s.count; ++c) {
      if (!s.arriving || s.count > 1)
        s.known[c].lag = s.known[c].age.follow(s.known[c].force, bandwidth, time) / bandwidth;
    }
    if (s.arriving) {
      arrive(s, read);
    } else if (s.count < 2) {
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
  static constexpr double kNear = 2e-3;        // places that differ by less are the same [m]
  static constexpr double kSlide = 0.5;        // contacts slide no faster [m/s]
  static constexpr double kAnywhere = 1e-2;    // variance of a place before it is known [m2]
  static constexpr double kDrift = 1e-8;       // of a place's variance [m2/s]

  double young() const { return SegmentContacts::kYoung / bandwidth_; }
  double brief() const { return 1.0 / bandwidth_; }

  Vec3 force() const {
    const double* w = measurement_.wrench();
    return {w[0], w[1], w[2]};
  }

  void report(int serial, const Answer& answer) { reports_.add(serial, answer); }
  void report(const KnownContact& k) { reports_.add(k); }
  void end(int serial) { reports_.end(serial); }

  // --- one contact, as far as is known ---
  template <class Read>
  void sole(SegmentContacts& s, Read&& read) {
    const Past& past = pasts_[g_];
    const Answer& a = past.known() ? single_.locate(g_, past, measurement_)
                                   : single_.locate(g_, lag_, measurement_);
    if (s.count == 0) {
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
        settle(s, s.first, a);
      }
      return;
    }
    if (agrees(s.known[0], a, single_.surfaces(), kNear)) {
      report(s.known[0].serial, a);
      const bool due = time_ - s.updated >= SegmentContacts::kRefit / bandwidth_;
      if (due && explains(s.known[0])) accept(s);
      return;
    }
    if (explains(s.known[0])) {
      report(s.known[0].serial, a);
      return;
    }
    begin_arrival(s);
    read();
    arrive(s, read);
  }

  // Does a sole contact explain all, with its force free?
  bool explains(const KnownContact& k) {
    const Past& past = pasts_[g_];
    return past.known() ? known_.explain_alone(k, measurement_.quadratic(k.node), past.mean(k.node))
                        : known_.explain_freely(&k, 1);
  }

  // A contact has become known.
  void settle(SegmentContacts& s, int serial, const Answer& a) {
    KnownContact& k = s.known[s.count++];
    k = KnownContact{};
    k.serial = serial;
    keep(a, single_.surfaces(), k);
    k.lag = brief();
    k.age = s.count == 1 ? s.age : s.new_age;
    s.updated = time_ + brief();
    s.forget_references();
  }

  // Takes the last fit over, and keeps it for when something arrives.
  void accept(SegmentContacts& s) {
    fit_.apply_forces(s.known);
    const double passed = std::min(time_ - s.updated, brief());
    if (passed > 0.0) {
      double free[kMost];
      std::fill(free, free + kMost, settings_.force_scale);
      fit_.apply_places(s.known, 0.5 * bandwidth_ * passed, free, kDrift * passed);
      s.updated = time_;
    }
    s.refer(fit_, time_, SegmentContacts::kRefit / bandwidth_);
  }

  // --- something new ---
  void begin_arrival(SegmentContacts& s) {
    s.arriving = true;
    s.since = time_;
    s.is_calm = s.is_placed = false;
    s.newcomer = -1;
    s.new_age.restart(time_ - period_);
    s.refer(KnownFit::kSteady);
  }

  template <class Read>
  void arrive(SegmentContacts& s, Read&& read) {
    for (int c = 0; c < s.count; ++c)
      s.before.known[c].lag =
          s.before.known[c].age.follow(s.before.known[c].force, bandwidth_, time_) / bandwidth_;
    if (subsided(s)) return;
    if (slid(s, read)) return;
    read();
    Answer& a = remainder(s, read);
    const bool found = placed(a);
    if (!found && changed(s, read)) return;
    if (lets_go(s, a)) return;
    if (found && !s.is_placed) s.placed = time_;
    s.is_placed = found;
    if (found && time_ - s.placed >= brief() && time_ - s.since >= young() && s.count < kMost) {
      commit(s, a, read);
      return;
    }
    const bool lasting = time_ - s.since >= 2.0 * brief();
    for (int c = 0; c < s.count; ++c) {
      report(s.before.known[c]);
      if (lasting && !found) reports_.doubt_last();
    }
    if (!found && !lasting) return;
    if (s.newcomer < 0) s.newcomer = reports_.next();
    report(s.newcomer, a);
  }

  // Do the known contacts explain all again?
  bool subsided(SegmentContacts& s) {
    fit_.allow_for_motion(s.before.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    if (!known_.explain(s.before.known, s.count)) {
      s.is_calm = false;
      return false;
    }
    resume(s);
    return true;
  }

  // Or do they with all their forces changed, where no single contact explains what is left?
  template <class Read>
  bool changed(SegmentContacts& s, Read&& read) {
    if (s.count == 1) return false;
    read();
    fit_.allow_for_motion(s.before.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    if (!known_.explain_freely(s.before.known, s.count)) return false;
    resume(s);
    return true;
  }

  // Is what is left a known contact that lets go?
  bool lets_go(SegmentContacts& s, const Answer& a) {
    for (int c = 0; c < s.count; ++c) {
      const KnownContact& k = s.before.known[c];
      if (!takes_back(k, a, single_.surfaces(), settings_.place_radius)) continue;
      for (int i = 0; i < s.count; ++i) report(s.before.known[i]);
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
    std::copy(s.before.known, s.before.known + s.count, s.known);
    fit_.apply_forces(s.known);
    for (int c = 0; c < s.count; ++c) report(s.known[c]);
    if (time_ - s.calm >= brief()) {
      s.arriving = false;
      s.forget_references();
      end(s.newcomer);
    }
  }

  // Has one contact moved along its body, no faster than contacts slide?
  template <class Read>
  bool slid(SegmentContacts& s, Read&& read) {
    for (int c = 0; c < s.count; ++c) {
      read();
      KnownContact others[kMost];
      std::copy(s.before.known, s.before.known + c, others);
      std::copy(s.before.known + c + 1, s.before.known + s.count, others + c);
      if (s.count > 1) {
        JointFit::independent(others, s.count - 1, KnownFit::kSteady, loosened_);
        fit_.take_out(others, s.count - 1, loosened_, measurement_);
      }
      const KnownContact& k = s.before.known[c];
      const Answer& a = single_.locate(g_, s.count > 1 ? k.lag : lag_, measurement_);
      const double way = kSlide * (time_ - s.since + brief());
      if (within_reach(k, a, single_.surfaces(), way)) {
        slide(s, c, a);
        return true;
      }
    }
    return false;
  }

  // Contact c is where it is found now; after a while that is where it is known to be.
  void slide(SegmentContacts& s, int c, const Answer& a) {
    for (int i = 0; i < s.count; ++i) {
      if (i != c) report(s.before.known[i]);
    }
    report(s.before.known[c].serial, a);
    if (time_ - s.since < young()) return;
    std::copy(s.before.known, s.before.known + s.count, s.known);
    keep(a, single_.surfaces(), s.known[c]);
    s.arriving = false;
    s.forget_references();
    end(s.newcomer);
  }

  // What is left without the known contacts, as one contact: with their forces held, or, where
  // that explains nothing, free.
  template <class Read>
  Answer& remainder(SegmentContacts& s, Read&& read) {
    SegmentContacts::Reference& r = s.before;
    fit_.take_out(r.known, r.count, r.uncertainty, measurement_);
    const double lag = s.new_age.follow(force(), bandwidth_, time_) / bandwidth_;
    answer_ = single_.locate(g_, lag, measurement_);
    freed_ = false;
    if (placed(answer_) || answer_.status == Status::wrench_only) return answer_;
    read();
    JointFit::independent(r.known, r.count, settings_.force_scale, loosened_);
    fit_.take_out(r.known, r.count, loosened_, measurement_);
    const Answer& freed = single_.locate(g_, lag, measurement_);
    freed_ = placed(freed);
    if (freed_) answer_ = freed;
    return answer_;
  }

  template <class Read>
  void commit(SegmentContacts& s, const Answer& a, Read&& read) {
    if (s.newcomer < 0) s.newcomer = reports_.next();
    std::copy(s.before.known, s.before.known + s.count, s.known);
    for (int c = 0; c < s.count; ++c) report(s.known[c]);
    report(s.newcomer, a);
    read();
    settle(s, s.newcomer, a);
    relate(s);
    s.arriving = false;
  }

  // What the place of the newest contact shares with the others, since it was found without them:
  // a fit in which it is not known yet.
  void relate(SegmentContacts& s) {
    double sigma[kMost];
    for (int c = 0; c < s.count; ++c)
      sigma[c] = freed_ || c == s.count - 1 ? settings_.force_scale
                                            : s.before.uncertainty.force_sigma(c);
    KnownContact& newest = s.known[s.count - 1];
    newest.place = {kAnywhere, 0.0, kAnywhere};
    fit_.allow_for_motion(s.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    fit_.fit(measurement_, s.known, s.count, sigma);
    fit_.apply_places(s.known, 1.0, sigma, 0.0);
  }

  // --- several contacts, all known ---
  template <class Read>
  void several(SegmentContacts& s, Read&& read) {
    fit_.allow_for_motion(s.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    if (!known_.explain(s.known, s.count)) {
      begin_arrival(s);
      read();
      arrive(s, read);
      return;
    }
    double sigma[kMost];
    for (int c = 0; c < s.count; ++c) sigma[c] = fit_.force_sigma(c);
    accept(s);
    for (int c = 0; c < s.count; ++c) report(s.known[c]);
    release(s, sigma);
  }

  // Contacts without force have gone; the last one stays until the segment is quiet.
  void release(SegmentContacts& s, const double* sigma) {
    for (int c = s.count - 1; c >= 0 && s.count > 1; --c) {
      KnownContact& k = s.known[c];
      const bool gone = norm(k.force) < std::max(settings_.least_force, 4.0 * sigma[c]) &&
                        sigma[c] < KnownFit::kSteady * 3.0;
      if (!gone) k.gone = 0.0;
      if (gone && k.gone == 0.0) k.gone = time_;
      if (!gone || time_ - k.gone < brief()) continue;
      end(k.serial);
      std::copy(s.known + c + 1, s.known + s.count, s.known + c);
      --s.count;
      s.forget_references();
    }
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  double period_;
  JointFit fit_;
  KnownFit known_;
  JointFit::Uncertainty loosened_;
  Answer answer_;
  bool freed_ = false;  // was it found with the forces of the known contacts free?
  Reports reports_;
  std::vector<Past> pasts_;  // per segment: of its whole wrench
  Twins twins_;
  int g_ = 0;
  double bandwidth_ = 0.0, time_ = 0.0, lag_ = 0.0;
  Vec3 total_;
};

}  // namespace touchline
