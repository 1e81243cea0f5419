// SPDX-License-Identifier: Apache-2.0
// Clamped or free: do forces on two sides oppose each other? Between segments that is seen: two
// forces of comparable size in opposite directions. No allocation per sample.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "touchline/spatial.hpp"

namespace touchline {

// Two forces of comparable size against each other.
inline bool opposed(const Vec3& a, const Vec3& b) {
  constexpr double kLeastForce = 5.0;            // N
  constexpr double kRatio = 0.3, kCosine = -0.5;  // of the smaller to the larger, of their angle
  const double x = norm(a), y = norm(b);
  return x > kLeastForce && y > kLeastForce && std::min(x, y) > kRatio * std::max(x, y) &&
         dot(a, b) < kCosine * (x * y);
}

// Since when something has held without a break.
class Lasting {
 public:
  static constexpr double kLeast = 0.02;  // for so long it must hold [s]

  bool follow(bool holds, double time) {
    if (!holds) since_ = kNever;
    if (holds && since_ == kNever) since_ = time;
    return holds && time - since_ >= kLeast;
  }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  double since_ = kNever;
};

class Clamping {
 public:
  explicit Clamping(std::size_t segments) : forces_(segments), lasting_(segments), is_(segments) {}

  // A sample: the segments' wrenches [N, Nm], what is not known NaN, and their levels.
  void step(double time, const double* wrenches, const double* levels) {
    for (std::size_t g = 0; g < forces_.size(); ++g) {
      const double* w = wrenches + 6 * g;
      forces_[g] = levels[g] > 0.0 ? Vec3{known(w[0]), known(w[1]), known(w[2])} : Vec3{};
    }
    for (std::size_t g = 0; g < forces_.size(); ++g) {
      const bool against = std::any_of(forces_.begin(), forces_.end(), [&](const Vec3& other) {
        return opposed(forces_[g], other);
      });
      is_[g] = lasting_[g].follow(against, time);
    }
  }

  // Has another segment's force opposed that on segment g for a while?
  bool between(int g) const { return is_[g]; }

 private:
  static double known(double x) { return x == x ? x : 0.0; }

  std::vector<Vec3> forces_;
  std::vector<Lasting> lasting_;
  std::vector<char> is_;
};

}  // namespace touchline
