// SPDX-License-Identifier: Apache-2.0
// A contact whose place on its link is known, while its force may change. No allocation.
// Theory: docs/theory.md, section 6.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "touchline/detail/localizer/settings.hpp"
#include "touchline/detail/place/answer.hpp"
#include "touchline/detail/place/link_surfaces.hpp"

namespace touchline {

// How old that is which a filtered force w speaks of:
//   int K exp(-K a) a w(t - a) da / int K exp(-K a) w(t - a) da.
// A second filter in series tells, also while the force grows; a steady one is 1 / K old.
class Age {
 public:
  void restart(double time) {
    twice_ = {};
    time_ = time;
  }
  // In parts of 1 / K, at most `oldest`.
  double follow(const Vec3& force, double bandwidth, double time, double oldest) {
    const double size2 = dot(force, force);
    if (!(size2 > 0.0)) return 0.0;
    const double keep = std::exp(-bandwidth * std::max(0.0, time - time_));
    twice_ = keep * twice_ + (1.0 - keep) * force;
    time_ = time;
    return std::clamp(dot(twice_, force) / size2, 0.0, oldest);
  }

 private:
  Vec3 twice_;
  double time_ = 0.0;
};

// How restless a hand's force is, as seen: people do not keep a force. No allocation.
class Unrest {
 public:
  // What the variance of each axis of the force grows by [N2/s].
  double rate() const { return rate_; }
  // How many times as large it may be, by what has been seen so far: a wave goes one way for several
  // looks. Of a steady hand nothing is doubted.
  double doubt(double bandwidth, const LocalizerTuning& t) const {
    return rate_ > 0.0 ? calm(seen_ * bandwidth / t.unrest_lasts) : 1.0;
  }
  // A hand of which nothing has been seen may be like another one.
  void expect(double rate) { rate_ = rate; }

  // The force of a sole contact, which each sample tells anew [N], at `time` [s]: `variance` of all its
  // axes [N2], what it is foreseen to change by within 1 / K [N], and what that may err by [N2].
  void follow(const Vec3& force, double variance, const Vec3& foreseen, double doubt, double time,
              double bandwidth, const LocalizerTuning& t) {
    const double passed = time - time_;
    if (time_ >= 0.0 && passed * bandwidth < 1.0 - 1e-6) return;
    if (time_ >= 0.0 && passed * bandwidth < kLost) {
      const Vec3 way = force - foreseen_;
      take(dot(way, way), variance + variance_, passed, t.unrest_memory);
      if (looks_ >= kFew)
        rate_ = moved_ > t.unrest_clear * expected_ ? (moved_ - expected_) / 3.0 : 0.0;
    } else {
      forget();
    }
    time_ = time;
    foreseen_ = force + foreseen;
    variance_ = variance + doubt;
  }

  // What a sample has corrected a force by that is followed beside others [N], and what the square of
  // that was expected to be [N2].
  void correct(const Vec3& by, double expected) {
    corrected_ = corrected_ + by;
    block_ += expected;
  }

  // Concludes from the corrections every 2 / K, over which they are as if independent. Where they are
  // larger than expected the hand is more restless; an axis that nothing tells of says nothing.
  void conclude(double time, double bandwidth, const LocalizerTuning& t) {
    const double passed = time - time_;
    if (time_ >= 0.0 && passed * bandwidth < 2.0 - 1e-6) return;
    if (time_ >= 0.0 && passed * bandwidth < kLost) {
      take(dot(corrected_, corrected_), block_, passed, t.unrest_memory);
      const double ratio = t.unrest_lasts * moved_ / std::max(expected_, 1e-12);
      if (ratio > t.unrest_more) rate_ *= std::min(ratio, t.unrest_step);
      // Few looks may have met a moment of calm: it falls to what they still allow.
      const double most = ratio * calm(seen_ / passed / t.unrest_lasts);
      if (most < 1.0) rate_ *= std::max(most, 1.0 / t.unrest_step);
    } else {
      forget();
    }
    time_ = time;
    corrected_ = {};
    block_ = 0.0;
  }

 private:
  static constexpr double kLost = 4.0;  // times 1 / K: after a longer break it begins anew
  static constexpr int kFew = 2;        // looks

  // How many times as large as its mean over so many independent looks a variance may be (chi-squared
  // by Wilson and Hilferty 1931). Each look tells of two axes at least.
  static double calm(double looks) {
    const double off = 2.0 / (9.0 * 2.0 * std::max(looks, 0.1));
    const double least = 1.0 - off - kCalm * std::sqrt(off);
    return least > 0.0 ? 1.0 / (least * least * least) : std::numeric_limits<double>::infinity();
  }
  static constexpr double kCalm = 1.64;  // sigmas: one mean in twenty is smaller

  void take(double square, double expected, double passed, double memory) {
    seen_ = std::min(seen_ + passed, memory);
    const double news = std::min(1.0, passed / seen_);
    moved_ += (square / passed - moved_) * news;
    expected_ += (expected / passed - expected_) * news;
    ++looks_;
  }

  void forget() {
    moved_ = expected_ = seen_ = 0.0;
    looks_ = 0;
  }

  Vec3 foreseen_, corrected_;
  double rate_ = 0.0, time_ = -1.0, variance_ = 0.0, block_ = 0.0;
  double moved_ = 0.0, expected_ = 0.0, seen_ = 0.0;  // of both the rate [N2/s], over how long [s]
  int looks_ = 0;
};

// Symmetric, of the two tangent coordinates of a place [m2].
struct Spread {
  double a = 0.0, b = 0.0, c = 0.0;  // 00, 01, 11
  double trace() const { return a + c; }
};
inline Spread operator*(double s, const Spread& x) { return {s * x.a, s * x.b, s * x.c}; }
inline Spread operator+(const Spread& x, const Spread& y) {
  return {x.a + y.a, x.b + y.b, x.c + y.c};
}

struct KnownContact {
  int serial = -1, surface = -1, node = -1;
  Vec3 point, normal;  // in the frame of the node; the normal is that of the tangents in use
  Vec3 alike;          // where it was last on a face that is nearly normal to that
  Vec3 force;          // in world [N]
  Spread place;        // in the tangents of `normal`
  Spread lasting;      // of it, by errors that all samples have in common: it gets no smaller
  double lag = 0.0;    // how old that is which the force speaks of [s]
  Age age;
  Unrest unrest;
  // How much of a force that has changed the filter does not show yet [N]. After a step at x = K t
  // what is still to come is exp(-x), and the age falls short of 1 / K by x times that.
  double coming(double bandwidth) const {
    const double y = std::fabs(1.0 - bandwidth * lag);
    if (!(y > 1e-9)) return 0.0;
    const double least = std::max(0.0, -std::log(y));
    return norm(force) * y / std::max(1.0, least + std::log(least + 1.2));
  }
  // What it is foreseen to change by in a time [s]: along its own direction.
  Vec3 foreseen(double passed, double bandwidth) const {
    const double way = bandwidth * lag < 1.0 ? 1.0 : -1.0;  // what has grown is young
    const double change = way * coming(bandwidth) * (1.0 - std::exp(-bandwidth * passed));
    return (change / std::max(norm(force), 1e-9)) * force;
  }
  std::optional<double> gone;  // since when there is no force [s]
  // What was said when it was found: its other explanations keep their places on their links.
  Status status = Status::located;
  double body_probability = 1.0;
  int rank = 0, unknowns = 0;
  int count = 0;
  struct Other {
    int surface, node;
    Vec3 point;  // in the frame of the node
    double weight;
  } others[Answer::kCandidates];
};

// Takes over what was said of a contact at one instant.
inline void keep(const Answer& answer, const LinkSurfaces& surfaces, KnownContact& known) {
  const Candidate& best = answer.candidates[0];
  known.surface = best.surface;
  known.node = surfaces[best.surface].node;
  known.point = surfaces.to_node(best.point, known.node);
  known.normal = surfaces.turn_to_node(best.normal, known.node);
  known.alike = known.point;
  known.force = best.fit.force;
  known.status = answer.status;
  known.body_probability = answer.body_probability;
  known.rank = answer.rank;
  known.unknowns = answer.unknowns;
  known.count = answer.count;
  for (int i = 0; i < answer.count; ++i) {
    const Candidate& k = answer.candidates[i];
    const int node = surfaces[k.surface].node;
    known.others[i] = {k.surface, node, surfaces.to_node(k.point, node), k.weight};
  }
  // The covariance, in the tangents of the node's frame.
  Vec3 world[2], own[2];
  tangents(best.normal, world[0], world[1]);
  tangents(known.normal, own[0], own[1]);
  double turn[2][2];
  for (int i = 0; i < 2; ++i) {
    const Vec3 along = surfaces.turn_to_world(own[i], known.node);
    for (int k = 0; k < 2; ++k) turn[i][k] = dot(along, world[k]);
  }
  const auto element = [&](int i, int k) {
    return turn[i][0] * (best.along[0] * turn[k][0] + best.along[1] * turn[k][1]) +
           turn[i][1] * (best.along[1] * turn[k][0] + best.along[2] * turn[k][1]);
  };
  known.place = {element(0, 0), element(0, 1), element(1, 1)};
  known.lasting = answer.lasting * known.place;
}

// A contact of that number, at the place where it has been found.
inline KnownContact found_contact(int serial, const Answer& answer, const LinkSurfaces& surfaces,
                                  const Age& age, double lag) {
  KnownContact known;
  keep(answer, surfaces, known);
  known.serial = serial;
  known.age = age;
  known.lag = lag;
  return known;
}

// What is said of a known contact now.
inline void report(const KnownContact& known, const LinkSurfaces& surfaces, Answer& answer) {
  answer = Answer{};
  answer.status = known.status;
  answer.body_probability = known.body_probability;
  answer.force = known.force;
  answer.rank = known.rank;
  answer.unknowns = known.unknowns;
  answer.count = std::max(known.count, 1);
  for (int i = 0; i < known.count; ++i) {
    const KnownContact::Other& other = known.others[i];
    Candidate& k = answer.candidates[i];
    k.surface = other.surface;
    k.point = surfaces.to_world(other.point, other.node);
    k.weight = other.weight;
  }
  Candidate& best = answer.candidates[0];
  best.surface = known.surface;
  best.point = surfaces.to_world(known.point, known.node);
  best.normal = surfaces.turn_to_world(known.normal, known.node);
  best.fit.force = known.force;
  if (known.count == 0) best.weight = 1.0;
  best.along[0] = known.place.a;
  best.along[1] = known.place.b;
  best.along[2] = known.place.c;
  Vec3 own[2];
  tangents(known.normal, own[0], own[1]);
  const Vec3 s = surfaces.turn_to_world(own[0], known.node);
  const Vec3 t = surfaces.turn_to_world(own[1], known.node);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) {
      const double si = component(s, i), sj = component(s, j);
      const double ti = component(t, i), tj = component(t, j);
      answer.covariance[3 * i + j] = known.place.a * si * sj +
                                     known.place.b * (si * tj + ti * sj) + known.place.c * ti * tj;
    }
  }
  answer.spread = std::sqrt(known.place.trace());
  answer.lasting = std::min(1.0, known.lasting.trace() / known.place.trace());
}

inline bool placed(const Answer& a) {
  return a.status == Status::located || a.status == Status::ambiguous;
}

// Do the places of a contact that is known and of the answer at hand agree within their spread?
inline bool agrees(const KnownContact& known, const Answer& a, const LinkSurfaces& surfaces,
                   const LocalizerTuning& t) {
  if (!placed(a)) return false;
  const Vec3 p = surfaces.to_world(known.point, known.node);
  for (int i = 0; i < a.count; ++i) {
    const Candidate& c = a.candidates[i];
    const double sigma = std::sqrt(c.along[0] + c.along[2] + known.place.trace());
    if (c.surface == known.surface &&
        norm(c.point - p) < std::max(t.same_place, t.agree_sigmas * sigma))
      return true;
  }
  return false;
}

// One of several is located where its region holds nine tenths of the probability within the radius of
// a place. A long region then holds 0.90 there, a round one 0.93. Its variance may be `doubt` times as large.
inline void doubt_if_wide(Answer& a, const LocalizerSettings& t, double doubt = 1.0) {
  constexpr double kNinety = 1.645;  // sigmas of a normal variable that hold nine tenths
  if (a.status == Status::located && !(kNinety * std::sqrt(doubt) * a.spread < t.place_radius))
    a.status = Status::ambiguous;
}

// Can a contact that is known have slid `way` [m] at most to where it is found?
inline bool within_reach(const KnownContact& known, const Answer& a, const LinkSurfaces& surfaces,
                         double way, const LocalizerTuning& t) {
  if (!placed(a)) return false;
  const Candidate& best = a.candidates[0];
  const double sigma = std::sqrt(best.along[0] + best.along[2] + known.place.trace());
  return surfaces[best.surface].node == known.node &&
         norm(best.point - surfaces.to_world(known.point, known.node)) <
             way + t.agree_sigmas * sigma;
}

// Does what is said beside a known contact take its force back, along its own line if it has one?
// What would hold against a contact there, and no harder, cannot be told from
// its letting go.
inline bool takes_back(const KnownContact& known, const Answer& a, const LinkSurfaces& surfaces,
                       const LocalizerSettings& t) {
  const double size = norm(known.force), back = norm(a.force);
  if (!(dot(known.force, a.force) < -t.back_straight * size * back &&
      back < t.back_most * size)) return false;
  const Vec3 way = a.candidates[0].point - surfaces.to_world(known.point, known.node);
  const double along = dot(way, known.force) / size;
  const double near = std::max(t.place_radius, t.agree_sigmas * a.spread);
  return !placed(a) || norm(way - (along / size) * known.force) < near;
}

}  // namespace touchline
