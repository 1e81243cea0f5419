// SPDX-License-Identifier: Apache-2.0
// What is known of a place, in all directions: chi2 grows by d^T G d with a way d from it.
// Theory: docs/theory.md, section 5.6.
#pragma once

#include <algorithm>
#include <cmath>

#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

inline double squared(const double* G, const Vec3& d) {
  const double v[3] = {d.x, d.y, d.z};
  double sum = 0.0;
  for (int i = 0; i < 3; ++i)
    for (int j = 0; j < 3; ++j) sum += v[i] * G[3 * i + j] * v[j];
  return std::max(0.0, sum);
}

// One sigma of a place across a direction, where it is least known [m].
inline double widest(const double* G, const Vec3& direction) {
  Vec3 s, t;
  tangents(direction, s, t);
  const double a = squared(G, s), c = squared(G, t);
  const double b = 0.5 * (squared(G, s + t) - a - c);
  const double least = 0.5 * (a + c - std::sqrt((a - c) * (a - c) + 4.0 * b * b));
  return 1.0 / std::sqrt(std::max(least, 1e-12));
}

}  // namespace touchline
