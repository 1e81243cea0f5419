// SPDX-License-Identifier: Apache-2.0
// Moves a pair of points over the surfaces to where it explains better. No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/pair_fit.hpp"

namespace touchline {

class PairDescent {
 public:
  PairDescent(const PairView& view, PairFit& fit) : view_(view), fit_(fit) {}

  // At most so many steps, a third of them where the cost is `hopeless` by then; how many there
  // were. `bound`: do the friction cones guide it too, or do they only judge where it ends? `held`:
  // the end that is to move as little as it can.
  int descend(Pair& s, int most, double hopeless, bool bound, int held = -1) {
    fit_.solve_forces(s, bound);
    double damping = 1e-3;
    int i = 0;
    for (; i < most && damping < 1e6; ++i) {
      Pair next = s;
      const double length = step(next, damping, bound, held);
      if (length < 1e-5) break;
      fit_.solve_forces(next, bound);
      if (next.cost < s.cost) {
        const bool flat = s.cost - next.cost < 1e-3 * s.cost && length < 1e-3;
        s = next;
        damping = std::max(1e-6, 0.2 * damping);
        if (flat) break;
      } else {
        damping *= 8.0;
      }
      if (i == most / 3 && s.cost > hopeless) break;
    }
    return i + 1;
  }

 private:
  static constexpr double kHold = 5e-3;      // of an end that is held, one sigma of a step [m]
  static constexpr double kFarthest = 0.04;  // that a step goes [m]

  // One damped Gauss-Newton step of the points; its length [m].
  double step(Pair& s, double damping, bool bound, int held) {
    constexpr int n = PairFit::kUnknowns;
    double H[n * n], x[n];
    fit_.information(s, H, x, bound);
    for (int i = 6; i < n; ++i) H[i * (n + 1)] *= 1.0 + damping;
    for (int i = 6 + 2 * held; held >= 0 && i < 8 + 2 * held; ++i)
      H[i * (n + 1)] += 1.0 / (kHold * kHold);
    if (!cholesky(H, n)) return 0.0;
    solve_cholesky(H, n, x);
    double length = 0.0;
    for (int k = 0; k < 2; ++k) {
      PairEnd& e = s.ends[k];
      Vec3 a, b;
      tangents(e.normal, a, b);
      Vec3 way = x[6 + 2 * k] * a + x[7 + 2 * k] * b;
      const double size = norm(way), most = std::min(size, kFarthest);
      if (size > kFarthest) way = (kFarthest / size) * way;
      // The surface is no farther from there than where it was left.
      const SurfacePoint p = view_.nearest(e.surface, e.body, e.point + way, most + 1e-6);
      if (p.face < 0) return 0.0;
      length = std::max(length, norm(p.point - e.point));
      e.point = p.point;
      e.normal = p.normal;
    }
    return length;
  }

  const PairView& view_;
  PairFit& fit_;
};

}  // namespace touchline
