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
      : view_(view),
        settings_(settings),
        cone_(std::atan(settings.friction)),
        inside_(std::cos(cone_) + kRounding) {}

  // The forces at given points that explain best, in closed form; where they are `bound`, with what
  // is beyond the friction cones, unless even without they cost as much as `worth`.
  void solve_forces(Pair& s, bool bound, double worth = std::numeric_limits<double>::infinity()) {
    set_forces(s.ends);
    double A[36], g[6];
    std::copy_n(A_, 36, A);
    std::copy_n(g_, 6, g);
    for (int i = 0; i < 6; ++i) A[7 * i] += prior(i);
    s.cost = std::numeric_limits<double>::infinity();
    double L[36], x[6];
    std::copy(A, A + 36, L);
    std::copy(g, g + 6, x);
    if (!cholesky<6>(L)) return;
    solve_cholesky<6>(L, x);
    judge(A, g, x, s);
    const auto matter = [&] { return s.chi2 < worth && s.cost > s.chi2 + kBeyond + kPart * s.chi2; };
    for (int turn = 0; bound && turn < kTurns && matter(); ++turn) {
      std::copy(A, A + 36, L);
      std::copy(g, g + 6, x);
      add_cones(s, L, 6, x);
      if (!cholesky<6>(L)) return;
      solve_cholesky<6>(L, x);
      Pair other = s;
      judge(A, g, x, other);
      if (!(other.cost < s.cost)) return;
      s = other;
    }
  }

  // The information (10, 10), lower triangle, on forces and on the tangent coordinates of the
  // points, with what is assumed where nothing is measured; and the gradient (10) of -chi2 / 2. Of
  // the cones too, where forces are `bound`.
  void information(const Pair& s, double* H, double* g, bool bound) {
    set_forces(s.ends);
    information_at_hand(s, H, g, bound);
  }

  // The same of the points whose forces have been solved last.
  void information_at_hand(const Pair& s, double* H, double* g, bool bound) const {
    constexpr int n = kUnknowns;
    const Vec3 &f = s.ends[0].force, &h = s.ends[1].force;
    const double forces[6] = {f.x, f.y, f.z, h.x, h.y, h.z};
    for (int i = 0; i < 6; ++i) {
      g[i] = g_[i];
      for (int j = 0; j < 6; ++j) g[i] -= A_[6 * std::max(i, j) + std::min(i, j)] * forces[j];
      for (int j = 0; j <= i; ++j) H[n * i + j] = A_[6 * i + j];
    }
    // Ways of the points along their surfaces change the moments of their forces.
    double moments[4][3];
    for (int i = 0; i < 4; ++i) {
      const int k = i / 2, row = 6 * k + 3;
      const PairEnd& e = s.ends[k];
      Vec3 along[2];
      tangents(e.normal, along[0], along[1]);
      store(cross(along[i % 2], e.force), moments[i]);
      g[6 + i] = 0.0;
      for (int r = 0; r < 3; ++r) {
        const double* t = loads_ + 6 * (row + r);
        double rest = h_[row + r];
        for (int j = 0; j < 6; ++j) rest -= t[j] * forces[j];
        g[6 + i] += moments[i][r] * rest;
      }
      for (int j = 0; j < 6; ++j) {
        double& sum = H[n * (6 + i) + j] = 0.0;
        for (int r = 0; r < 3; ++r) sum += moments[i][r] * loads_[6 * (row + r) + j];
      }
      for (int j = 0; j <= i; ++j) {
        const double* N = block(k, j / 2) + 21;
        double& sum = H[n * (6 + i) + 6 + j] = 0.0;
        for (int r = 0; r < 3; ++r) {
          for (int c = 0; c < 3; ++c) sum += moments[i][r] * N[6 * r + c] * moments[j][c];
        }
      }
    }
    for (int i = 0; i < n; ++i) H[i * (n + 1)] += prior(i);
    if (bound) add_cones(s, H, n, g);
  }

 private:
  static constexpr double kRounding = 1e-9;  // of cosines, far above what they err by
  static constexpr int kTurns = 3;  // of the cones, linearized anew: a bound on time
  // Cost of the cones that is not worth a turn: so much, and a part of the misfit.
  static constexpr double kBeyond = 0.01, kPart = 0.01;

  double prior(int i) const {
    const double scale = i < 6 ? settings_.force_scale : settings_.place_scale;
    return 1.0 / (scale * scale);
  }

  // Takes forces over, with their misfit.
  void judge(const double* A, const double* g, const double* x, Pair& s) const {
    double square = view_.square();
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
    const double cosine = -dot(e.normal, e.force) / size;
    if (cosine > inside_) return 0.0;
    const double angle = std::acos(std::clamp(cosine, -1.0, 1.0)) - cone_;
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

  // The normal equations of forces at both ends, from those of wrenches on their bodies: a force f at
  // p is the wrench (f, p x f), so that row . f + moments . (p x f) = f . (row + moments x p).
  void set_forces(const PairEnd* ends) {
    Vec3 p[2];
    for (int k = 0; k < 2; ++k) {
      p[k] = view_.earlier(ends[k].point, ends[k].body);
      bodies_[k] = ends[k].body;
      std::copy_n(view_.vector(ends[k].body), 6, h_ + 6 * k);
    }
    for (int k = 0; k < 2; ++k) {
      for (int l = 0; l < 2; ++l) {
        const double* N = block(k, l);
        double* t = loads_ + 36 * k + 3 * l;
        for (int r = 0; r < 6; ++r, N += 6, t += 6)
          store(Vec3{N[0], N[1], N[2]} + cross(Vec3{N[3], N[4], N[5]}, p[l]), t);
      }
      const double *h = h_ + 6 * k, *t = loads_ + 36 * k;
      store(Vec3{h[0], h[1], h[2]} + cross(Vec3{h[3], h[4], h[5]}, p[k]), g_ + 3 * k);
      for (int j = 0; j < 3 * (k + 1); ++j) {
        double column[3];
        store(Vec3{t[j], t[6 + j], t[12 + j]} + cross(Vec3{t[18 + j], t[24 + j], t[30 + j]}, p[k]),
              column);
        for (int i = 0; i < 3; ++i) A_[6 * (3 * k + i) + j] = column[i];
      }
    }
  }

  const double* block(int k, int l) const { return view_.information(bodies_[k], bodies_[l]); }
  static void store(const Vec3& v, double* out) {
    out[0] = v.x;
    out[1] = v.y;
    out[2] = v.z;
  }

  const PairView& view_;
  const LocalizerSettings& settings_;
  double cone_, inside_;  // its angle [rad]; a cosine that is surely within it
  // Of the points at hand: the two bodies, what forces at both do to the normal equations of the
  // wrenches (12, 6), and those (12); and the normal equations of the forces.
  int bodies_[2] = {};
  double loads_[72], h_[12], A_[36], g_[6];
};

}  // namespace touchline
