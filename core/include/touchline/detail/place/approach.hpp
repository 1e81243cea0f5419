// SPDX-License-Identifier: Apache-2.0
// How plausible it is that a push arrives at a point along its force. No allocation.
// Theory: docs/theory.md, section 5.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/place/hypothesis.hpp"
#include "touchline/detail/place/link_surfaces.hpp"

namespace touchline {

// Logarithm of it: a push comes not from inside another link, and hardly through a narrow gap of
// less than a finger. A point is inside a link if a line from it leaves the link more often
// than it enters, both ahead and behind: links overlap, and a mesh may have holes.
inline double approach(const LinkSurfaces& surfaces, const Vec3& point, const Vec3& force,
                       const PlaceSettings& settings) {
  constexpr double kHere = 1e-6;  // [m] the surface that the push itself meets
  constexpr double kFar = std::numeric_limits<double>::infinity();
  const double size = norm(force);
  if (size == 0.0) return 0.0;
  const ForceLine line{point, (1.0 / size) * force};
  double gap = kFar, depth = 0.0;
  for (const LinkSurface& surface : surfaces.all()) {
    // From farther away a link neither holds the point nor narrows the gap.
    if (!surface.mesh.within(surfaces.to_node(point, surface.node), settings.finger + kHere)) continue;
    const ForceLine local = surfaces.to_node(line, surface.node);
    int ahead = 0, behind = 0;
    double way = kFar;  // back to where the line enters this link
    surface.mesh.crossings(local, [&](const Crossing& c) {
      const int entry = dot(c.normal, local.direction) < 0.0 ? 1 : -1;
      if (c.t > kHere) ahead -= entry;
      if (c.t > -kHere) return;
      behind += entry;
      gap = std::min(gap, -c.t);
      if (entry > 0) way = std::min(way, -c.t);
    });
    if (ahead > 0 && behind > 0) depth = std::max(depth, way);
  }
  if (depth > 0.0) return std::max(-settings.inside_most, -depth / settings.inside_depth);
  return settings.gap_power *
         std::log(std::clamp(gap / settings.finger, settings.least_gap, 1.0));
}

}  // namespace touchline
