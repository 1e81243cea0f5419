// SPDX-License-Identifier: Apache-2.0
// Where else a newcomer beside restless hands may be. Where one sample leaves fewer equations than
// unknowns a curve on a link explains it. One tangent plane does not stand for that curve: what is
// known in it contradicts the next samples. So places stand side by side along the curve, each so
// narrow that a plane does. Each is followed with all forces until the samples have decided.
// No allocation after construction.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "touchline/detail/localizer/held_sample.hpp"
#include "touchline/detail/localizer/joint_fit.hpp"
#include "touchline/detail/localizer/segment_contacts.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class RivalPlaces {
 public:
  // `rows`: at most so many are measured.
  RivalPlaces(const LinkSurfaces& surfaces, const LocalizerSettings& settings, std::size_t rows)
      : surfaces_(surfaces),
        settings_(settings),
        fitter_(settings),
        sample_(rows),
        rivals_(kMost),
        starts_(kRoom) {}

  bool any() const { return count_ > 0 || waiting_ > 0; }
  // Have the samples yet to decide where the contact of this number is?
  bool undecided(int serial) const { return any() && added_.serial == serial; }
  // Has the curve yet to be followed to its ends? Until then nothing is told.
  bool searching() const { return any() && lead_ < 0; }

  void drop() {
    count_ = waiting_ = 0;
    meeting_ = false;
    lead_ = -1;
    taken_ = kMost;
  }

  // A newcomer is admitted to contacts that were known as `before`, of which `change` may have changed.
  void begin(const JointEstimate& before, const Change& change, const KnownContact& added,
             const Answer& answer, double time) {
    drop();
    const Candidate& best = answer.candidates[0];
    const bool narrow = best.along[0] + best.along[2] < kSigma * kSigma;
    if (!(before.unrest() > 0.0) || (answer.count == 1 && narrow)) return;
    prior_ = before;
    for (int i = 0; i < prior_.size(); ++i)
      prior_.covariance[i * (prior_.size() + 1)] += change.added[i];
    prior_time_ = time;
    added_ = added;
    own_ = before.count;
    for (int i = 0; i < answer.count; ++i) {
      const Candidate& k = answer.candidates[i];
      const int node = surfaces_[k.surface].node;
      wait({k.surface, node, surfaces_.to_node(k.point, node), surfaces_.turn_to_node(k.normal, node),
            k.fit.force, {}, 0.0, kFirst});
    }
  }

  // A sample that the known contacts have taken. In every 1 / K all rivals take one, the same, so that
  // what none explains speaks against none. The most probable one is what is known. `told`: what is
  // said of the newcomer. With about so many units of work (`PlaceTuning::search_work`): one sample is
  // worked on for as long as that takes. Returns how many it took.
  int follow(Known& known, const SegmentSample& now, const Measurement& measurement,
             JointFit& fit, const Change& change, int units, KnownContact& told) {
    if (!still(known)) drop();
    if (!any()) return 0;
    if (waiting_ > 0 && !meeting_) {
      prior_.creep(now.time - prior_time_, now.bandwidth, settings_, settings_.unrest_lasts);
      keep_history(known.contacts, prior_);
      added_.lag = known.contacts.known[own_].lag;
      hold(known, now, measurement, change);
      for (int i = 0; i < waiting_; ++i) sample_.add(starts_[i].node, added_.lag);
      meeting_ = true;
    } else if (!working() && now.time >= turn_ - 1e-6) {
      for (int i = 0; i < count_; ++i) keep_history(known.contacts, rivals_[i].contacts);
      hold(known, now, measurement, change);
      for (int i = 0; i < count_; ++i) sample_.add(own(rivals_[i]).node, own(rivals_[i]).lag);
      taken_ = 0;
    }
    int done = 0;
    const bool worked = working();
    while (meeting_ && done < units) {
      meet(next(), fit);
      done += kMeet;
      meeting_ = waiting_ > 0 && count_ < kMost;
      if (!meeting_) waiting_ = 0;
    }
    for (; taken_ < count_ && done < units; done += kTake) take(rivals_[taken_++], fit);
    if (count_ == 0 || meeting_) return done;
    if (worked && !working()) conclude(known);
    told = known.contacts.known[own_];
    tell(told);
    left_ = known.contacts.known[own_].point;
    if (count_ == 1) {
      KnownContact& k = known.contacts.known[own_];
      k.status = told.status;
      k.count = told.count;
      k.others[0] = told.others[0];
      k.body_probability = told.body_probability;
      drop();
    }
    return done;
  }

 private:
  // Rivals: 14 cm of a curve, and starts that wait. Half: long curves are cut. Double: time.
  static constexpr int kMost = 24, kRoom = 64;
  // One sigma of a rival along the curve [m]: its force then is off by some 0.3 N, and both together
  // make no larger moment than a look's noise at 0.01 Nm. They stand two sigmas apart.
  static constexpr double kSigma = 3e-3, kApart = 2.0 * kSigma;
  static constexpr double kFirst = std::numeric_limits<double>::infinity();
  static constexpr double kWorth = 8.0;  // nats below the best: 1 in 3000, no curve is followed there
  // Places in a row whose forces are outside of the cone, over which a curve is followed: 3.6 cm, a round
  // edge of a link. Half: the face behind it is missed. Double: time.
  static constexpr int kOutside = 6;
  static constexpr double kNegligible = 10.0;  // nats below the best: 5e-5, that counts as nothing
  static constexpr double kClearly = 0.7;  // nats: twice as probable is another one that leads
  static constexpr double kOneSide = 0.5;  // cosine of normals, 60 degrees: the same side of a link
  static constexpr double kOne = 1e-3;     // [m] rivals that are nearer are one: a third of a sigma
  static constexpr int kTurns = 2;         // Newton steps: the second corrects some tenths of a mm
  // Units of work: to meet a place, and for a rival to take a sample.
  static constexpr int kMeet = 200, kTake = 80;

  struct Start {
    int surface, node;
    Vec3 point, normal;  // in the frame of the node
    Vec3 force;          // in world [N]
    Vec3 axis;           // along the curve, in the frame of the node; none of a first one
    double way;          // -1, 1: which way the curve is followed, 0: both
    double worth;        // nats: of the one that it is beside; a first one comes first
    int outside = 0;     // places just before it on the curve that are outside of the cone
  };

  struct Rival {
    JointEstimate contacts;
    double evidence = 0.0, crept = 0.0, updated = 0.0;
    double weight = 0.0;  // by the last sample that all have taken
  };

  // Is there work left on the sample that is kept?
  bool working() const { return meeting_ || taken_ < count_; }

  // Keeps a sample, for all rivals.
  void hold(const Known& known, const SegmentSample& now, const Measurement& measurement,
            const Change& change) {
    at_ = now;
    change_ = change;
    turn_ = now.time + now.brief();
    sample_.take(measurement);
    for (int c = 0; c < own_; ++c) {
      const KnownContact& k = known.contacts.known[c];
      sample_.add(k.node, k.lag);
    }
  }

  // All have taken the sample.
  void conclude(Known& known) {
    for (int i = 0; i < count_; ++i) rivals_[i].weight = weigh(rivals_[i]);
    if (lead_ < 0) lead(known, most_probable());
    const int best = most_probable();
    if (rivals_[best].weight > rivals_[lead_].weight + kClearly) lead(known, best);
    prune();
  }

  void wait(const Start& start) {
    if (waiting_ < kRoom) starts_[waiting_++] = start;
  }

  // The most promising start.
  Start next() {
    const auto best = std::max_element(starts_.begin(), starts_.begin() + waiting_,
                                       [](const Start& a, const Start& b) { return a.worth < b.worth; });
    const Start start = *best;
    *best = starts_[--waiting_];
    return start;
  }

  // Are the known contacts those that this has left?
  bool still(const Known& known) const {
    const JointEstimate& all = known.contacts;
    if (all.count != own_ + 1 || all.known[own_].serial != added_.serial) return false;
    return lead_ < 0 || norm(all.known[own_].point - left_) < settings_.same_place;
  }

  KnownContact& own(Rival& r) const { return r.contacts.known[own_]; }
  const KnownContact& own(const Rival& r) const { return r.contacts.known[own_]; }

  // A place that is met is improved across the curve, and the curve followed on from it.
  void meet(Start start, JointFit& fit) {
    const bool first = start.way == 0.0;
    if (first) start.axis = axis_at(start, fit);
    Rival& r = rivals_[count_];
    const Vec3 begun = start.point;
    for (int turn = 0; turn < kTurns; ++turn) {
      set(start, r.contacts);
      narrow(start, r.contacts);
      fit.begin(sample_, r.contacts);
      if (turn == kTurns - 1) r.evidence = fit.log_evidence(r.contacts, Change::none(), 1.0);
      fit.accept(r.contacts, Change::none(), 1.0);
      const SurfacePoint p = surfaces_[start.surface].mesh.nearest_to_point(
          own(r).point, settings_.surface_reach);
      if (p.face < 0) return;
      start.point = p.point;
      start.force = own(r).force;
      // At an edge the normal is that of either side.
      const double here = cone(start.surface, start.node, p.normal, start.force);
      if (dot(p.normal, start.normal) > JointEstimate::kOnePlane ||
          here <= cone(start.surface, start.node, start.normal, start.force))
        start.normal = p.normal;
    }
    r.crept = at_.time;
    r.updated = at_.time + at_.brief();
    if (!first && norm(start.point - begun) > 2.0 * kApart) return;
    const double outside = cone(start.surface, start.node, start.normal, start.force);
    if (!std::isfinite(r.evidence) || !std::isfinite(outside)) return;
    for (int i = 0; i < count_; ++i) {
      const KnownContact& k = own(rivals_[i]);
      if (k.surface == start.surface && norm(k.point - start.point) < 0.5 * kApart) return;
    }
    const double w = r.evidence - 0.5 * outside;
    const bool worth = count_ == 0 || w >= best_ - kWorth;
    if (worth) {
      best_ = count_ > 0 ? std::max(best_, w) : w;
      ++count_;
    } else if (first || start.outside == kOutside || r.evidence < best_ - kWorth) {
      return;
    }
    const Vec3 axis = axis_at(start, fit);
    const double sign = dot(axis, start.axis) < 0.0 ? -1.0 : 1.0;
    for (const double way : {-1.0, 1.0}) {
      if (!first && way != start.way) continue;
      const SurfacePoint p = surfaces_[start.surface].mesh.nearest_to_point(
          start.point + way * sign * kApart * axis, settings_.surface_reach);
      if (p.face < 0 || norm(p.point - start.point) < 0.5 * kApart) continue;
      const Vec3 along = sign * axis - dot(sign * axis, p.normal) * p.normal;
      wait({start.surface, start.node, p.point, p.normal, start.force,
            (1.0 / std::max(norm(along), 1e-9)) * along, way, worth ? w : r.evidence - kWorth,
            worth ? 0 : start.outside + 1});
    }
  }

  // All contacts, as they were before, with a newcomer there.
  void set(const Start& start, JointEstimate& out) const {
    out = prior_;
    KnownContact k = added_;
    k.surface = start.surface;
    k.node = start.node;
    k.point = k.alike = start.point;
    k.normal = start.normal;
    k.force = start.force;
    out.add(k, settings_);
  }

  // It is where it is along the curve, and anywhere across it.
  void narrow(const Start& start, JointEstimate& out) const {
    Vec3 s, t;
    tangents(start.normal, s, t);
    double u[2] = {dot(start.axis, s), dot(start.axis, t)};
    const double size = std::max(std::hypot(u[0], u[1]), 1e-9);
    u[0] /= size;
    u[1] /= size;
    const int n = out.size(), at = n - 2;
    const double along = kSigma * kSigma, across = settings_.anywhere;
    out.covariance[at * n + at] = along * u[0] * u[0] + across * u[1] * u[1];
    out.covariance[(at + 1) * n + at + 1] = along * u[1] * u[1] + across * u[0] * u[0];
    out.covariance[at * n + at + 1] = out.covariance[(at + 1) * n + at] =
        (along - across) * u[0] * u[1];
  }

  // Along which a place changes while the sample is explained: the longest axis of its covariance.
  Vec3 axis_at(const Start& start, JointFit& fit) {
    set(start, scratch_);
    fit.begin(sample_, scratch_);
    fit.judge(scratch_);
    const int n = scratch_.size(), at = n - 2;
    const double a = scratch_.covariance[at * n + at], b = scratch_.covariance[at * n + at + 1],
                 c = scratch_.covariance[(at + 1) * n + at + 1];
    const double angle = 0.5 * std::atan2(2.0 * b, a - c);
    Vec3 s, t;
    tangents(start.normal, s, t);
    return std::cos(angle) * s + std::sin(angle) * t;
  }

  void take(Rival& r, JointFit& fit) {
    const double passed = std::clamp(at_.time - r.updated, 0.0, at_.brief());
    r.contacts.creep(std::max(0.0, at_.time - r.crept), at_.bandwidth, settings_,
                     settings_.unrest_lasts);
    r.crept = at_.time;
    if (passed > 0.0) r.updated = at_.time;
    const double independence = 0.5 * at_.bandwidth * passed;
    // That restless forces change little is no evidence: how little is not known well enough.
    Change free = change_;
    for (int c = 0; c < r.contacts.count; ++c) {
      if (r.contacts.known[c].unrest.rate() > 0.0) free.force(c, settings_.force_scale);
    }
    fit.begin(sample_, r.contacts);
    r.evidence += fit.log_evidence(r.contacts, free, independence);
    fit.accept(r.contacts, free, independence);
  }

  // What the contacts have shown since they began does not depend on where the newcomer is.
  static void keep_history(const JointEstimate& from, JointEstimate& to) {
    for (int c = 0; c < to.count; ++c) {
      const KnownContact& k = from.known[c];
      to.known[c].age = k.age;
      to.known[c].lag = k.lag;
      to.known[c].unrest = k.unrest;
      to.known[c].gone = k.gone;
    }
  }

  // How far a force is outside of its cone.
  double cone(int surface, int node, const Vec3& normal, const Vec3& force) const {
    const double size = norm(force);
    if (surfaces_[surface].graspable || !(size > settings_.least_force)) return 0.0;
    return fitter_.cone_cost(-dot(surfaces_.turn_to_world(normal, node), force) / size);
  }
  double cone(const KnownContact& k) const { return cone(k.surface, k.node, k.normal, k.force); }

  // All forces follow from where the newcomer is: one that pulls at a known contact is as improbable.
  double weigh(const Rival& r) const {
    double outside = 0.0;
    for (int c = 0; c <= own_; ++c)
      outside += std::min(cone(r.contacts.known[c]), 2.0 * kNegligible);
    return r.evidence - 0.5 * outside;
  }

  int most_probable() const {
    int best = 0;
    for (int i = 1; i < count_; ++i) {
      if (rivals_[i].evidence > rivals_[best].evidence) best = i;
    }
    return best;
  }

  // Rival i is what is known from now on.
  void lead(Known& known, int i) {
    JointEstimate taken = rivals_[i].contacts;
    keep_history(known.contacts, taken);
    known.contacts = taken;
    known.crept = rivals_[i].crept;
    known.updated = rivals_[i].updated;
    lead_ = i;
  }

  void remove(int i) {
    const int last = --count_;
    if (i != last) rivals_[i] = rivals_[last];
    if (lead_ == last) lead_ = i;
  }

  // Leaves out what is improbable; those that have come to one place are one.
  void prune() {
    best_ = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < count_; ++i) best_ = std::max(best_, rivals_[i].weight);
    for (int i = count_ - 1; i >= 0; --i) {
      if (i == lead_) continue;
      if (rivals_[i].weight < best_ - kNegligible) {
        remove(i);
        continue;
      }
      const KnownContact& k = own(rivals_[i]);
      for (int j = 0; j < count_; ++j) {
        if (j == i) continue;
        const KnownContact& other = own(rivals_[j]);
        if (other.surface != k.surface || norm(other.point - k.point) > kOne) continue;
        double &a = rivals_[j].evidence, b = rivals_[i].evidence;
        a = std::max(a, b) + std::log1p(std::exp(-std::fabs(a - b)));
        rivals_[j].weight = weigh(rivals_[j]);
        remove(i);
        break;
      }
    }
  }

  // What all together say of the newcomer: one place of those on one side of the link, and the others.
  void tell(KnownContact& told) const {
    double probability[kMost], sum = 0.0;
    for (int i = 0; i < count_; ++i) sum += probability[i] = std::exp(rivals_[i].weight - best_);
    for (int i = 0; i < count_; ++i) probability[i] /= sum;
    const KnownContact& best = own(rivals_[lead_]);
    bool mine[kMost];
    double all = 0.0;
    Vec3 mean{};
    for (int i = 0; i < count_; ++i) {
      const KnownContact& k = own(rivals_[i]);
      mine[i] = k.surface == best.surface && dot(k.normal, best.normal) > kOneSide;
      if (!mine[i]) continue;
      all += probability[i];
      mean = mean + probability[i] * k.point;
    }
    const SurfacePoint p = surfaces_[best.surface].mesh.nearest_to_point(
        (1.0 / all) * mean, settings_.surface_reach);
    if (p.face >= 0) {
      told.point = p.point;
      told.normal = p.normal;
    }
    Vec3 to[2];
    tangents(told.normal, to[0], to[1]);
    Spread spread{};
    double here = 0.0;
    for (int i = 0; i < count_; ++i) {
      if (!mine[i]) continue;
      const KnownContact& k = own(rivals_[i]);
      const Vec3 off = k.point - told.point;
      const double x = dot(off, to[0]), y = dot(off, to[1]);
      Vec3 from[2];
      tangents(k.normal, from[0], from[1]);
      double turn[2][2];
      for (int a = 0; a < 2; ++a) {
        for (int b = 0; b < 2; ++b) turn[a][b] = dot(to[a], from[b]);
      }
      const auto element = [&](int a, int b) {
        return turn[a][0] * (k.place.a * turn[b][0] + k.place.b * turn[b][1]) +
               turn[a][1] * (k.place.b * turn[b][0] + k.place.c * turn[b][1]);
      };
      const double w = probability[i] / all;
      spread = spread + w * Spread{element(0, 0) + x * x, element(0, 1) + x * y,
                                   element(1, 1) + y * y};
      if (norm(off) < settings_.place_radius) here += probability[i];
    }
    told.place = spread;
    told.count = 1;
    told.others[0] = {told.surface, told.node, told.point, all};
    told.body_probability = all;
    for (int i = 0; i < count_; ++i) {
      if (mine[i]) continue;
      const KnownContact& k = own(rivals_[i]);
      if (k.node == told.node) told.body_probability += probability[i];
      const auto near = [&](const KnownContact::Other& o) {
        return o.surface == k.surface && norm(o.point - k.point) < settings_.place_radius;
      };
      auto* const end = told.others + told.count;
      auto* const found = std::find_if(told.others + 1, end, near);
      if (found != end) {
        found->weight += probability[i];
      } else if (told.count < Answer::kCandidates) {
        told.others[told.count++] = {k.surface, k.node, k.point, probability[i]};
      }
    }
    told.body_probability = std::min(1.0, told.body_probability);
    const bool sure = waiting_ == 0 && here >= settings_.certain;
    told.status = sure ? Status::located : Status::ambiguous;
  }

  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  ForceFitter fitter_;
  JointEstimate prior_, scratch_;  // what was known before; room
  // The sample that is worked on, what may have changed in it, and how many have taken it. Is the curve
  // still followed?
  HeldSample sample_;
  SegmentSample at_;
  Change change_;
  int taken_ = kMost;
  bool meeting_ = false;
  double turn_ = 0.0, prior_time_ = 0.0, best_ = 0.0;
  KnownContact added_;
  int own_ = 0, lead_ = -1;  // which contact, and which leads
  Vec3 left_{};
  std::vector<Rival> rivals_;
  int count_ = 0;
  std::vector<Start> starts_;
  int waiting_ = 0;
};

}  // namespace touchline
