// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant: the best pairs of points, moved over
// the surfaces to where they explain best, weighed by their evidence. Whether they can be told
// apart follows from the volume that explains as well: where the equations do not suffice (theory:
// 6 and one per instrumented joint between the two, of 10) it is large, and so is the weight of
// such an explanation. No allocation per search.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/localizer/pair_descent.hpp"
#include "touchline/detail/localizer/pair_starts.hpp"
#include "touchline/detail/place/approach.hpp"

namespace touchline {

class PairSearch {
 public:
  static constexpr int kSolutions = 48, kUnknowns = PairFit::kUnknowns;

  // On segment g.
  PairSearch(const Posture& posture, const LinkSurfaces& surfaces,
             const LocalizerSettings& settings, std::size_t rows, int g)
      : surfaces_(surfaces),
        settings_(settings),
        view_(posture, surfaces, rows, g),
        fit_(view_, settings),
        descent_(view_, fit_),
        starts_(surfaces, settings, g) {}

  // Searches what `measurement` has read of the segment, and whose rows are `lag` [s] old. The
  // solutions are those that explain, the most probable first.
  void search(double lag, const Measurement& measurement) {
    count_ = 0;
    starts_.clear();
    searched_ = view_.take(lag, measurement);
    if (!searched_) return;
    starts_.begin(view_);
    while (starts_.working()) starts_.work(kAll);
    for (int i = 0; i < starts_.count(); ++i) refine(starts_[i]);
    for (int i = 0, n = count_; i < n; ++i) enter(solutions_[i]);
    weigh();
  }

  int count() const { return count_; }
  const Pair& operator[](int i) const { return solutions_[i]; }
  // Would two contacts have been found, if there were any?
  bool exhaustive() const { return searched_ && view_.has_wrench(); }
  // What was searched, and where it began.
  const PairView& view() const { return view_; }
  const PairStarts& starts() const { return starts_; }

 private:
  static constexpr int kSteps = 24;        // of a refinement
  static constexpr int kAll = std::numeric_limits<int>::max();  // of the work on starts
  static constexpr double kSame = 0.01;    // solutions nearer than this are one [m]
  static constexpr double kWindow = 25.0;  // of cost: beyond it a solution weighs nothing
  static constexpr double kHopeless = 1e5;  // cost after a third of the steps

  void refine(const Pair& start) {
    descent_.begin(start, kSteps, kHopeless, false);
    while (descent_.working()) descent_.work(kSteps);
    const Pair& s = descent_.pair();
    if (s.cost < chi2_limit(view_.rows(), settings_.pitch_limit) + kWindow) add(s);
  }

  // Where the line of either force enters its body elsewhere, it explains as well.
  void enter(const Pair& s) {
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = s.ends[k];
      const double size = norm(e.force);
      if (size < settings_.least_force) continue;
      const ForceLine line{e.point, (1.0 / size) * e.force};
      for (int own : surfaces_.bodies(view_.segment())[e.body].surfaces) {
        surfaces_.entries(own, line, [&](int surface, const Vec3& point, const Vec3& normal,
                                         double t) {
          if (std::fabs(t) < kSame) return;
          Pair other = s;
          other.ends[k].surface = surface;
          other.ends[k].place = -1;
          other.ends[k].point = point;
          other.ends[k].normal = normal;
          fit_.solve_forces(other, false);
          if (other.cost < s.cost + kWindow) add(other);
        });
      }
    }
  }

  void add(const Pair& s) {
    for (int i = 0; i < count_; ++i) {
      Pair& o = solutions_[i];
      const bool same = o.ends[0].surface == s.ends[0].surface &&
                        o.ends[1].surface == s.ends[1].surface && near(o, s, kSame);
      if (!same) continue;
      if (s.cost < o.cost) o = s;
      return;
    }
    if (count_ < kSolutions) solutions_[count_++] = s;
  }

  // Evidence of each solution (Laplace), then probabilities. Where the equations do not suffice the
  // solutions of two bodies are parts of one: only the best of them counts in full.
  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < count_; ++i) {
      Pair& s = solutions_[i];
      double H[kUnknowns * kUnknowns], g[kUnknowns];
      fit_.information(s, H, g, false);
      s.weight = -std::numeric_limits<double>::infinity();
      if (!cholesky(H, kUnknowns)) continue;
      s.weight = -0.5 * (s.cost + log_determinant(H, kUnknowns));
      for (int k = 0; k < 2; ++k) {
        const PairEnd& e = s.ends[k];
        const double cosine = -dot(e.normal, e.force) / std::max(norm(e.force), 1e-9);
        s.weight += std::log(std::max(cosine, 0.02)) +
                    approach(surfaces_, e.point, e.force, settings_);
        spread_of(H, 6 + 2 * k, s.ends[k].along);
      }
      s.rank = view_.rank(s.ends[0].body, s.ends[1].body);
      most = std::max(most, s.weight);
    }
    double sum = 0.0;
    for (int i = 0; i < count_; ++i) sum += solutions_[i].weight = std::exp(solutions_[i].weight - most);
    for (int i = 0; i < count_; ++i) solutions_[i].weight /= sum;
    std::sort(solutions_, solutions_ + count_,
              [](const Pair& a, const Pair& b) { return a.weight > b.weight; });
  }

  static void spread_of(const double* L, int i, double* out) {
    for (int k = 0; k < 2; ++k) {
      double x[kUnknowns] = {};
      x[i + k] = 1.0;
      solve_cholesky(L, kUnknowns, x);
      if (k == 0) out[0] = x[i];
      out[k + 1] = x[i + 1];
    }
  }

  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  PairView view_;
  PairFit fit_;
  PairDescent descent_;
  PairStarts starts_;
  Pair solutions_[kSolutions];
  int count_ = 0;
  bool searched_ = false;
};

}  // namespace touchline
