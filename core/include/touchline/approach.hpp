// SPDX-License-Identifier: Apache-2.0
// How plausible it is that a push arrives at a point along its force. No allocation.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/hypothesis.hpp"
#include "touchline/link_surfaces.hpp"

namespace touchline {

// Logarithm of it: a push comes not from inside another link, and hardly through a narrow gap of
// less than `finger` [m].
inline double approach(const LinkSurfaces& surfaces, const Vec3& point, const Vec3& force,
                       double finger) {
  const double size = norm(force);
  if (size == 0.0) return 0.0;
  const ForceLine line{point, (1.0 / size) * force};
  double nearest = -std::numeric_limits<double>::infinity();
  bool inside = false;
  for (const LinkSurface& surface : surfaces.all()) {
    const ForceLine local = surfaces.to_node(line, surface.node);
    surface.mesh.crossings(local, [&](const Crossing& c) {
      if (c.t > -1e-6 || c.t <= nearest) return;
      nearest = c.t;
      inside = dot(c.normal, local.direction) < 0.0;
    });
  }
  if (inside) return std::max(-6.0, nearest / 3e-3);
  return 2.0 * std::log(std::clamp(-nearest / finger, 0.1, 1.0));
}

}  // namespace touchline
