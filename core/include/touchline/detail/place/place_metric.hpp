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

// The metric across a direction, along the two axes of its ellipse: first where a place is known
// least.
inline Beside across(const double* G, const Vec3& direction) {
  Vec3 s, t;
  tangents(direction, s, t);
  const double a = squared(G, s), c = squared(G, t);
  const double b = 0.5 * (squared(G, s + t) - a - c);
  const double root = std::sqrt((a - c) * (a - c) + 4.0 * b * b);
  const double turn = 0.5 * std::atan2(2.0 * b, a - c);
  const double sine = std::sin(turn), cosine = std::cos(turn);
  return {{cosine * t - sine * s, cosine * s + sine * t},
          {0.5 * (a + c - root), 0.5 * (a + c + root)}};
}

// One sigma of a place where it is known least [m].
inline double widest(const Beside& metric) {
  return 1.0 / std::sqrt(std::max(metric.weight[0], 1e-12));
}

}  // namespace touchline
