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
  explicit PairAnswer(const LocalizerSettings& settings) : settings_(settings) {}

  // Are there two places that can be told apart?
  bool separable(const PairSearch& pairs, int rows) const {
    if (pairs.count() == 0 || pairs[0].rank < PairSearch::kUnknowns) return false;
    double enough = 0.0;  // probability of pairs that can be told apart
    for (int i = 0; i < pairs.count(); ++i)
      enough += pairs[i].rank >= PairSearch::kUnknowns ? pairs[i].weight : 0.0;
    return enough >= kSeparable &&
           pairs[0].chi2 < chi2_limit(std::max(1, rows - PairSearch::kUnknowns), settings_.pitch_limit);
  }

  // What is said of one contact of the best pair, with its places in the other solutions.
  void name(const PairSearch& pairs, int k, int rows, Answer& answer) const {
    const Pair& best = pairs[0];
    answer = Answer{};
    double here = 0.0;
    for (int i = 0; i < pairs.count(); ++i) {
      const Pair& s = pairs[i];
      add(answer, s.ends[k], s.weight);
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
    answer.degrees = std::max(1, rows - PairSearch::kUnknowns);
    if (best.rank > PairSearch::kUnknowns) return;
    answer.rank = best.rank;  // none is left over, that would speak against a third contact
    answer.unknowns = PairSearch::kUnknowns;
  }

  // All that may be touched, where the contacts cannot be told apart: as a first look has it.
  void name_all(const PairSearch& pairs, Answer& a) {
    begin(pairs.count() > 0 ? pairs[0].rank : 0, 2, a);
    pairs.starts().regions([&](int surface, const Vec3& point, double cost, double reach) {
      add(surface, point, cost, reach);
    });
    gather(a);
  }

  // The same, as a walk over all that explains has it.
  void name_all(const PairParts& parts, const LinkSurfaces& surfaces, Answer& a) {
    begin(parts.rank(), 2, a);
    for (int i = 0; i < parts.count(); ++i) {
      const PairParts::Part& part = parts[i];
      if (!parts.explains(part)) continue;
      const Vec3 point = surfaces.to_world(part.point, surfaces[part.surface].node);
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
  };

  void begin(int rank, int contacts, Answer& a) {
    a.status = Status::not_separable;
    a.count = cells_ = 0;
    a.rank = rank;
    a.unknowns = kEach * contacts;
    least_ = std::numeric_limits<double>::infinity();
  }

  void add(int surface, const Vec3& point, double cost, double reach) {
    if (cells_ == kCells) return;
    cell_[cells_++] = {surface, point, cost, reach, -1};
    least_ = std::min(least_, cost);
  }

  // One region for each link, then the widest ones in two.
  void gather(Answer& a) {
    for (int i = 0; i < cells_ && a.count < Answer::kCandidates; ++i) {
      bool known = false;
      for (int k = 0; k < a.count; ++k) known = known || a.candidates[k].surface == cell_[i].surface;
      if (!known) centre(a, i);
    }
    assign(a);
    while (a.count > 0 && a.count < Answer::kCandidates) {
      const int far = farthest(a);
      if (far < 0) break;
      centre(a, far);
      assign(a);
    }
    for (int turn = 0; turn < kTurns; ++turn) {
      for (int k = 0; k < a.count; ++k) recentre(a, k);
      assign(a);
    }
  }

  // To the cell from which it is not far to any other of its region.
  void recentre(Answer& a, int region) {
    double least = std::numeric_limits<double>::infinity();
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region != region) continue;
      double far = 0.0;
      for (int j = 0; j < cells_ && far < least; ++j) {
        if (cell_[j].region == region) far = std::max(far, norm(cell_[j].point - cell_[i].point));
      }
      if (!(far < least)) continue;
      least = far;
      a.candidates[region].point = cell_[i].point;
    }
  }

  void centre(Answer& a, int cell) {
    Candidate& k = a.candidates[a.count++];
    k = Candidate{};
    k.surface = cell_[cell].surface;
    k.point = cell_[cell].point;
  }

  // The cell farthest from the centre of its region; -1 where all are near enough.
  int farthest(const Answer& a) const {
    int far = -1;
    double most = settings_.place_radius;
    for (int i = 0; i < cells_; ++i) {
      if (cell_[i].region < 0) continue;
      const double distance = norm(cell_[i].point - a.candidates[cell_[i].region].point);
      if (distance > most) {
        most = distance;
        far = i;
      }
    }
    return far;
  }

  // Gives each cell to the nearest region of its link.
  void assign(Answer& a) {
    double sum = 0.0;
    for (int k = 0; k < a.count; ++k) a.candidates[k].weight = a.candidates[k].radius = 0.0;
    for (int i = 0; i < cells_; ++i) {
      double least = std::numeric_limits<double>::infinity();
      cell_[i].region = -1;
      for (int k = 0; k < a.count; ++k) {
        const double distance = norm(a.candidates[k].point - cell_[i].point);
        if (a.candidates[k].surface != cell_[i].surface || distance > least) continue;
        least = distance;
        cell_[i].region = k;
      }
      if (cell_[i].region < 0) continue;
      Candidate& k = a.candidates[cell_[i].region];
      k.radius = std::max(k.radius, least + cell_[i].reach);
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

  const LocalizerSettings& settings_;
  Cell cell_[kCells];
  int cells_ = 0;
  double least_ = 0.0;
};

}  // namespace touchline
