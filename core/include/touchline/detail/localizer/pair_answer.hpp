// SPDX-License-Identifier: Apache-2.0
// What is said of two contacts that began at the same instant: two places, or the parts of the
// links that may be touched. No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/localizer/pair_parts.hpp"
#include "touchline/detail/place/answer.hpp"

namespace touchline {

class PairAnswer {
 public:
  PairAnswer(const LinkSurfaces& surfaces, const LocalizerSettings& settings)
      : surfaces_(surfaces), settings_(settings) {}

  // Are there two places that can be told apart?
  bool separable(const PairSearch& pairs) const {
    if (pairs.count() == 0 || pairs[0].rank < PairSearch::kUnknowns) return false;
    double enough = 0.0;  // probability of pairs that can be told apart
    for (int i = 0; i < pairs.count(); ++i)
      enough += pairs[i].rank >= PairSearch::kUnknowns ? pairs[i].weight : 0.0;
    return enough >= kSeparable &&
           pairs[0].chi2 < chi2_limit(degrees(pairs), settings_.pitch_limit);
  }

  // What is said of one contact of the best pair, with its places in the other solutions.
  void name(const PairSearch& pairs, int k, Answer& answer) const {
    const Pair& best = pairs[0];
    answer = Answer{};
    double here = 0.0;
    for (int i = 0; i < pairs.count(); ++i) {
      const Pair& s = pairs[i];
      add(answer, now(s.ends[k], pairs.view()), s.weight);
      const bool same = s.ends[0].node == best.ends[0].node && s.ends[1].node == best.ends[1].node;
      if (same && norm(s.ends[0].point - best.ends[0].point) < settings_.place_radius &&
          norm(s.ends[1].point - best.ends[1].point) < settings_.place_radius)
        here += s.weight;
      if (s.ends[k].node == best.ends[k].node) answer.body_probability += s.weight;
    }
    double spread = 0.0;
    for (const PairEnd& e : best.ends)
      spread = std::max(spread, std::sqrt(e.along[0] + e.along[2]));
    const bool sure = here >= kSure && spread < settings_.spread_limit();
    answer.status = sure ? Status::located : Status::ambiguous;
    answer.chi2 = best.chi2;
    answer.degrees = degrees(pairs);
    if (best.rank > PairSearch::kUnknowns) return;
    answer.rank = best.rank;  // none is left over, that would speak against a third contact
    answer.unknowns = PairSearch::kUnknowns;
  }

  // All that may be touched, where the contacts cannot be told apart: as a first look has it.
  void name_all(const PairSearch& pairs, Answer& a) {
    begin(pairs.count() > 0 ? pairs[0].rank : 0, 2, a);
    pairs.starts().regions([&](int surface, const Vec3& point, double cost, double reach) {
      add(surface, surfaces_.to_world(point, surfaces_[surface].node), cost, reach);
    });
    gather(a);
  }

  // The same, as a walk over all that explains has it.
  void name_all(const PairParts& parts, Answer& a) {
    begin(parts.rank(), 2, a);
    for (int i = 0; i < parts.count(); ++i) {
      const PairParts::Part& part = parts[i];
      if (!parts.explains(part)) continue;
      const Vec3 point = surfaces_.to_world(part.point, surfaces_[part.surface].node);
      add(part.surface, point, part.cost, parts.reach());
    }
    gather(a);
  }

  // No two contacts explain: three at least. Nothing is known of their places.
  void name_none(const PairSearch& pairs, Answer& a) { begin(pairs.view().most_rank(), 3, a); }

 private:
  static constexpr double kSeparable = 0.9;  // probability of pairs that are told apart
  static constexpr double kSure = 0.95;      // and of one that is located
  static constexpr int kCells = 512;
  static constexpr int kEach = 5;   // unknowns of each contact
  static constexpr int kTurns = 3;  // of regions that share cells out among them

  // Part of a link that may be touched, and the region that it belongs to.
  struct Cell {
    int surface;
    Vec3 point;
    double cost, reach;  // how far around it [m]
    int region;
    double square;  // of the distance from its centre [m2]
  };

  static int degrees(const PairSearch& pairs) {
    return std::max(1, pairs.view().rows() - PairSearch::kUnknowns);
  }

  // An end of a pair, to where its body is now.
  PairEnd now(PairEnd e, const PairView& then) const {
    e.point = surfaces_.to_world(then.to_body(e.point, e.body), e.node);
    e.normal = surfaces_.turn_to_world(then.turn_to_body(e.normal, e.body), e.node);
    return e;
  }

  void begin(int rank, int contacts, Answer& a) {
    a.status = Status::not_separable;
    a.count = cells_ = 0;
    a.rank = rank;
    a.unknowns = kEach * contacts;
    least_ = std::numeric_limits<double>::infinity();
  }

  void add(int surface, const Vec3& point, double cost, double reach) {
    if (cells_ == kCells) return;
    cell_[cells_++] = {surface, point, cost, reach, -1, std::numeric_limits<double>::infinity()};
    least_ = std::min(least_, cost);
  }

  // One region for each link, then the widest ones in two.
  void gather(Answer& a) {
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region < 0 && a.count < Answer::kCandidates) centre(a, i);
    }
    while (a.count > 0 && a.count < Answer::kCandidates) {
      const int far = farthest();
      if (far < 0) break;
      centre(a, far);
    }
    for (int turn = 0; turn < kTurns; ++turn) {
      for (int k = 0; k < a.count; ++k) recentre(a, k);
      for (int i = 0; i < cells_; ++i) cell_[i].square = std::numeric_limits<double>::infinity();
      for (int k = 0; k < a.count; ++k) join(a, k);
    }
    weigh(a);
  }

  // To the cell from which it is not far to any other of its region.
  void recentre(Answer& a, int region) {
    int count = 0;
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region == region) members_[count++] = i;
    }
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < count; ++i) {
      const Vec3& point = cell_[members_[i]].point;
      double far = 0.0;
      for (int j = 0; j < count && far < least; ++j)
        far = std::max(far, squared_distance(cell_[members_[j]].point, point));
      if (!(far < least)) continue;
      least = far;
      a.candidates[region].point = point;
    }
  }

  // A new region about a cell.
  void centre(Answer& a, int cell) {
    Candidate& k = a.candidates[a.count++];
    k = Candidate{};
    k.surface = cell_[cell].surface;
    k.point = cell_[cell].point;
    join(a, a.count - 1);
  }

  // The cell farthest from the centre of its region; -1 where all are near enough.
  int farthest() const {
    int far = -1;
    double most = settings_.place_radius * settings_.place_radius;
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region < 0 || !(cell_[i].square > most)) continue;
      most = cell_[i].square;
      far = i;
    }
    return far;
  }

  // Gives a region the cells of its link that are nearer to it than to theirs.
  void join(const Answer& a, int region) {
    const Candidate& k = a.candidates[region];
    for (int i = 0; i < cells_; ++i) {
      Cell& cell = cell_[i];
      if (cell.surface != k.surface) continue;
      const double square = squared_distance(k.point, cell.point);
      if (square > cell.square) continue;
      cell.square = square;
      cell.region = region;
    }
  }

  static double squared_distance(const Vec3& a, const Vec3& b) {
    const Vec3 way = a - b;
    return dot(way, way);
  }

  // What each region stands for: how far it reaches, and how likely it is.
  void weigh(Answer& a) const {
    double sum = 0.0;
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region < 0) continue;
      Candidate& k = a.candidates[cell_[i].region];
      k.radius = std::max(k.radius, std::sqrt(cell_[i].square) + cell_[i].reach);
      const double weight = std::exp(0.5 * (least_ - cell_[i].cost));
      k.weight += weight;
      sum += weight;
    }
    for (int k = 0; k < a.count; ++k) a.candidates[k].weight /= sum;
  }

  static void add(Answer& a, const PairEnd& e, double weight) {
    for (int i = 0; i < a.count; ++i) {
      Candidate& k = a.candidates[i];
      if (k.surface != e.surface || norm(k.point - e.point) > 5e-3) continue;
      k.weight += weight;
      return;
    }
    if (a.count == Answer::kCandidates) return;
    Candidate& k = a.candidates[a.count++];
    k = Candidate{};
    k.surface = e.surface;
    k.point = e.point;
    k.normal = e.normal;
    k.fit.force = e.force;
    k.weight = weight;
    std::copy(e.along, e.along + 3, k.along);
  }

  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  Cell cell_[kCells];
  int members_[kCells];
  int cells_ = 0;
  double least_ = 0.0;
};

}  // namespace touchline
