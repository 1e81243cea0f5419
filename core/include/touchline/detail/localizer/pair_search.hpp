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
#include "touchline/detail/localizer/segment_contacts.hpp"
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

  // Begins with what `measurement` has read of the segment in the sample of `now`.
  void begin(const SegmentSample& now, const Measurement& measurement) {
    drop();
    searched_ = view_.take(now.lag, measurement);
    begun_ = seen_ = now.time;
    descended_ = 0;
    stage_ = searched_ ? Stage::starts : Stage::done;
    if (searched_) starts_.begin(view_);
  }
  void drop() {
    stage_ = Stage::none;
    count_ = next_ = 0;
    descent_.drop();
    starts_.clear();
  }
  bool working() const { return stage_ != Stage::none && stage_ != Stage::done; }
  // Is there an outcome? The solutions are those that explain, the most probable first.
  bool done() const { return stage_ == Stage::done; }

  // Goes on for about so many units of work (`LocalizerTuning::pair_work`), in the sample of `now`.
  void work(int units, const SegmentSample& now, const Measurement& measurement) {
    while (working() && units > 0) units -= work_on_stage(units, now, measurement);
  }

  // When it was that the outcome speaks of [s].
  double seen() const { return seen_; }
  // When it began [s].
  double begun() const { return begun_; }
  int count() const { return count_; }
  const Pair& operator[](int i) const { return solutions_[i]; }
  // Would two contacts have been found, if there were any?
  bool exhaustive() const { return searched_ && view_.has_wrench(); }
  // What was searched, and where it began.
  const PairView& view() const { return view_; }
  const PairStarts& starts() const { return starts_; }

 private:
  static constexpr int kSteps = 24;        // of a refinement
  static constexpr double kSame = 0.01;    // solutions nearer than this are one [m]
  static constexpr double kWindow = 25.0;  // of cost: beyond it a solution weighs nothing
  static constexpr double kHopeless = 100.0;  // cost from which nothing is brought to where it explains
  static constexpr double kLittle = 0.02;     // of cost: not worth a step
  static constexpr double kEver = std::numeric_limits<double>::infinity();  // any cost may still fall

  static constexpr int kCold = 1000;  // units of descents after which caches have the meshes
  // Units of work, as measured: the beginning of a descent; where a force enters its body; the evidence of
  // a solution; another view.
  static constexpr int kBegin = 20, kEntries = 60, kWeight = 100, kView = 150;

  // From points spread over the links, by descents, to solutions. What was measured in the meantime
  // moves them a little; with other entries of their forces they are weighed by that.
  enum class Stage { none, starts, descents, renewals, entries, weights, done };

  void enter(Stage stage) {
    stage_ = stage;
    next_ = 0;
  }

  // One part of the stage at hand; its units of work.
  int work_on_stage(int units, const SegmentSample& now, const Measurement& measurement) {
    switch (stage_) {
      case Stage::starts: {
        const int done = starts_.work(units);
        if (!starts_.working()) enter(Stage::descents);
        return done;
      }
      case Stage::descents:
        if (descent_.working() || next_ < starts_.count()) return descend(units, starts_);
        if (now.time == seen_) {
          begin_entries();
          return 0;
        }
        renew(now, measurement);
        return kView;
      case Stage::renewals:
        if (descent_.working() || next_ < renewed_) return descend(units, former_);
        begin_entries();
        return 0;
      case Stage::entries:
        if (next_ < entered_) {
          enter_elsewhere(solutions_[next_++]);
          return kEntries;
        }
        enter(Stage::weights);
        return 0;
      case Stage::weights:
        if (next_ < count_) {
          weigh(solutions_[next_++]);
          return kWeight;
        }
        conclude();
        enter(Stage::done);
        return kWeight;
      case Stage::none:
      case Stage::done:
        break;
    }
    return 0;
  }

  // Goes on from the pair at hand, or begins with the next one.
  template <class Pairs>
  int descend(int units, const Pairs& from) {
    if (!descent_.working()) {
      descent_.begin(from[next_++], {kSteps, kHopeless, kLittle, kEver}, false);
      return kBegin;
    }
    const int done = descent_.work(units);
    const Pair& s = descent_.pair();
    if (!descent_.working() && s.cost < chi2_limit(view_.rows(), settings_.pitch_limit) + kWindow)
      add(s);
    // What no cache has yet takes as long again.
    const int cold = std::min(done, kCold - descended_);
    descended_ += cold;
    return done + cold;
  }

  // From now on by what is measured now.
  void renew(const SegmentSample& now, const Measurement& measurement) {
    renewed_ = count_;
    for (int i = 0; i < count_; ++i) {
      former_[i] = solutions_[i];
      view_.to_bodies(former_[i]);
    }
    count_ = 0;
    searched_ = view_.take(now.lag, measurement);
    seen_ = now.time;
    enter(searched_ ? Stage::renewals : Stage::done);
    for (int i = 0; i < renewed_; ++i) view_.to_world(former_[i]);
  }

  void begin_entries() {
    entered_ = count_;
    enter(Stage::entries);
  }

  // Where the line of either force enters its body elsewhere, it explains as well.
  void enter_elsewhere(const Pair& s) {
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

  // Log of the evidence of a solution (Laplace).
  void weigh(Pair& s) {
    double H[kUnknowns * kUnknowns], g[kUnknowns];
    fit_.information(s, H, g, false);
    s.weight = -std::numeric_limits<double>::infinity();
    if (!cholesky(H, kUnknowns)) return;
    s.weight = -0.5 * (s.cost + log_determinant(H, kUnknowns));
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = s.ends[k];
      const double cosine = -dot(e.normal, e.force) / std::max(norm(e.force), 1e-9);
      s.weight += std::log(std::max(cosine, 0.02)) +
                  approach(surfaces_, e.point, e.force, settings_);
      spread_of(H, 6 + 2 * k, s.ends[k].along);
    }
    s.rank = view_.rank(s.ends[0].body, s.ends[1].body);
  }

  // From the evidence to probabilities, the most probable first.
  void conclude() {
    double most = -std::numeric_limits<double>::infinity(), sum = 0.0;
    for (int i = 0; i < count_; ++i) most = std::max(most, solutions_[i].weight);
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
  Pair solutions_[kSolutions], former_[kSolutions];
  int count_ = 0;
  // Where the work is: which of that stage's, and how many solutions it began with.
  Stage stage_ = Stage::none;
  int next_ = 0, renewed_ = 0, entered_ = 0;
  int descended_ = 0;  // units of descents, as far as they are cold
  double begun_ = 0.0, seen_ = 0.0;
  bool searched_ = false;
};

}  // namespace touchline
