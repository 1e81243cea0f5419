// SPDX-License-Identifier: Apache-2.0
// Many pairs of points at once: the forces at both that explain best, in closed form, for one start
// of a body beside all those of another.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <limits>

#include "touchline/detail/localizer/start_lanes.hpp"

namespace touchline {

// One start of a body beside blocks of those of another.
class StartBeside {
 public:
  // Start i; `N` (6, 6), of which a row has `stride` numbers: what of the normal equations couples
  // wrenches on its body with those on the other; `square`: of what is measured.
  StartBeside(const StartLanes& own, int i, const double* N, int stride, double square) {
    const int block = i / kLanes, k = i % kLanes;
    for (int c = 0; c < 6; ++c) turn_[c] = lane(own.turn(block)[c], k);
    const Lanes* p = own.point(block);
    const Vec3 point{lane(p[0], k), lane(p[1], k), lane(p[2], k)};
    const Vec3 forces[3] = {
        {turn_[0], 0.0, 0.0}, {turn_[1], turn_[2], 0.0}, {turn_[3], turn_[4], turn_[5]}};
    for (int q = 0; q < 3; ++q) {
      const Vec3 moment = cross(point, forces[q]);
      for (int c = 0; c < 6; ++c) {
        double& sum = load_[6 * q + c] = 0.0;
        for (int r = 0; r < 3; ++r)
          sum += component(forces[q], r) * N[stride * r + c] +
                 component(moment, r) * N[stride * (r + 3) + c];
      }
    }
    rest_ = square + lane(own.beyond(block), k);
    for (int c = 0; c < 3; ++c) {
      target_[c] = lane(own.target(block)[c], k);
      normal_[c] = lane(own.normal(block)[c], k);
      rest_ -= target_[c] * target_[c];
    }
  }

  // The misfit with each of a block of others, with the best forces in any direction.
  Lanes misfit(const StartLanes& others, int block) {
    const Lanes *turn = others.turn(block), *at = others.point(block), *g = others.target(block);
    // A force f there meets a load (m, l) of this start as f . (m + l x p).
    for (int q = 0; q < 3; ++q) {
      const double* l = load_ + 6 * q;
      const Lanes x = l[0] + (l[4] * at[2] - l[5] * at[1]);
      const Lanes y = l[1] + (l[5] * at[0] - l[3] * at[2]);
      const Lanes z = l[2] + (l[3] * at[1] - l[4] * at[0]);
      coupling_[q] = turn[0] * x;
      coupling_[3 + q] = turn[1] * x + turn[2] * y;
      coupling_[6 + q] = turn[3] * x + turn[4] * y + turn[5] * z;
    }
    // What the other's force explains of what is left beside this one.
    Lanes y[3], S[6];
    for (int p = 0, k = 0; p < 3; ++p) {
      const Lanes* c = coupling_ + 3 * p;
      y[p] = g[p] - (c[0] * target_[0] + c[1] * target_[1] + c[2] * target_[2]);
      for (int q = 0; q <= p; ++q, ++k) {
        const Lanes* d = coupling_ + 3 * q;
        S[k] = all_lanes(p == q ? 1.0 : 0.0) - (c[0] * d[0] + c[1] * d[1] + c[2] * d[2]);
      }
    }
    const Lanes one = all_lanes(1.0), r0 = one / S[0];
    const Lanes l10 = S[1] * r0, l20 = S[3] * r0;
    const Lanes d1 = S[2] - l10 * S[1], t = S[4] - l20 * S[1], r1 = one / d1, l21 = t * r1;
    const Lanes d2 = S[5] - l20 * S[3] - l21 * t;
    y[1] -= l10 * y[0];
    y[2] -= l20 * y[0] + l21 * y[1];
    const Lanes x0 = y[0] * r0, x1 = y[1] * r1, x2 = y[2] / d2;
    const Lanes cost = all_lanes(rest_) - (y[0] * x0 + y[1] * x1 + y[2] * x2) + others.beyond(block);
    other_[2] = x2;
    other_[1] = x1 - l21 * x2;
    other_[0] = x0 - l10 * other_[1] - l20 * x2;
    const Lanes least = smaller(smaller(S[0], d1), d2);
    return least > all_lanes(kSingular) ? cost : all_lanes(std::numeric_limits<double>::infinity());
  }

  // The forces that do: this one's, then the other's (3 each).
  void forces(const StartLanes& others, int block, Lanes* out) const {
    Lanes own[3];
    for (int q = 0; q < 3; ++q) {
      own[q] = all_lanes(target_[q]);
      for (int p = 0; p < 3; ++p) own[q] -= coupling_[3 * p + q] * other_[p];
    }
    turned(turn_, own, out);
    turned(others.turn(block), other_, out + 3);
  }

  const double* normal() const { return normal_; }

 private:
  static constexpr double kSingular = 1e-13;  // below it the forces are not told apart

  template <class T>
  static void turned(const T* lower, const Lanes* x, Lanes* out) {
    out[0] = lower[0] * x[0] + lower[1] * x[1] + lower[3] * x[2];
    out[1] = lower[2] * x[1] + lower[4] * x[2];
    out[2] = lower[5] * x[2];
  }

  // What a wrench (force, moment) on the other body meets of each of this start's three forces.
  double load_[18];
  double target_[3], turn_[6], normal_[3], rest_;
  Lanes coupling_[9], other_[3];
};

}  // namespace touchline
