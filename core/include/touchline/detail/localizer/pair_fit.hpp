// SPDX-License-Identifier: Apache-2.0
// How well two contacts at given points explain a measurement, and which way they would explain it
// better. No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/localizer/pair.hpp"
#include "touchline/detail/localizer/pair_view.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class PairFit {
 public:
  static constexpr int kUnknowns = 10;  // three of each force, two of each place

  PairFit(const PairView& view, const LocalizerSettings& settings)
      : view_(view), settings_(settings), cone_(std::atan(settings.friction)) {}

  // The forces at given points that explain best, in closed form; where they are `bound`, with what
  // is beyond the friction cones.
  void solve_forces(Pair& s, bool bound) {
    double A[36] = {}, g[6] = {}, square = 0.0;
    set_forces(s.ends);
    for (int r = 0; r < view_.rows(); ++r) {
      const double *d = columns_ + r * kUnknowns, y = view_.white_values()[r];
      square += y * y;
      for (int i = 0; i < 6; ++i) {
        g[i] += d[i] * y;
        for (int j = 0; j <= i; ++j) A[6 * i + j] += d[i] * d[j];
      }
    }
    for (int i = 0; i < 6; ++i) A[7 * i] += prior(i);
    s.cost = std::numeric_limits<double>::infinity();
    double L[36], x[6];
    std::copy(A, A + 36, L);
    std::copy(g, g + 6, x);
    if (!cholesky(L, 6)) return;
    solve_cholesky(L, 6, x);
    judge(A, g, square, x, s);
    for (int turn = 0; bound && turn < kTurns && s.cost > s.chi2 + kBeyond; ++turn) {
      std::copy(A, A + 36, L);
      std::copy(g, g + 6, x);
      add_cones(s, L, 6, x);
      if (!cholesky(L, 6)) return;
      solve_cholesky(L, 6, x);
      Pair other = s;
      judge(A, g, square, x, other);
      if (!(other.cost < s.cost)) return;
      s = other;
    }
  }

  // The information (10, 10), lower triangle, on forces and on the tangent coordinates of the
  // points, with what is assumed where nothing is measured; and the gradient (10) of -chi2 / 2. Of
  // the cones too, where forces are `bound`.
  void information(const Pair& s, double* H, double* g, bool bound) {
    constexpr int n = kUnknowns;
    set_forces(s.ends);
    set_tangents(s.ends);
    std::fill(H, H + n * n, 0.0);
    std::fill(g, g + n, 0.0);
    const Vec3 &f = s.ends[0].force, &h = s.ends[1].force;
    const double forces[6] = {f.x, f.y, f.z, h.x, h.y, h.z};
    for (int r = 0; r < view_.rows(); ++r) {
      const double* d = columns_ + r * n;
      double rest = view_.white_values()[r];
      for (int i = 0; i < 6; ++i) rest -= d[i] * forces[i];
      for (int i = 0; i < n; ++i) {
        g[i] += d[i] * rest;
        for (int j = 0; j <= i; ++j) H[n * i + j] += d[i] * d[j];
      }
    }
    for (int i = 0; i < n; ++i) H[i * (n + 1)] += prior(i);
    if (bound) add_cones(s, H, n, g);
  }

 private:
  static constexpr int kTurns = 3;  // of the cones, linearized anew: a bound on time
  static constexpr double kBeyond = 0.01;  // cost of the cones that is not worth a turn

  double prior(int i) const {
    const double scale = i < 6 ? settings_.force_scale : settings_.place_scale;
    return 1.0 / (scale * scale);
  }

  // Takes forces over, with their misfit.
  void judge(const double* A, const double* g, double square, const double* x, Pair& s) const {
    for (int i = 0; i < 6; ++i) {
      double own = 0.5 * A[7 * i] * x[i] - g[i];
      for (int j = 0; j < i; ++j) own += A[6 * i + j] * x[j];
      square += 2.0 * x[i] * own;
    }
    s.ends[0].force = {x[0], x[1], x[2]};
    s.ends[1].force = {x[3], x[4], x[5]};
    s.chi2 = s.cost = square;
    for (const PairEnd& e : s.ends) {
      const double b = beyond(e);
      s.cost += b * b;
    }
  }

  // Beyond the friction cone, to the scale of its softness: that costs more and more, but a way out
  // of it stays.
  double beyond(const PairEnd& e) const {
    const double size = norm(e.force);
    if (!(size > 0.0)) return 0.0;
    const double angle = std::acos(std::clamp(-dot(e.normal, e.force) / size, -1.0, 1.0)) - cone_;
    return std::max(0.0, angle) / settings_.cone_softness;
  }

  // Adds what is beyond the cones, to first order in the forces, to normal equations of `n` unknowns,
  // of increments of the forces or of the forces themselves: along itself a force does not turn.
  void add_cones(const Pair& s, double* A, int n, double* g) const {
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = s.ends[k];
      const double b = beyond(e), size = norm(e.force);
      if (!(b > 0.0) || size < settings_.least_force) continue;
      const Vec3 u = (1.0 / size) * e.force;
      const Vec3 across = e.normal - dot(e.normal, u) * u;
      const double sine = norm(across);
      if (!(sine > 1e-3)) continue;
      const Vec3 slope = (1.0 / (sine * size * settings_.cone_softness)) * across;
      for (int i = 0; i < 3; ++i) {
        g[3 * k + i] -= component(slope, i) * b;
        for (int j = 0; j <= i; ++j)
          A[n * (3 * k + i) + 3 * k + j] += component(slope, i) * component(slope, j);
      }
    }
  }

  // What forces at both ends do to the rows: f . row + (p x f) . moments = f . (row + moments x p).
  void set_forces(const PairEnd* ends) {
    for (int k = 0; k < 2; ++k) {
      const double* m = view_.white_map(ends[k].body);
      const Vec3 p = view_.earlier(ends[k].point, ends[k].body);
      for (int r = 0; r < view_.rows(); ++r, m += 6) {
        const Vec3 row = Vec3{m[0], m[1], m[2]} + cross(Vec3{m[3], m[4], m[5]}, p);
        double* d = columns_ + r * kUnknowns + 3 * k;
        d[0] = row.x;
        d[1] = row.y;
        d[2] = row.z;
      }
    }
  }

  // What ways of both points along their surfaces do, under their forces.
  void set_tangents(const PairEnd* ends) {
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = ends[k];
      const double* m = view_.white_map(e.body);
      Vec3 s[2];
      tangents(e.normal, s[0], s[1]);
      const Vec3 moments[2] = {cross(s[0], e.force), cross(s[1], e.force)};
      for (int r = 0; r < view_.rows(); ++r, m += 6) {
        double* d = columns_ + r * kUnknowns + 6 + 2 * k;
        for (int i = 0; i < 2; ++i) d[i] = dot(Vec3{m[3], m[4], m[5]}, moments[i]);
      }
    }
  }

  const PairView& view_;
  const LocalizerSettings& settings_;
  double cone_;
  double columns_[PairView::kRows * kUnknowns];  // forces of both ends, then their tangents
};

}  // namespace touchline
