// SPDX-License-Identifier: Apache-2.0
// The best few of many candidates, apart from each other.
// Theory: docs/theory.md, section 5.6.
#pragma once

#include <algorithm>
#include <limits>

#include "touchline/detail/place/view.hpp"

namespace touchline {

inline Candidate* worst(Candidate* starts, int count) {
  return std::max_element(starts, starts + count, [](const Candidate& a, const Candidate& b) {
    return a.fit.cost() < b.fit.cost();
  });
}

// Keeps the best few, apart from each other.
inline int insert(Candidate* starts, int most, int found, const Candidate& k, double apart) {
  for (int i = 0; i < found; ++i) {
    if (norm(starts[i].point - k.point) < apart) {
      if (k.fit.cost() < starts[i].fit.cost()) starts[i] = k;
      return found;
    }
  }
  if (found < most) {
    starts[found] = k;
    return found + 1;
  }
  Candidate* last = worst(starts, found);
  if (k.fit.cost() < last->fit.cost()) *last = k;
  return found;
}

// From this cost on a candidate changes nothing in the best few.
inline double beaten(const Candidate* starts, int most, int found) {
  if (found < most) return std::numeric_limits<double>::infinity();
  double cost = 0.0;
  for (int i = 0; i < found; ++i) cost = std::max(cost, starts[i].fit.cost());
  return cost;
}

}  // namespace touchline
