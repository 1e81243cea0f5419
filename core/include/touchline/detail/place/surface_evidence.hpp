// SPDX-License-Identifier: Apache-2.0
// How well a patch of a surface explains a measurement: the likelihood, integrated over all pushes
// that may come there, their force, direction and place. A place that needs luck, the one force in
// many that does not load a joint, pays for it. No allocation.
// Theory: docs/theory.md, section 5.9.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class SurfaceEvidence {
 public:
  // `settings` stay the caller's.
  explicit SurfaceEvidence(const PlaceSettings& settings) : settings_(settings) {
    // Points of a normal distribution in three dimensions, spread evenly: an additive recurrence,
    // whose ratio is the root of x^4 = x + 1, by Box and Muller.
    constexpr double kRatio[4] = {0.8566748838545029, 0.7338918566271260, 0.6287067210378087,
                                  0.5385972572236101};
    for (int k = 0; k < kForces; ++k) {
      double u[4];
      for (int i = 0; i < 4; ++i) u[i] = std::fmod(0.5 + (k + 1) * kRatio[i], 1.0);
      const double a = std::sqrt(-2.0 * std::log(u[0])), b = std::sqrt(-2.0 * std::log(u[2]));
      spread_[k] = {a * std::cos(kTurn * u[1]), a * std::sin(kTurn * u[1]),
                    b * std::cos(kTurn * u[3])};
    }
  }

  struct Explained {
    double log_evidence = -std::numeric_limits<double>::infinity();  // per area
    Vec3 force;  // the most likely, as far as the rows tell [N]
  };

  // A patch about `point` with the outward `normal`, `radius` [m] one sigma of the places on it along
  // each direction. What cannot come within `worst` of the log evidence is not worked out.
  Explained at(const Quadratic& q, const Vec3& point, const Vec3& normal, bool grasped,
               double radius, double worst) const {
    PlaceSettings settings = settings_;
    settings.place_scale = radius;
    const ForceFitter fitter(settings);
    Explained e;
    double A[9], f[3], H[25], g[5], w[6], step[5], P[25], work[25];
    fitter.force_terms(q, point, A, f);
    if (!cholesky(A, 3)) return e;
    solve_cholesky(A, 3, f);
    e.force = {f[0], f[1], f[2]};
    // The place is free within the patch: one step from its middle.
    const double scale = 1.0 / (settings_.force_scale * settings_.force_scale);
    fitter.information(q, point, normal, e.force, H, g);
    for (int i = 0; i < 3; ++i) g[i] -= scale * f[i];
    std::copy(H, H + 25, P);
    if (!invert(P, 5, work)) return e;
    wrench_of(point, e.force, w);
    double cost = q(w) + scale * dot(e.force, e.force);
    for (int i = 0; i < 5; ++i) {
      step[i] = 0.0;
      for (int j = 0; j < 5; ++j) step[i] += P[5 * i + j] * g[j];
      cost -= step[i] * g[i];
    }
    if (!cholesky(H, 5)) return e;
    const double fitted = -0.5 * (cost + log_determinant(H, 5)) - 2.0 * std::log(radius);
    if (fitted + kDensest < worst) return e;
    e.force = e.force + Vec3{step[0], step[1], step[2]};
    double C[9];
    for (int i = 0; i < 9; ++i) C[i] = P[5 * (i / 3) + i % 3];
    if (!cholesky(C, 3)) return e;
    e.log_evidence = fitted + std::log(density(fitter, C, e.force, normal, grasped));
    return e;
  }

 private:
  static constexpr int kForces = 32;  // that are summed up
  static constexpr double kDensest = 1.6;  // logarithm of what no density of pushes is above
  static constexpr double kTurn = 6.283185307179586;

  // The mean density of pushes over the forces that explain, `L` being the factor of their
  // covariance: against the normal distribution that the fit assumes of their sizes.
  double density(const ForceFitter& fitter, const double* L, const Vec3& force, const Vec3& normal,
                 bool grasped) const {
    double sum = 0.0;
    for (const Vec3& s : spread_) {
      Fit fit;
      fit.force = force + Vec3{L[0] * s.x, L[3] * s.x + L[4] * s.y, L[6] * s.x + L[7] * s.y + L[8] * s.z};
      const double size = norm(fit.force);
      fit.cosine = size > 0.0 ? -dot(normal, fit.force) / size : 0.0;
      if (!grasped && fit.cosine <= 0.0) continue;
      const double beyond = grasped ? 0.0 : 0.5 * fitter.cone_cost(fit.cosine);
      sum += std::exp(fitter.log_prior(fit, grasped) - beyond);
    }
    return sum / kForces;
  }

  const PlaceSettings& settings_;
  Vec3 spread_[kForces];
};

}  // namespace touchline
