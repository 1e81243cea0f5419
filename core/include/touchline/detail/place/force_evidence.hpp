// SPDX-License-Identifier: Apache-2.0
// How well a place explains a measurement with any force: the likelihood times the density of
// forces, integrated over them. Where a measurement knows the force well in all directions Laplace's
// formula serves; joint torques alone often leave one or two directions open, and then the cone of
// friction bounds the force, not the measurement. No allocation.
// Theory: docs/theory.md, section 5.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class ForceEvidence {
 public:
  explicit ForceEvidence(const ForceFitter& fitter) : fitter_(fitter) {}

  // Logarithm of the integral at `point`, but for a constant; `fit`: the best force there.
  double at(const Quadratic& q, const Vec3& point, const Vec3& normal, bool grasped,
            const Fit& fit) const {
    double A[9], g[3], factor[9], inverse[9], C[9], axes[9] = {1, 0, 0, 0, 1, 0, 0, 0, 1};
    fitter_.force_terms(q, point, A, g);
    std::copy(A, A + 9, factor);
    if (!cholesky(factor, 3)) return -std::numeric_limits<double>::infinity();
    const double wide = fitter_.settings().wide * std::max(norm(fit.force), 1.0);
    invert_lower(factor, 3, inverse);
    double variance = 0.0;
    for (double x : inverse) variance += x * x;
    if (variance < wide * wide)
      return -0.5 * (fit.cost() + log_determinant(factor, 3)) + 1.5 * std::log(kTurn) +
             fitter_.log_prior(fit, grasped);
    for (int i = 0; i < 9; ++i) {  // the covariance: (L L^T)^-1
      C[i] = 0.0;
      for (int k = 0; k < 3; ++k) C[i] += inverse[3 * k + i / 3] * inverse[3 * k + i % 3];
    }
    diagonalize(C, axes, 3);
    int open[3], count = 0;
    // Logarithm of the volume in the other directions.
    double log_narrow = 1.5 * std::log(kTurn) - 0.5 * log_determinant(factor, 3);
    for (int i = 0; i < 3; ++i) {
      if (!(C[4 * i] > wide * wide)) continue;
      open[count++] = i;
      log_narrow -= 0.5 * std::log(kTurn * C[4 * i]);
    }
    if (count == 0) return -0.5 * fit.cost() + fitter_.log_prior(fit, grasped) + log_narrow;
    if (count > 1) return over_directions(q, A, g, normal, grasped);
    double f[3] = {g[0], g[1], g[2]};
    solve_cholesky(factor, 3, f);
    const int k = open[0];
    const double least = q.constant - g[0] * f[0] - g[1] * f[1] - g[2] * f[2];
    return log_narrow - 0.5 * least +
           along({f[0], f[1], f[2]}, {axes[k], axes[3 + k], axes[6 + k]}, 1.0 / C[4 * k], normal,
                 grasped);
  }

 private:
  static constexpr double kTurn = 6.283185307179586;
  static constexpr int kSteps = 16, kDirections = 64;  // that are summed up

  // Over the forces f + t e with information `known` on t.
  double along(const Vec3& f, const Vec3& e, double known, const Vec3& normal, bool grasped) const {
    const double reach = fitter_.settings().wide_sigmas / std::sqrt(known);
    double from = -reach, to = reach;
    if (!grasped && !inside_cone(f, e, normal, from, to))
      return -std::numeric_limits<double>::infinity();
    const double step = (to - from) / kSteps;
    double sum = 0.0;
    for (int i = 0; i < kSteps; ++i) {
      const double t = from + (i + 0.5) * step;
      sum += step * std::exp(density(f + t * e, normal, grasped) - 0.5 * known * t * t);
    }
    return std::log(sum);
  }

  // Logarithm of how dense forces are, with those just beyond the cone.
  double density(const Vec3& force, const Vec3& normal, bool grasped) const {
    Fit fit;
    fit.force = force;
    const double size = norm(force);
    fit.cosine = size > 0.0 ? -dot(normal, force) / size : 0.0;
    return fitter_.log_prior(fit, grasped) - (grasped ? 0.0 : 0.5 * fitter_.cone_cost(fit.cosine));
  }

  // Narrows the interval of f + t e to what is in the cone, or just beyond; false: nothing is.
  bool inside_cone(const Vec3& f, const Vec3& e, const Vec3& normal, double& from,
                   double& to) const {
    const double c = fitter_.steepest(), c2 = c * c;
    const double a = dot(normal, e) * dot(normal, e) - c2 * dot(e, e);
    const double b = dot(normal, e) * dot(normal, f) - c2 * dot(e, f);
    const double d = dot(normal, f) * dot(normal, f) - c2 * dot(f, f);
    const auto inside = [&](double t) {
      const Vec3 x = f + t * e;
      return -dot(normal, x) > c * norm(x);
    };
    double cuts[4] = {from, from, to, to};
    const double root2 = b * b - a * d;
    if (root2 > 0.0 && a != 0.0) {
      const double r = std::sqrt(root2), x = (-b - r) / a, y = (-b + r) / a;
      cuts[1] = std::clamp(std::min(x, y), from, to);
      cuts[2] = std::clamp(std::max(x, y), from, to);
    }
    bool any = false;
    for (int i = 0; i < 3; ++i) {  // the cone is convex: what is inside hangs together
      if (!(cuts[i + 1] > cuts[i]) || !inside(0.5 * (cuts[i] + cuts[i + 1]))) continue;
      from = any ? from : cuts[i];
      to = cuts[i + 1];
      any = true;
    }
    return any;
  }

  // Over directions; for each the integral over sizes is that of a normal distribution.
  double over_directions(const Quadratic& q, const double* A, const double* g, const Vec3& normal,
                         bool grasped) const {
    Vec3 s, t;
    tangents(normal, s, t);
    const double least = grasped ? -1.0 : fitter_.steepest();
    const double each = kTurn * (1.0 - least) / kDirections;
    double sum = 0.0;
    for (int i = 0; i < kDirections; ++i) {
      const double cosine = 1.0 - (i + 0.5) / kDirections * (1.0 - least);
      const double sine = std::sqrt(1.0 - cosine * cosine), turn = 2.399963229728653 * i;
      const Vec3 u = sine * std::cos(turn) * s + sine * std::sin(turn) * t - cosine * normal;
      const double x[3] = {u.x, u.y, u.z};
      double along = 0.0, curve = 0.0;
      for (int r = 0; r < 3; ++r) {
        along += g[r] * x[r];
        for (int c = 0; c < 3; ++c) curve += x[r] * A[3 * r + c] * x[c];
      }
      const double size = along / curve, z = along / std::sqrt(curve);
      const double weight = density(std::max(size, 1.0) * u, normal, grasped);
      const double scale = std::max(size, 1.0);
      sum += each * std::exp(weight + 2.0 * std::log(scale) - 0.5 * (q.constant - z * z)) *
             std::sqrt(kTurn / curve) * 0.5 * std::erfc(-z / std::sqrt(2.0));
    }
    return std::log(sum);
  }

  const ForceFitter& fitter_;
};

}  // namespace touchline
