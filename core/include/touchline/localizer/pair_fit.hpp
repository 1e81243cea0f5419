// SPDX-License-Identifier: Apache-2.0
// How well two contacts at given points explain a measurement, and which way they would explain it
// better. No allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/localizer/pair.hpp"
#include "touchline/localizer/pair_view.hpp"
#include "touchline/model/dense.hpp"
#include "touchline/place/hypothesis.hpp"

namespace touchline {

class PairFit {
 public:
  static constexpr int kUnknowns = 10;

  PairFit(const PairView& view, const LocalizerSettings& settings)
      : view_(view), settings_(settings), cone_(std::atan(settings.friction)) {}

  // The forces at given points that explain best, in closed form.
  void solve_forces(Pair& s) {
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
    double x[6];
    std::copy(g, g + 6, x);
    s.cost = std::numeric_limits<double>::infinity();
    if (!cholesky(A, 6)) return;
    solve_cholesky(A, 6, x);
    for (int i = 0; i < 6; ++i) square -= g[i] * x[i];
    s.ends[0].force = {x[0], x[1], x[2]};
    s.ends[1].force = {x[3], x[4], x[5]};
    s.chi2 = s.cost = square;
    for (const PairEnd& e : s.ends) s.cost += cone(e);
  }

  // The information (10, 10), lower triangle, on forces and on the tangent coordinates of the
  // points, with what is assumed where nothing is measured; and the gradient (10) of -chi2 / 2.
  void information(const Pair& s, double* H, double* g) {
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
  }

 private:
  double prior(int i) const {
    const double scale = i < 6 ? settings_.force_scale : settings_.place_scale;
    return 1.0 / (scale * scale);
  }

  // Beyond the friction cone costs more and more, but a way out of it stays.
  double cone(const PairEnd& e) const {
    const double size = norm(e.force);
    if (!(size > 0.0)) return 0.0;
    const double beyond = std::acos(std::clamp(-dot(e.normal, e.force) / size, -1.0, 1.0)) - cone_;
    const double x = std::max(0.0, beyond) / settings_.cone_softness;
    return x * x;
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
