// SPDX-License-Identifier: Apache-2.0
// Where two contacts may be that cannot be told apart: a walk over the pairs of points that explain,
// from wherever a search began, some steps in each sample. It works on the view of that search, so
// that its outcome does not depend on how it is spread over samples. No allocation.
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
  static constexpr int kMost = 256;  // room: parts

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

  // Begins from the outcome of a search.
  void begin(const PairSearch& search) {
    view_ = search.view();
    limit_ = chi2_limit(view_.rows(), settings_.pitch_limit);
    rank_ = search.count() > 0 ? search[0].rank : 0;
    best_ = cone_ = std::numeric_limits<double>::infinity();
    apart_ = kApart;
    count_ = steps_ = 0;
    drop();
    for (int i = 0; i < search.count(); ++i) wait(search[i], -1);
    Pair pair;
    for (int place = 0, end; search.starts().plausible(place, pair, end);) wait(pair, end);
  }

  void drop() { head_ = waits_ = 0; }
  bool working() const { return waits_ > 0; }

  // Goes on for about so many steps.
  void work(int steps) {
    for (const int until = steps_ + steps; waits_ > 0 && steps_ < until;) {
      const Task& task = waiting_[head_];
      head_ = (head_ + 1) % kWaiting;
      --waits_;
      descent_.begin(task.pair, kSteps, kHopeless, true, task.held);
      while (descent_.working()) steps_ += descent_.work(kSteps);
      take(descent_.pair());
    }
  }

  int steps() const { return steps_; }  // since it began
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
  static constexpr double kHopeless = 100.0;  // cost after a third of the steps
  static constexpr double kWindow = 13.0;     // of cost: 99 % of chi2 with four degrees of freedom
  // Cost of the cones through which a walk goes on, and which still tells: faces are flat where
  // links are round.
  static constexpr double kPassed = 16.0, kTold = 4.0;
  static constexpr double kApart = 0.012;   // parts nearer than this are one [m]
  static constexpr double kStride = 0.022;  // from one to the next [m]
  static constexpr double kReach = 0.03;
  static constexpr double kWider = 1.5;  // each time there are too many parts
  static constexpr double kWide = 1.5;   // times what parts are apart: between them there are more

  struct Task {
    Pair pair;
    int held;  // the end that is to stay where it is; -1: neither
  };

  // What is beyond the room for it is left to the neighbours.
  void wait(const Pair& pair, int held) {
    if (waits_ < kWaiting) waiting_[(head_ + waits_++) % kWaiting] = {pair, held};
  }

  void take(const Pair& s) {
    if (!(s.chi2 < std::min(limit_, best_ + kWindow)) || s.cost - s.chi2 > kPassed) return;
    best_ = std::min(best_, s.cost);
    cone_ = std::min(cone_, s.cost - s.chi2);
    bool fresh[2];
    for (int k = 0; k < 2; ++k) fresh[k] = add(s, k);
    for (int k = 0; k < 2; ++k) {
      if (fresh[k]) walk_on(s, k);
    }
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

  // To all sides of one end.
  void walk_on(const Pair& s, int k) {
    const double stride = std::max(kStride, apart_);
    Vec3 ways[2];
    tangents(s.ends[k].normal, ways[0], ways[1]);
    for (int i = 0; i < 4; ++i) {
      Pair next = s;
      PairEnd& e = next.ends[k];
      const Vec3 target = e.point + (i % 2 ? stride : -stride) * ways[i / 2];
      const SurfacePoint p = view_.nearest(e.surface, e.body, target, stride, e.place);
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
  int head_ = 0, waits_ = 0, count_ = 0, steps_ = 0, rank_ = 0;
  double limit_ = 0.0, best_ = 0.0, cone_ = 0.0, apart_ = kApart;
};

}  // namespace touchline
