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
#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class SurfaceEvidence {
 public:
  // `settings` stay the caller's.
  explicit SurfaceEvidence(const PlaceSettings& settings) : settings_(settings), fitter_(settings) {
    // Points of a normal distribution in three dimensions, spread evenly: an additive recurrence,
    // whose ratio is the root of x^4 = x + 1, by Box and Muller.
    constexpr double kRatio[4] = {0.8566748838545029, 0.7338918566271260, 0.6287067210378087,
                                  0.5385972572236101};
    for (int k = 0; k < kForces; ++k) {
      double u[4];
      for (int i = 0; i < 4; ++i) u[i] = std::fmod(0.5 + (k + 1) * kRatio[i], 1.0);
      const double a = std::sqrt(-2.0 * std::log(u[0])), b = std::sqrt(-2.0 * std::log(u[2]));
      spread_[0][k] = a * std::cos(kTurn * u[1]);
      spread_[1][k] = a * std::sin(kTurn * u[1]);
      spread_[2][k] = b * std::cos(kTurn * u[3]);
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
    Explained e;
    double A[9], f[3], H[25], g[5], w[6], step[5], P[25];
    fitter_.force_terms(q, point, A, f);
    if (!cholesky(A, 3)) return e;
    solve_cholesky(A, 3, f);
    e.force = {f[0], f[1], f[2]};
    // The place is free within the patch: one step from its middle.
    const double scale = 1.0 / (settings_.force_scale * settings_.force_scale);
    fitter_.information(q, point, normal, e.force, radius, H, g);
    for (int i = 0; i < 3; ++i) g[i] -= scale * f[i];
    std::copy(H, H + 25, P);
    if (!invert_by_rows<5>(P)) return e;
    wrench_of(point, e.force, w);
    double cost = q(w) + scale * dot(e.force, e.force);
    for (int i = 0; i < 5; ++i) {
      step[i] = 0.0;
      for (int j = 0; j < 5; ++j) step[i] += P[5 * i + j] * g[j];
      cost -= step[i] * g[i];
    }
    if (!cholesky_by_rows<5>(H, kSingular)) return e;
    const double fitted = -0.5 * (cost + log_determinant(H, 5)) - 2.0 * std::log(radius);
    if (fitted + kDensest < worst) return e;
    e.force = e.force + Vec3{step[0], step[1], step[2]};
    double C[9];
    for (int i = 0; i < 9; ++i) C[i] = P[5 * (i / 3) + i % 3];
    if (!cholesky(C, 3)) return e;
    e.log_evidence = fitted + std::log(density(C, e.force, normal, grasped));
    return e;
  }

 private:
  static constexpr int kForces = 32;  // that are summed up
  static constexpr double kDensest = 1.6;  // logarithm of what no density of pushes is above
  static constexpr double kSingular = 1e-13;  // of a diagonal: less is left by rounding
  static constexpr double kTurn = 6.283185307179586;

  // The mean density of pushes over the forces that explain, `L` being the factor of their
  // covariance: against the normal distribution that the fit assumes of their sizes.
  double density(const double* L, const Vec3& force, const Vec3& normal, bool grasped) const {
    double sum = 0.0;
    for (int i = 0; i < kForces; i += kLanes) {
      const Lanes s[3] = {load_lanes(spread_[0] + i), load_lanes(spread_[1] + i), load_lanes(spread_[2] + i)};
      const BasicVec3<Lanes> f{force.x + L[0] * s[0], force.y + (L[3] * s[0] + L[4] * s[1]),
                               force.z + (L[6] * s[0] + L[7] * s[1] + L[8] * s[2])};
      const Lanes square = f.x * f.x + f.y * f.y + f.z * f.z;
      const Lanes cosine = -(normal.x * f.x + normal.y * f.y + normal.z * f.z) / root(square);
      for (int k = 0; k < kLanes; ++k)
        sum += fitter_.density(lane(square, k), lane(square, k) > 0.0 ? lane(cosine, k) : 0.0, grasped);
    }
    return sum / kForces;
  }

  const PlaceSettings& settings_;
  ForceFitter fitter_;
  double spread_[3][kForces];  // x, y and z of each
};

}  // namespace touchline
