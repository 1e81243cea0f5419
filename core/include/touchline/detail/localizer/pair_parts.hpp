// SPDX-License-Identifier: Apache-2.0
// Where two contacts may be that cannot be told apart: a walk over the pairs of points that explain,
// from wherever a search began. It works on the view of one sample, by parts: its outcome does not
// depend on how it is spread over samples. No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "touchline/detail/localizer/pair_descent.hpp"
#include "touchline/detail/localizer/pair_search.hpp"

namespace touchline {

class PairParts {
 public:
  static constexpr int kMost = 64;  // room: parts

  // A point that is one of a pair that explains, in the frame of its node.
  struct Part {
    int surface;
    Vec3 point;
    double cost, cone;  // of the pair, and what of it is for being beyond the friction cones
  };

  PairParts(const PairView& view, const LocalizerSettings& settings)
      : settings_(settings), view_(view), fit_(view_, settings), descent_(view_, fit_) {
    waiting_.resize(kWaiting);
  }
  PairParts(const PairParts&) = delete;
  PairParts& operator=(const PairParts&) = delete;

  // Begins from the outcome of a search, with what `measurement` has read in the sample of `now`. The
  // search stays as it is while this works.
  void begin(const PairSearch& search, const SegmentSample& now, const Measurement& measurement) {
    drop();
    if (!view_.take(now.lag, measurement)) return;
    search_ = &search;
    limit_ = chi2_limit(view_.rows(), settings_.pitch_limit);
    rank_ = search.count() > 0 ? search[0].rank : 0;
    best_ = cone_ = std::numeric_limits<double>::infinity();
    apart_ = kApart;
    count_ = next_solution_ = next_start_ = 0;
    stage_ = Stage::walks;
  }

  void drop() {
    stage_ = Stage::none;
    head_ = waits_ = 0;
    descent_.drop();
  }
  bool working() const { return stage_ == Stage::walks; }
  // Is there an outcome?
  bool done() const { return stage_ == Stage::done; }

  // Goes on for about so many units of work (`LocalizerTuning::pair_work`).
  void work(int units) {
    while (working() && units > 0) {
      if (descent_.working()) {
        units -= descent_.work(units);
        if (!descent_.working()) units -= take(descent_.pair());
      } else {
        units -= begin_next();
      }
    }
  }

  int rank() const { return rank_; }    // of the best pair
  // What the walk has met, and how far around each there may be more [m].
  int count() const { return count_; }
  const Part& operator[](int i) const { return parts_[i]; }
  double reach() const { return std::max(kReach, kWide * apart_); }
  // Is it one of a pair that explains as well as the best, within the noise?
  bool explains(const Part& part) const {
    return part.cost < best_ + kWindow && part.cone < cone_ + kTold;
  }

 private:
  static constexpr int kWaiting = 4096, kSteps = 12;  // room: pairs that wait; steps of each
  // Units of work, as measured: the beginning of a descent; of passing by what is known; and of a place
  // that is looked into for a neighbour, where no cache has it.
  static constexpr int kBegin = 25, kPassedBy = 3, kLooked = 2;
  static constexpr double kHopeless = 100.0;  // cost from which nothing is brought to where it explains
  static constexpr double kLittle = 2.0;      // of cost: a part is told by its place, not by its cost
  static constexpr double kSoon = 5e4;        // cost of a beginning from which it soon explains
  static constexpr double kWindow = 13.0;     // of cost: 99 % of chi2 with four degrees of freedom
  // Cost of the cones through which a walk goes on, and which still tells: faces are flat where
  // links are round.
  static constexpr double kPassed = 16.0, kTold = 4.0;
  static constexpr double kApart = 0.02;    // parts nearer than this are one [m]
  static constexpr double kStride = 0.034;  // from one to the next [m]
  // So near to a part, in parts of what they are apart, a walk need not go: what else goes with it is
  // met by way of its other end.
  static constexpr double kBeside = 1.0;
  // And a start, which stands for all around it.
  static constexpr double kWithin = 0.5;
  static constexpr double kReach = 0.03;  // around each part there may be more, at least so far [m]
  static constexpr double kWider = 1.5;  // each time there are too many parts
  static constexpr double kWide = 1.5;   // times what parts are apart: between them there are more

  struct Task {
    Pair pair;
    int held;  // the end that is to stay where it is; -1: neither
  };

  enum class Stage { none, walks, done };

  // The next pair to descend from: solutions, then starts, then what is beside those that explain. The
  // units of work of it.
  int begin_next() {
    Task task;
    task.held = -1;
    if (next_solution_ < search_->count()) {
      task.pair = moved((*search_)[next_solution_++]);
    } else if (search_->starts().plausible(next_start_, task.pair, task.held)) {
      task.pair = moved(task.pair);
      if (is_known(task.pair.ends[task.held], kWithin * apart_)) return kPassedBy;
    } else if (waits_ > 0) {
      task = waiting_[head_];
      head_ = (head_ + 1) % kWaiting;
      --waits_;
      if (is_known(task.pair.ends[task.held], kBeside * apart_)) return kPassedBy;
    } else {
      stage_ = Stage::done;
      return kPassedBy;
    }
    descent_.begin(task.pair, {kSteps, kHopeless, kLittle, kSoon}, true, task.held);
    return kBegin;
  }

  // Has a pair been met that explains, one end of which is so near [m]?
  bool is_known(const PairEnd& e, double distance) const {
    const Vec3 point = view_.to_body(e.point, e.body);
    for (int i = 0; i < count_; ++i) {
      const Vec3 way = parts_[i].point - point;
      if (parts_[i].surface == e.surface && explains(parts_[i]) && dot(way, way) < distance * distance)
        return true;
    }
    return false;
  }

  // To where its bodies are in this view.
  Pair moved(Pair s) const {
    search_->view().to_bodies(s);
    view_.to_world(s);
    return s;
  }

  // What is beyond the room for it is left to the neighbours.
  void wait(const Pair& pair, int held) {
    if (waits_ < kWaiting) waiting_[(head_ + waits_++) % kWaiting] = {pair, held};
  }

  // Where a descent has come to; the units of work of it.
  int take(const Pair& s) {
    if (!(s.chi2 < std::min(limit_, best_ + kWindow)) || s.cost - s.chi2 > kPassed) return 0;
    best_ = std::min(best_, s.cost);
    cone_ = std::min(cone_, s.cost - s.chi2);
    bool fresh[2];
    for (int k = 0; k < 2; ++k) fresh[k] = add(s, k);
    int done = 0;
    for (int k = 0; k < 2; ++k) {
      if (fresh[k]) walk_on(s, k, done);
    }
    return kLooked * done;
  }

  // One end of a pair; is it new?
  bool add(const Pair& s, int k) {
    const PairEnd& e = s.ends[k];
    const Part part{e.surface, view_.to_body(e.point, e.body), s.cost, s.cost - s.chi2};
    if (Part* known = near(part, count_)) {
      if (part.cost < known->cost) *known = part;
      return false;
    }
    if (count_ == kMost) thin_out();
    parts_[count_++] = part;
    return true;
  }

  Part* near(const Part& part, int count) {
    for (int i = 0; i < count; ++i) {
      if (parts_[i].surface == part.surface && norm(parts_[i].point - part.point) < apart_)
        return parts_ + i;
    }
    return nullptr;
  }

  // Too many: they shall be farther apart.
  void thin_out() {
    while (count_ == kMost) {
      apart_ *= kWider;
      const int before = count_;
      count_ = 0;
      for (int i = 0; i < before; ++i) {
        const Part part = parts_[i];
        Part* known = near(part, count_);
        if (known == nullptr) {
          parts_[count_++] = part;
        } else if (part.cost < known->cost) {
          *known = part;
        }
      }
    }
  }

  // To all sides of one end; adds what it took to `looked`.
  void walk_on(const Pair& s, int k, int& looked) {
    const double stride = std::max(kStride, apart_);
    Vec3 ways[2];
    tangents(s.ends[k].normal, ways[0], ways[1]);
    for (int i = 0; i < 4; ++i) {
      Pair next = s;
      PairEnd& e = next.ends[k];
      const Vec3 target = e.point + (i % 2 ? stride : -stride) * ways[i / 2];
      const SurfacePoint p = view_.nearest(e.surface, e.body, target, stride, e.place, looked);
      if (p.face < 0) continue;
      e.point = p.point;
      e.normal = p.normal;
      e.place = p.place;
      wait(next, k);
    }
  }

  const LocalizerSettings& settings_;
  PairView view_;
  PairFit fit_;
  PairDescent descent_;
  std::vector<Task> waiting_;  // a ring
  Part parts_[kMost];
  int head_ = 0, waits_ = 0, count_ = 0, rank_ = 0;
  Stage stage_ = Stage::none;
  const PairSearch* search_ = nullptr;  // from which it began, and what of it has not been used yet:
  int next_solution_ = 0, next_start_ = 0;
  double limit_ = 0.0, best_ = 0.0, cone_ = 0.0, apart_ = kApart;
};

}  // namespace touchline
