// SPDX-License-Identifier: Apache-2.0
// What the evidence for links says of one body.
// Theory: docs/theory.md, section 5.9.
#pragma once

#include "touchline/detail/model/spatial.hpp"

namespace touchline {

// Its probability, and its best patch.
struct BodyShare {
  int node = -1, surface = -1;
  double share = 0.0;
  Vec3 point, normal, force;  // in the frame of the node [m, 1, N]
  double radius = 0.0;        // one sigma of the places that the patch stands for [m]
};

}  // namespace touchline
