// SPDX-License-Identifier: Apache-2.0
// The starts of one body side by side in lanes: what a force at each does to the whitened rows.
// The numbers are the same to the last bit however many lanes there are.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <limits>
#include <vector>

#include "touchline/detail/localizer/pair_view.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

// The starts of one body: the wrench of a force at each, in those coordinates z of the force in which
// its normal equations are the identity: f = turn^T z.
class StartLanes {
 public:
  explicit StartLanes(std::size_t starts) {
    const std::size_t blocks = (starts + kLanes - 1) / kLanes;
    points_.resize(blocks * 3);
    targets_.resize(blocks * 3);
    turns_.resize(blocks * 6);
    normals_.resize(blocks * 3);
    beyond_.resize(blocks);
  }

  // `points`: where they were when the rows felt them. The normal equations of a wrench on the body:
  // `N` (6, 6), of which a row has `stride` numbers, and `h` (6). `force_scale`: of forces that cannot
  // be seen [N].
  void fill(const Vec3* points, const Vec3* normals, int count, const double* N, int stride,
            const double* h, double force_scale) {
    count_ = count;
    for (int i = 0; i < blocks() * kLanes; ++i) clear(i);
    for (int i = 0; i < count; ++i) place(i, points[i], normals[i], N, stride, h, force_scale);
  }

  int count() const { return count_; }
  int blocks() const { return (count_ + kLanes - 1) / kLanes; }
  // Where it was [m].
  const Lanes* point(int block) const { return points_.data() + block * 3; }
  const Lanes* target(int block) const { return targets_.data() + block * 3; }
  // The lower triangle of `turn`, row by row: row c is the force of z_c.
  const Lanes* turn(int block) const { return turns_.data() + block * 6; }
  const Lanes* normal(int block) const { return normals_.data() + block * 3; }
  // Infinite for what is no start.
  const Lanes& beyond(int block) const { return beyond_[block]; }

 private:
  void clear(int i) {
    const int block = i / kLanes, k = i % kLanes;
    for (int c = 0; c < 3; ++c) {
      set_lane(points_[3 * block + c], k, 0.0);
      set_lane(targets_[3 * block + c], k, 0.0);
      set_lane(normals_[3 * block + c], k, 0.0);
    }
    for (int c = 0; c < 6; ++c) set_lane(turns_[6 * block + c], k, 0.0);
    set_lane(beyond_[block], k, std::numeric_limits<double>::infinity());
  }

  void place(int i, const Vec3& p, const Vec3& normal, const double* N, int stride,
             const double* h, double force_scale) {
    const int block = i / kLanes, k = i % kLanes;
    const double ridge = 1.0 / (force_scale * force_scale);
    // row . f + moments . (p x f) = f . (row + moments x p)
    const auto at_point = [&p](const double* w, int step) {
      return Vec3{w[0], w[step], w[2 * step]} +
             cross(Vec3{w[3 * step], w[4 * step], w[5 * step]}, p);
    };
    double A[9] = {ridge, 0, 0, 0, ridge, 0, 0, 0, ridge}, g[3], T[9], loads[18];
    for (int r = 0; r < 6; ++r) {
      const Vec3 row = at_point(N + stride * r, 1);
      for (int c = 0; c < 3; ++c) loads[3 * r + c] = component(row, c);
    }
    for (int c = 0; c < 3; ++c) {
      g[c] = component(at_point(h, 1), c);
      const Vec3 column = at_point(loads + c, 3);
      for (int r = c; r < 3; ++r) A[3 * r + c] += component(column, r);
    }
    if (!cholesky(A, 3)) return;
    invert_lower(A, 3, T);
    const double turn[6] = {T[0], T[3], T[4], T[6], T[7], T[8]};
    for (int c = 0; c < 6; ++c) set_lane(turns_[6 * block + c], k, turn[c]);
    for (int c = 0; c < 3; ++c) {
      set_lane(points_[3 * block + c], k, component(p, c));
      set_lane(targets_[3 * block + c], k, times(turn, g, c));
      set_lane(normals_[3 * block + c], k, component(normal, c));
    }
    set_lane(beyond_[block], k, 0.0);
  }

  // Row c of a lower matrix of six numbers, times a vector.
  static double times(const double* lower, const double* x, int c) {
    if (c == 0) return lower[0] * x[0];
    if (c == 1) return lower[1] * x[0] + lower[2] * x[1];
    return lower[3] * x[0] + lower[4] * x[1] + lower[5] * x[2];
  }

  std::vector<Lanes> points_, targets_, turns_, normals_, beyond_;
  int count_ = 0;
};

}  // namespace touchline
