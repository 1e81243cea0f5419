// SPDX-License-Identifier: Apache-2.0
// Which rows of a detector can a contact load at all? Where a sensor stands right behind a joint,
// nothing lies between them: what the torque has beyond the sensor's moment is an error of one of
// the two.
// Theory: docs/theory.md, section 3.4.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/detail/place/link_surfaces.hpp"

namespace touchline {

// Per row: is there a body with mass or a surface that its segment has outboard of its joint?
inline std::vector<char> loadable(const Observer& observer, const std::vector<DetectionRow>& rows,
                                  const std::vector<LinkSurface>& surfaces) {
  const Layout& layout = observer.layout();
  const std::vector<Node>& nodes = observer.tree().nodes();
  const auto there = [&](int node) {
    return nodes[node].mass > 0.0 ||
           std::any_of(surfaces.begin(), surfaces.end(),
                       [&](const LinkSurface& surface) { return surface.node == node; });
  };
  const auto beyond = [&](int node, int segment) {  // a sensor at which the segment ends
    const std::vector<int>& outer = layout.segments[segment].successors;
    return std::any_of(outer.begin(), outer.end(), [&](int s) {
      return layout.is_outboard(node, observer.sensors()[s].node);
    });
  };
  std::vector<char> found;
  for (const DetectionRow& row : rows) {
    bool any = row.joint < 0 || observer.joints()[row.joint].nodes.size() != 1;
    for (int i = 0; !any && i < static_cast<int>(nodes.size()); ++i) {
      const bool own = layout.is_outboard(i, observer.joints()[row.joint].nodes[0]);
      any = own && there(i) && !beyond(i, row.segment);
    }
    found.push_back(any);
  }
  return found;
}

}  // namespace touchline
