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

// The starts of one body, whitened: what a force at each does to the rows, in those coordinates z
// of the force in which its normal equations are the identity: f = turn^T z.
class StartLanes {
 public:
  StartLanes(std::size_t starts, std::size_t rows) {
    const std::size_t blocks = (starts + kLanes - 1) / kLanes;
    loads_.resize(blocks * rows * 3);
    targets_.resize(blocks * 3);
    turns_.resize(blocks * 6);
    normals_.resize(blocks * 3);
    beyond_.resize(blocks);
  }

  // `points`: where they were when the rows felt them. `map` (rows, 6): what wrenches on the body do to whitened rows; `target` (rows): what is
  // measured; `force_scale`: of forces that cannot be seen [N].
  void fill(const Vec3* points, const Vec3* normals, int count, const double* map,
            const double* target, int rows, double force_scale) {
    count_ = count;
    rows_ = rows;
    for (int i = 0; i < blocks() * kLanes; ++i) clear(i);
    for (int i = 0; i < count; ++i) place(i, points[i], normals[i], map, target, force_scale);
  }

  int count() const { return count_; }
  int blocks() const { return (count_ + kLanes - 1) / kLanes; }
  int rows() const { return rows_; }
  const Lanes* load(int block) const { return loads_.data() + block * rows_ * 3; }
  const Lanes* target(int block) const { return targets_.data() + block * 3; }
  const Lanes* turn(int block) const { return turns_.data() + block * 6; }
  const Lanes* normal(int block) const { return normals_.data() + block * 3; }
  // Infinite for what is no start.
  const Lanes& beyond(int block) const { return beyond_[block]; }

 private:
  void clear(int i) {
    const int block = i / kLanes, k = i % kLanes;
    for (int r = 0; r < 3 * rows_; ++r) set_lane(loads_[3 * rows_ * block + r], k, 0.0);
    for (int c = 0; c < 3; ++c) {
      set_lane(targets_[3 * block + c], k, 0.0);
      set_lane(normals_[3 * block + c], k, 0.0);
    }
    for (int c = 0; c < 6; ++c) set_lane(turns_[6 * block + c], k, 0.0);
    set_lane(beyond_[block], k, std::numeric_limits<double>::infinity());
  }

  void place(int i, const Vec3& p, const Vec3& normal, const double* map, const double* target,
             double force_scale) {
    const int block = i / kLanes, k = i % kLanes;
    const double ridge = 1.0 / (force_scale * force_scale);
    double u[3 * PairView::kRows], A[9] = {ridge, 0, 0, 0, ridge, 0, 0, 0, ridge}, g[3] = {}, T[9];
    for (int r = 0; r < rows_; ++r) {
      const double* m = map + 6 * r;
      // f . row + (p x f) . moments = f . (row + moments x p)
      const Vec3 row = Vec3{m[0], m[1], m[2]} + cross(Vec3{m[3], m[4], m[5]}, p);
      for (int a = 0; a < 3; ++a) u[3 * r + a] = component(row, a);
      for (int a = 0; a < 3; ++a) {
        g[a] += u[3 * r + a] * target[r];
        for (int b = 0; b <= a; ++b) A[3 * a + b] += u[3 * r + a] * u[3 * r + b];
      }
    }
    if (!cholesky(A, 3)) return;
    invert_lower(A, 3, T);
    const double turn[6] = {T[0], T[3], T[4], T[6], T[7], T[8]};
    for (int c = 0; c < 6; ++c) set_lane(turns_[6 * block + c], k, turn[c]);
    for (int r = 0; r < rows_; ++r) {
      for (int c = 0; c < 3; ++c)
        set_lane(loads_[3 * (rows_ * block + r) + c], k, times(turn, u + 3 * r, c));
    }
    for (int c = 0; c < 3; ++c) {
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

  std::vector<Lanes> loads_, targets_, turns_, normals_, beyond_;
  int count_ = 0, rows_ = 0;
};

}  // namespace touchline
