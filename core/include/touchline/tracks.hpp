// SPDX-License-Identifier: Apache-2.0
// The contacts on one segment over time. Contacts rarely begin at the same instant: as long as the
// known ones, with their forces free, explain what is measured, nothing has begun. When they no
// longer do, what is left without them is a single contact again. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/joint_fit.hpp"
#include "touchline/single_contact.hpp"

namespace touchline {

// What is said of one contact, under its number.
struct Report {
  int serial = -1;
  Answer answer;
};

// What is remembered of a segment.
struct Segmented {
  static constexpr int kMost = JointFit::kMost;

  // Contacts at a time before anything new could have been felt.
  struct Reference {
    int count = 0;
    KnownContact known[kMost];
    JointFit::Uncertainty uncertainty;
  };

  bool touched = false;
  int first = -1;  // number of the contact that stands for the segment while none is known
  int count = 0;
  KnownContact known[kMost];
  Age age;               // of the segment's wrench
  double explained = 0;  // since when one contact has explained all [s]
  bool explains = false;
  double fitted = 0.0;   // time of the last fit [s]
  Reference now, before;

  bool arriving = false;  // is there something that the known contacts do not explain?
  int newcomer = -1;      // its number, once it is reported
  double since = 0.0, calm = 0.0, placed = 0.0;
  bool is_calm = false, is_placed = false;
  Age new_age;
};

class Tracks {
 public:
  static constexpr int kMost = Segmented::kMost, kReports = kMost + 1;

  Tracks(SingleContact& single, Measurement& measurement, const LocalizerSettings& settings,
         std::size_t rows, double period)
      : single_(single),
        measurement_(measurement),
        settings_(settings),
        period_(period),
        fit_(measurement.posture(), single.surfaces(), rows) {}

  // One sample of segment g: fills the reports. `read()` takes the measurement anew.
  template <class Read>
  void follow(Segmented& s, int g, double bandwidth, double time, Read&& read) {
    count_ = ended_ = 0;
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

  int count() const { return count_; }
  const Report& operator[](int i) const { return reports_[i]; }
  // Numbers of contacts that have ended with this sample.
  int ended() const { return ended_; }
  int ended(int i) const { return endings_[i]; }
  int next() { return serial_++; }

 private:
  // Squared distances beyond which known contacts do not explain a sample: this many sigmas of a
  // normal variable. Independent looks come every 2 / K: with ideal noise and K = 100 rad/s one
  // false arrival in 19 h of contact.
  static constexpr double kArrival = 5.0;
  static constexpr double kYoung = 3.0;        // times 1 / K, until a contact counts as known
  static constexpr double kRefit = 0.5;        // times 1 / K, between fits of a sole contact
  static constexpr double kSteady = 0.3;       // change of a force that is held, in a sample [N]
  static constexpr double kNear = 2e-3;        // places that differ by less are the same [m]
  static constexpr double kSlide = 0.5;        // contacts slide no faster [m/s]
  static constexpr double kDrift = 1e-5;       // of a place's variance [m2/s]

  static bool placed(const Answer& a) {
    return a.status == Status::located || a.status == Status::ambiguous;
  }
  double young() const { return kYoung / bandwidth_; }
  double brief() const { return 1.0 / bandwidth_; }

  Vec3 force() const {
    const double* w = measurement_.wrench();
    return {w[0], w[1], w[2]};
  }

  void report(int serial, const Answer& answer) {
    if (count_ == kReports) return;
    reports_[count_].serial = serial;
    reports_[count_++].answer = answer;
  }
  void report(const KnownContact& k) {
    if (count_ == kReports) return;
    reports_[count_].serial = k.serial;
    touchline::report(k, single_.surfaces(), reports_[count_++].answer);
  }
  void end(int serial) {
    if (serial >= 0 && ended_ < kReports) endings_[ended_++] = serial;
  }

  // --- one contact, as far as is known ---
  template <class Read>
  void sole(Segmented& s, Read&& read) {
    const Answer& a = single_.locate(g_, lag_, measurement_);
    if (s.count == 0) {
      report(s.first, a);
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
    if (consistent(s.known[0], a)) {
      report(s.known[0].serial, a);
      if (time_ - s.fitted >= kRefit / bandwidth_) remember(s);
      return;
    }
    double free[kMost];
    std::fill(free, free + kMost, settings_.force_scale);
    if (explain(s.known, 1, free) < limit(3)) {
      report(s.known[0].serial, a);
      return;
    }
    begin_arrival(s);
    read();
    arrive(s, read);
  }

  // A contact has become known.
  void settle(Segmented& s, int serial, const Answer& a) {
    KnownContact& k = s.known[s.count++];
    k = KnownContact{};
    k.serial = serial;
    keep(a, single_.surfaces(), k);
    k.lag = brief();
    k.age = s.count == 1 ? s.age : s.new_age;
    s.now.count = s.before.count = 0;
  }

  bool consistent(const KnownContact& k, const Answer& a) const {
    if (!placed(a)) return false;
    const Vec3 p = single_.surfaces().to_world(k.point, k.node);
    for (int i = 0; i < a.count; ++i) {
      const Candidate& c = a.candidates[i];
      const double sigma = std::sqrt(c.along[0] + c.along[2] + k.place.trace());
      if (c.surface == k.surface && norm(c.point - p) < std::max(kNear, 3.0 * sigma)) return true;
    }
    return false;
  }

  // Fits the known contacts to the measurement at hand; returns the squared distance.
  double explain(const KnownContact* known, int count, const double* sigma) {
    return fit_.fit(measurement_, known, count, sigma);
  }

  // What chi2 does not exceed, with so many unknowns.
  double limit(int unknowns) const {
    return chi2_limit(std::max(1, measurement_.size() - unknowns), kArrival);
  }

  // Brings the known contacts up to date, and keeps what may be needed when something arrives.
  void remember(Segmented& s) {
    double sigma[kMost];
    std::fill(sigma, sigma + kMost, s.count == 1 ? settings_.force_scale : kSteady);
    if (explain(s.known, s.count, sigma) < limit(s.count == 1 ? 3 : 0)) accept(s);
  }

  void accept(Segmented& s) {
    const double passed = std::clamp(time_ - s.fitted, period_, brief());
    fit_.apply(s.known, std::min(1.0, 0.5 * bandwidth_ * passed), kDrift * passed);
    if (time_ - s.fitted < kRefit / bandwidth_ && s.now.count == s.count) return;
    s.fitted = time_;
    if (s.now.count == s.count) s.before = s.now;
    s.now.count = s.count;
    std::copy(s.known, s.known + s.count, s.now.known);
    fit_.uncertainty(s.now.uncertainty);
    if (s.before.count != s.count) s.before = s.now;
  }

  // --- something new ---
  void begin_arrival(Segmented& s) {
    s.arriving = true;
    s.since = time_;
    s.is_calm = s.is_placed = false;
    s.newcomer = -1;
    s.new_age.restart(time_ - period_);
    if (s.before.count != s.count) refer(s);
  }

  // Without a fit to go back to, what is known now must do.
  void refer(Segmented& s) {
    s.before.count = s.count;
    std::copy(s.known, s.known + s.count, s.before.known);
    loose(s.known, s.count, kSteady, s.before.uncertainty);
  }

  // Forces known to `sigma`, places as they are, all independent.
  static void loose(const KnownContact* known, int count, double sigma,
                    JointFit::Uncertainty& out) {
    const int n = out.size = JointFit::kEach * count;
    std::fill(out.root, out.root + n * n, 0.0);
    for (int c = 0; c < count; ++c) {
      double* to = out.root + JointFit::kEach * c * (n + 1);
      for (int i = 0; i < 3; ++i) to[i * (n + 1)] = sigma;
      const Spread& p = known[c].place;
      const double a = std::sqrt(p.a), b = p.b / a;
      to[3 * (n + 1)] = a;
      to[3 * n + 4] = b;
      to[4 * (n + 1)] = std::sqrt(std::max(0.0, p.c - b * b));
    }
  }

  template <class Read>
  void arrive(Segmented& s, Read&& read) {
    for (int c = 0; c < s.count; ++c)
      s.before.known[c].lag =
          s.before.known[c].age.follow(s.before.known[c].force, bandwidth_, time_) / bandwidth_;
    if (subsided(s)) return;
    if (slid(s, read)) return;
    read();
    Answer& a = remainder(s, read);
    const bool found = placed(a);
    if (!found && changed(s, read)) return;
    if (found && !s.is_placed) s.placed = time_;
    s.is_placed = found;
    if (found && time_ - s.placed >= brief() && time_ - s.since >= young() && s.count < kMost) {
      commit(s, a);
      return;
    }
    const bool lasting = time_ - s.since >= 2.0 * brief();
    for (int c = 0; c < s.count; ++c) {
      report(s.before.known[c]);
      if (lasting && !found) reports_[count_ - 1].answer.status = Status::ambiguous;
    }
    if (!found && !lasting) return;
    if (s.newcomer < 0) s.newcomer = next();
    report(s.newcomer, a);
  }

  // Do the known contacts explain all again?
  bool subsided(Segmented& s) {
    fit_.allow_for_motion(s.before.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    if (!explained_by(s.before.known, s.count)) {
      s.is_calm = false;
      return false;
    }
    resume(s);
    return true;
  }

  // Or do they with all their forces changed, where no single contact explains what is left?
  template <class Read>
  bool changed(Segmented& s, Read&& read) {
    if (s.count == 1) return false;
    read();
    fit_.allow_for_motion(s.before.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    double sigma[kMost];
    std::fill(sigma, sigma + kMost, settings_.force_scale);
    if (explain(s.before.known, s.count, sigma) > limit(3 * s.count)) return false;
    resume(s);
    return true;
  }

  // The known contacts explain all, with the forces of the last fit.
  void resume(Segmented& s) {
    if (!s.is_calm) s.calm = time_;
    s.is_calm = true;
    std::copy(s.before.known, s.before.known + s.count, s.known);
    fit_.apply(s.known, 0.0, 0.0);
    for (int c = 0; c < s.count; ++c) report(s.known[c]);
    if (time_ - s.calm >= brief()) {
      s.arriving = false;
      s.now.count = s.before.count = 0;
      end(s.newcomer);
    }
  }

  // Do known contacts explain the measurement with their forces held, or with one of them changed?
  bool explained_by(const KnownContact* known, int count) {
    double sigma[kMost];
    std::fill(sigma, sigma + kMost, kSteady);
    if (explain(known, count, sigma) < limit(0)) return true;
    int best = -1;
    double least = limit(3);
    for (int c = 0; c < count; ++c) {
      sigma[c] = settings_.force_scale;
      const double cost = explain(known, count, sigma);
      sigma[c] = kSteady;
      if (cost < least) {
        least = cost;
        best = c;
      }
    }
    if (best < 0) return false;
    sigma[best] = settings_.force_scale;
    explain(known, count, sigma);
    return true;
  }

  // Has one contact moved along its body, no faster than contacts slide?
  template <class Read>
  bool slid(Segmented& s, Read&& read) {
    for (int c = 0; c < s.count; ++c) {
      read();
      KnownContact others[kMost];
      std::copy(s.before.known, s.before.known + c, others);
      std::copy(s.before.known + c + 1, s.before.known + s.count, others + c);
      if (s.count > 1) {
        loose(others, s.count - 1, kSteady, loosened_);
        fit_.take_out(others, s.count - 1, loosened_, measurement_);
      }
      const KnownContact& k = s.before.known[c];
      const Answer& a = single_.locate(g_, s.count > 1 ? k.lag : lag_, measurement_);
      if (placed(a) && within_reach(k, a, time_ - s.since)) {
        slide(s, c, a);
        return true;
      }
    }
    return false;
  }

  // Can the contact have slid to where it is now found?
  bool within_reach(const KnownContact& k, const Answer& a, double passed) const {
    const Candidate& best = a.candidates[0];
    if (single_.surfaces()[best.surface].node != k.node) return false;
    const double way = norm(best.point - single_.surfaces().to_world(k.point, k.node));
    const double sigma = std::sqrt(best.along[0] + best.along[2] + k.place.trace());
    return way < kSlide * (passed + brief()) + 3.0 * sigma;
  }

  // Contact c is where it is found now; after a while that is where it is known to be.
  void slide(Segmented& s, int c, const Answer& a) {
    for (int i = 0; i < s.count; ++i) {
      if (i != c) report(s.before.known[i]);
    }
    report(s.before.known[c].serial, a);
    if (time_ - s.since < young()) return;
    std::copy(s.before.known, s.before.known + s.count, s.known);
    keep(a, single_.surfaces(), s.known[c]);
    s.arriving = false;
    s.now.count = s.before.count = 0;
    end(s.newcomer);
  }

  // What is left without the known contacts, as one contact: with their forces held, or, where
  // that explains nothing, free.
  template <class Read>
  Answer& remainder(Segmented& s, Read&& read) {
    Segmented::Reference& r = s.before;
    fit_.take_out(r.known, r.count, r.uncertainty, measurement_);
    const double lag = s.new_age.follow(force(), bandwidth_, time_) / bandwidth_;
    answer_ = single_.locate(g_, lag, measurement_);
    if (placed(answer_) || answer_.status == Status::wrench_only) return answer_;
    read();
    loose(r.known, r.count, settings_.force_scale, loosened_);
    fit_.take_out(r.known, r.count, loosened_, measurement_);
    const Answer& freed = single_.locate(g_, lag, measurement_);
    if (placed(freed)) answer_ = freed;
    return answer_;
  }

  void commit(Segmented& s, const Answer& a) {
    if (s.newcomer < 0) s.newcomer = next();
    std::copy(s.before.known, s.before.known + s.count, s.known);
    for (int c = 0; c < s.count; ++c) report(s.known[c]);
    report(s.newcomer, a);
    settle(s, s.newcomer, a);
    s.arriving = false;
  }

  // --- several contacts, all known ---
  template <class Read>
  void several(Segmented& s, Read&& read) {
    fit_.allow_for_motion(s.known, s.count, measurement_);
    measurement_.spread(nullptr, 0);
    if (!explained_by(s.known, s.count)) {
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
  void release(Segmented& s, const double* sigma) {
    for (int c = s.count - 1; c >= 0 && s.count > 1; --c) {
      KnownContact& k = s.known[c];
      const bool gone = norm(k.force) < std::max(settings_.least_force, 4.0 * sigma[c]) &&
                        sigma[c] < kSteady * 3.0;
      if (!gone) k.gone = 0.0;
      if (gone && k.gone == 0.0) k.gone = time_;
      if (!gone || time_ - k.gone < brief()) continue;
      end(k.serial);
      std::copy(s.known + c + 1, s.known + s.count, s.known + c);
      --s.count;
      s.now.count = s.before.count = 0;
    }
  }

  SingleContact& single_;
  Measurement& measurement_;
  const LocalizerSettings& settings_;
  double period_;
  JointFit fit_;
  JointFit::Uncertainty loosened_;
  Answer answer_;
  Report reports_[kReports];
  int endings_[kReports];
  int count_ = 0, ended_ = 0, serial_ = 0, g_ = 0;
  double bandwidth_ = 0.0, time_ = 0.0, lag_ = 0.0;
  Vec3 total_;
};

}  // namespace touchline
