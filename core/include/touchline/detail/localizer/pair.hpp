// SPDX-License-Identifier: Apache-2.0
// Two contacts that explain one measurement.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <limits>

#include "touchline/detail/localizer/settings.hpp"
#include "touchline/detail/model/spatial.hpp"

namespace touchline {

// One point of a pair, with its force.
struct PairEnd {
  int surface = -1, body = -1, node = -1;  // `body`: of the segment's
  int place = -1;  // of its triangle in the mesh, where it is known
  Vec3 point, normal, force;
  double along[3] = {};  // covariance of the two tangent coordinates
};

struct Pair {
  PairEnd ends[2];  // the more inboard one first
  double chi2 = 0.0, cost = std::numeric_limits<double>::infinity();
  double weight = 0.0;  // log of the evidence, then the probability
  int rank = 0;         // of the equations
};

// Are both points of two pairs nearer to each other than `distance`? Of the other one: its two points.
inline bool near(const Pair& pair, const Vec3& first, const Vec3& second, double distance) {
  const Vec3 a = pair.ends[0].point - first, b = pair.ends[1].point - second;
  return dot(a, a) < distance * distance && dot(b, b) < distance * distance;
}
inline bool near(const Pair& a, const Pair& b, double distance) {
  return near(a, b.ends[0].point, b.ends[1].point, distance);
}

}  // namespace touchline
