// SPDX-License-Identifier: Apache-2.0
// Clamped or free: do forces on two sides oppose each other? That is two forces of comparable size
// in opposite directions: of two segments, which is always seen, or of two contacts on one segment,
// where they can be told apart. No allocation per sample.
// Theory: docs/theory.md, section 7.2.
#pragma once

#include <algorithm>
#include <limits>
#include <vector>

#include "touchline/detail/classifier/tuning.hpp"
#include "touchline/detail/localizer/reports.hpp"

namespace touchline {

// Two forces of comparable size against each other.
inline bool opposed(const Vec3& a, const Vec3& b, const ClassifierTuning& t) {
  const double x = norm(a), y = norm(b);
  return x > t.opposed_force && y > t.opposed_force &&
         std::min(x, y) > t.opposed_ratio * std::max(x, y) &&
         dot(a, b) < t.opposed_cosine * (x * y);
}

// Since when something has held without a break.
class Lasting {
 public:
  // `least`: for so long it must hold [s].
  void follow(bool holds, double time, double least) {
    if (!holds) since_ = kNever;
    if (holds && since_ == kNever) since_ = time;
    is_ = holds && time - since_ >= least;
  }
  bool is() const { return is_; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  double since_ = kNever;
  bool is_ = false;
};

class Clamping {
 public:
  Clamping(std::size_t segments, const ClassifierTuning& tuning)  // which stays the caller's
      : tuning_(tuning), forces_(segments), between_(segments), sides_(segments) {}

  // A sample: the segments' wrenches [N, Nm], what is not known NaN, and their levels.
  void step(double time, const double* wrenches, const double* levels) {
    time_ = time;
    for (std::size_t g = 0; g < forces_.size(); ++g) {
      const double* w = wrenches + 6 * g;
      forces_[g] = levels[g] > 0.0 ? Vec3{known(w[0]), known(w[1]), known(w[2])} : Vec3{};
    }
    for (std::size_t g = 0; g < forces_.size(); ++g) {
      const bool against = std::any_of(forces_.begin(), forces_.end(), [&](const Vec3& other) {
        return opposed(forces_[g], other);
      });
      between_[g].follow(against, time, tuning_.opposed_time);
    }
  }

  // What is said of the contacts on segment g in that sample.
  void consider(int g, const Reports& reports) {
    Sides &sides = sides_[g], before = sides;
    for (int k = 0; k < Reports::kMost; ++k) {
      Side& side = sides.of[k];
      side = Side{};
      if (k >= reports.count()) continue;
      side.serial = reports[k].serial;
      for (const Side& earlier : before.of) {
        if (earlier.serial == side.serial) side = earlier;
      }
      bool against = false;
      for (int i = 0; i < reports.count(); ++i)
        against = against || opposed(reports[k].answer, reports[i].answer);
      side.lasting.follow(against, time_, tuning_.opposed_time);
    }
  }

  // Has a force opposed that of contact k on segment g for a while?
  bool operator()(int g, int k) const {
    return between_[g].is() || sides_[g].of[k].lasting.is();
  }

 private:
  struct Side {
    int serial = -1;
    Lasting lasting;
  };
  struct Sides {
    Side of[Reports::kMost];
  };

  static double known(double x) { return x == x ? x : 0.0; }
  bool opposed(const Vec3& a, const Vec3& b) const { return touchline::opposed(a, b, tuning_); }
  bool opposed(const Answer& a, const Answer& b) const {
    return placed(a) && placed(b) && opposed(a.force, b.force);
  }

  const ClassifierTuning& tuning_;
  std::vector<Vec3> forces_;
  std::vector<Lasting> between_;
  std::vector<Sides> sides_;
  double time_ = 0.0;
};

}  // namespace touchline
