// SPDX-License-Identifier: Apache-2.0
// What the measurements say if the contact is on one body: its line of force action, and where the
// body was when they were true. And a candidate: one point of that body, with its force.
// Theory: docs/theory.md, section 5.4.
#pragma once

#include <algorithm>
#include <cmath>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/hypothesis.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/past.hpp"
#include "touchline/detail/place/quadratic.hpp"

namespace touchline {

struct Candidate {
  int surface = -1;  // index of the link's surface
  int place = -1;    // of a triangle near the point, where one is known
  Vec3 point, normal;
  Fit fit;
  int view = 0;          // of the bodies looked at
  double radius = 0.0;   // of the region that it stands for, 0: a point [m]
  double weight = 0.0;   // log of the posterior, then the probability
  double along[3] = {};  // covariance of the two tangent coordinates: 00, 01, 11
};

// The line of force action of a wrench (19).
inline ForceLine line_of(const Spatial& w) {
  const double size2 = dot(w.linear, w.linear);
  return {(1.0 / size2) * cross(w.linear, w.angular), (1.0 / std::sqrt(size2)) * w.linear};
}

struct View {
  int body = -1;  // of the segment's
  int node = -1;
  const std::vector<int>* surfaces = nullptr;
  Quadratic q;
  bool line = false;   // is there a line of force action?
  bool found = false;  // has it been worked out?
  double least = 0.0;  // chi2 of the best wrench, forces and moments
  double floor = 0.0;  // chi2 that no point of the body goes below
  double pitch = 0.0;
  Spatial wrench;      // the pure force that explains best
  bool met = false;    // does its line meet the body, and steeply enough?
  bool steep = false;
  double width = 0.0;  // log of how much motion adds to the spread of the measurements

  // Where a point of the body was at the time that the filtered wrench speaks of.
  Vec3 earlier(const Vec3& point) const { return before + back * (point - now); }
  // The line of points of that time, as it is carried along.
  ForceLine later_line() const {
    const ForceLine line = line_of(wrench);
    const Vec3 direction = onward(line.direction);
    return {now + onward(line.origin - before), (1.0 / norm(direction)) * direction};
  }

  // The body is at `here`, and was at `mean` when it felt the filtered wrench of `force` [N].
  void allow_for_motion(const Pose& here, const Mean& mean, double force, const Doubt& doubt) {
    const Mat3& R = here.R;
    const Mat3& M = mean.pose.R;
    now = here.p;
    before = mean.pose.p;
    back = {M * Vec3{R.x.x, R.y.x, R.z.x}, M * Vec3{R.x.y, R.y.y, R.z.y},
            M * Vec3{R.x.z, R.y.z, R.z.z}};  // M R^T
    q.shift({{}, mean.moment});
    const Vec3 x = back.x - Vec3{1.0, 0.0, 0.0}, y = back.y - Vec3{0.0, 1.0, 0.0},
               z = back.z - Vec3{0.0, 0.0, 1.0};
    const double way = norm(now - before) + doubt.reach * (norm(x) + norm(y));
    const double angle2 = 0.5 * (dot(x, x) + dot(y, y) + dot(z, z));
    const double moment = (doubt.way * way + doubt.turn * angle2) * force;
    if (moment > 1e-6) width = loosen(q, moment);
  }

  // How well any wrench at all explains; no point of the body does better.
  void begin() {
    std::copy(q.information, q.information + 36, factor_);
    line = cholesky(factor_, 6, 1e-9);
    if (!line) {  // wrenches of some hundred newtons are all that there are
      std::copy(q.information, q.information + 36, factor_);
      for (int i = 0; i < 6; ++i) factor_[7 * i] += kRidge;
      if (!cholesky(factor_, 6, 1e-15)) return;
    }
    std::copy(q.vector, q.vector + 6, best_);
    solve_cholesky(factor_, 6, best_);
    floor = least = std::max(0.0, q(best_));
  }

  // The most likely wrench among those of one pure force: f . m = 0.
  void find_line() {
    double w[6];
    std::copy(best_, best_ + 6, w);
    for (int pass = 0; pass < 3; ++pass) {
      const double g[6] = {w[3], w[4], w[5], w[0], w[1], w[2]};
      double step[6];
      std::copy(g, g + 6, step);
      solve_cholesky(factor_, 6, step);
      double power = 0.0, variance = 0.0;
      for (int i = 0; i < 3; ++i) power += w[i] * w[3 + i];
      for (int i = 0; i < 6; ++i) variance += g[i] * step[i];
      if (!(variance > 0.0)) break;
      if (pass == 0) pitch = power / std::sqrt(variance);
      for (int i = 0; i < 6; ++i) w[i] -= power / variance * step[i];
      if (power * power < kExact * kExact * variance) break;
    }
    found = true;
    floor = std::max(0.0, q(w));
    wrench = {{w[0], w[1], w[2]}, {w[3], w[4], w[5]}};
    line = dot(wrench.linear, wrench.linear) > 1e-12;
  }

 private:
  static constexpr double kRidge = 1e-7;        // information on any wrench, where there is none
  static constexpr double kExact = 1e-6;        // sigmas of the pitch that is left

  // A vector fixed on the body, from that time to now.
  Vec3 onward(const Vec3& v) const {
    const Vec3 yz = cross(back.y, back.z), zx = cross(back.z, back.x), xy = cross(back.x, back.y);
    return (1.0 / dot(back.x, yz)) * Vec3{dot(yz, v), dot(zx, v), dot(xy, v)};
  }

  Vec3 now, before;                // the body's origin
  Mat3 back = identity<double>();  // turns vectors fixed on the body to where they were
  double factor_[36] = {}, best_[6] = {};
};

}  // namespace touchline
