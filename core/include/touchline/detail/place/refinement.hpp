// SPDX-License-Identifier: Apache-2.0
// Moves a candidate over its surface to where it explains best. No allocation.
// Theory: docs/theory.md, section 5.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/view.hpp"

namespace touchline {

class Refinement {
 public:
  Refinement(const LinkSurfaces& surfaces, const ForceFitter& fitter)
      : surfaces_(surfaces), fitter_(fitter), settings_(fitter.settings()) {}

  // To the best place nearby; where it does not go straight downhill, within about `settle_around`.
  // As long as there are units of work `left` (`PlaceTuning::search_work`), which it takes from.
  void improve(const View& view, Candidate& k, int& left) const {
    improve(view, k, settings_.fine, settings_.settle_around, left);
  }

  // As exactly as `finest` [m], and within about `around` [m].
  void improve(const View& view, Candidate& k, double finest, double around, int& left) const {
    if (!descend(view, k, left)) settle(view, k, finest, around, left);
  }

  // Goes downhill by Gauss-Newton steps; returns whether that was all there was to do.
  bool descend(const View& view, Candidate& k, int& left) const {
    bool arrived = false;
    for (int i = 0; i < kSteps && !arrived && left > 0; ++i) {
      double H[25], g[5];
      left -= kStep;
      fitter_.information(view.q, view.earlier(k.point), k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) break;
      solve_cholesky(H, 5, g);
      Vec3 s, t;
      tangents(k.normal, s, t);
      Vec3 step = g[3] * s + g[4] * t;
      const double length = norm(step);
      if (length > settings_.farthest_step) step = (settings_.farthest_step / length) * step;
      arrived = length < settings_.arrived;
      if (!arrived && !try_point(view, k, k.point + step, norm(step), left)) break;
    }
    return arrived && k.fit.cone < 1.0;
  }

  // Where the friction cone or an edge stands in the way: smaller and smaller trials around, down
  // to `finest` [m].
  void settle(const View& view, Candidate& k, double finest, double around, int& left) const {
    for (double radius = 0.5 * around; radius > finest; radius *= 0.5) {
      for (int round = 0; round < kRounds && better_around(view, k, radius, left); ++round) {
      }
    }
  }

 private:
  static constexpr int kSteps = 8, kRounds = 3;  // a bound on time
  // Units of work: of a step, beside the point that it tries; of a point, beside looking for it.
  static constexpr int kStep = 3, kPoint = 3;
  static constexpr double kBetter = 1e-6;       // of chi2: less is rounding

  bool better_around(const View& view, Candidate& k, double radius, int& left) const {
    Vec3 s, t;
    tangents(k.normal, s, t);
    const Vec3 centre = k.point;
    bool better = false;
    constexpr double kHalf = 0.5, kSine = 0.8660254037844386;  // of 60 degrees
    for (const double side : {1.0, -1.0}) {
      for (const Vec3& way : {s, kHalf * s + kSine * t, kHalf * s - kSine * t}) {
        if (left <= 0) return false;
        better |= try_point(view, k, centre + (side * radius) * way, radius, left);
      }
    }
    return better;
  }

  // `beside` [m]: how far from the target there is a point of the surface.
  bool try_point(const View& view, Candidate& k, const Vec3& target, double beside,
                 int& left) const {
    // Nothing farther away than that is of interest.
    const double limit = std::min(settings_.surface_reach, 1.000001 * beside);
    int looked = 0;
    const SurfacePoint p = surfaces_.nearest(k.surface, target, limit, k.place, looked);
    left -= kPoint + looked;
    if (p.face < 0) return false;
    k.place = p.place;
    const bool grasped = surfaces_[k.surface].graspable;
    const double cost = k.fit.cost();
    constexpr double kInfinity = std::numeric_limits<double>::infinity();
    const Fit fit =
        fitter_.fit(view.q, view.earlier(p.point), p.normal, grasped, kInfinity, cost);
    if (!(fit.cost() < cost - kBetter)) return false;
    k.point = p.point;
    k.normal = p.normal;
    k.fit = fit;
    return true;
  }

  const LinkSurfaces& surfaces_;
  const ForceFitter& fitter_;
  const PlaceSettings& settings_;
};

}  // namespace touchline
