// SPDX-License-Identifier: Apache-2.0
// Moves a pair of points over the surfaces to where it explains better, some steps at a time. No
// allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/pair_fit.hpp"

namespace touchline {

// One descent at a time, in as many parts as wanted: where it ends does not depend on them.
class PairDescent {
 public:
  PairDescent(const PairView& view, PairFit& fit) : view_(view), fit_(fit) {}

  // When it ends: after so many steps. Where the cost is `hopeless`, from a third of them on. Before that
  // a step must not leave more than a part of what was allowed: `soon` at the beginning, or the cost that
  // it begins with. It ends where all that a step can better leaves it twice as large as hopeless. And
  // where that, or what a step has bettered, is `little`.
  struct Ends {
    int most;
    double hopeless, little, soon;
  };

  // From where. `bound`: do the friction cones guide it too, or do they only judge where it ends?
  // `held`: the end that is to move as little as it can.
  void begin(const Pair& from, const Ends& ends, bool bound, int held = -1) {
    pair_ = from;
    ends_ = ends;
    bound_ = bound;
    held_ = held;
    steps_ = 0;
    damping_ = 1e-3;
    working_ = true;
    fit_.solve_forces(pair_, bound_);
    allowed_ = std::max(ends.soon, pair_.cost);
    fit_.information_at_hand(pair_, H_, g_, bound_);
  }
  void drop() { working_ = false; }
  bool working() const { return working_; }
  // Where it has come to.
  const Pair& pair() const { return pair_; }

  // Goes on for about so many units of work (`LocalizerTuning::pair_work`); how many there were.
  int work(int units) {
    int done = 0;
    while (done < units && working_) {
      looked_ = 0;
      working_ = improve();
      done += (bound_ ? kBoundStep : kStep) + kLook * looked_ / kLooks;
    }
    return done;
  }

 private:
  // Units of work of a step, as measured; with friction cones; and of so many boxes looked into for its
  // surface.
  static constexpr int kStep = 14, kBoundStep = 20, kLook = 4, kLooks = 3;
  static constexpr double kHold = 5e-3;      // of an end that is held, one sigma of a step [m]
  static constexpr double kFall = 0.3;       // part of what a cost may be that is left by a step
  static constexpr double kFarthest = 0.04;  // that a step goes [m]

  // One step more; false if it was the last one.
  bool improve() {
    Pair next = pair_;
    const double length = step(next);
    if (length < 1e-5) return false;
    fit_.solve_forces(next, bound_, pair_.cost);
    const bool moved = next.cost < pair_.cost;
    if (moved) {
      const double better = pair_.cost - next.cost;
      const bool flat = better < 1e-3 * pair_.cost && length < 1e-3;
      pair_ = next;
      damping_ = std::max(1e-6, 0.2 * damping_);
      if (flat || better < ends_.little) return false;
    } else {
      damping_ *= 8.0;
    }
    allowed_ = std::max(ends_.hopeless, kFall * allowed_);
    const bool late = steps_ >= ends_.most / 3;
    const bool hopeless = pair_.cost > (late ? ends_.hopeless : allowed_);
    if (hopeless || ++steps_ == ends_.most || !(damping_ < 1e6)) return false;
    if (moved) fit_.information_at_hand(pair_, H_, g_, bound_);
    return true;
  }

  // One damped Gauss-Newton step of the points; its length [m], 0 where it is not worth it.
  double step(Pair& s) {
    constexpr int n = PairFit::kUnknowns;
    for (const PairEnd& e : s.ends) view_.expect(e.surface, e.place);
    double H[n * n], x[n];
    std::copy_n(H_, n * n, H);
    std::copy_n(g_, n, x);
    for (int i = 6; i < n; ++i) H[i * (n + 1)] *= 1.0 + damping_;
    for (int i = 6 + 2 * held_; held_ >= 0 && i < 8 + 2 * held_; ++i)
      H[i * (n + 1)] += 1.0 / (kHold * kHold);
    if (!cholesky<n>(H)) return 0.0;
    solve_cholesky<n>(H, x);
    double gain = 0.0;  // at most
    for (int i = 0; i < n; ++i) gain += 2.0 * g_[i] * x[i];
    if (gain < ends_.little || (steps_ > 0 && pair_.cost - gain > 2.0 * ends_.hopeless)) return 0.0;
    double length = 0.0;
    for (int k = 0; k < 2; ++k) {
      PairEnd& e = s.ends[k];
      Vec3 a, b;
      tangents(e.normal, a, b);
      Vec3 way = x[6 + 2 * k] * a + x[7 + 2 * k] * b;
      const double size = norm(way), most = std::min(size, kFarthest);
      if (size > kFarthest) way = (kFarthest / size) * way;
      // The surface is no farther from there than where it was left.
      const SurfacePoint p =
          view_.nearest(e.surface, e.body, e.point + way, most + 1e-6, e.place, looked_);
      if (p.face < 0) return 0.0;
      length = std::max(length, norm(p.point - e.point));
      e.point = p.point;
      e.normal = p.normal;
      e.place = p.place;
    }
    return length;
  }

  const PairView& view_;
  PairFit& fit_;
  Pair pair_;
  Ends ends_{};
  int held_ = -1, steps_ = 0, looked_ = 0;
  double damping_ = 0.0, allowed_ = 0.0;
  bool bound_ = false, working_ = false;
  // Of the pair that is left: its information and the gradient, as `PairFit` has them.
  double H_[PairFit::kUnknowns * PairFit::kUnknowns], g_[PairFit::kUnknowns];
};

}  // namespace touchline
