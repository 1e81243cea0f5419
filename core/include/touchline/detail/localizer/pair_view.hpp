// SPDX-License-Identifier: Apache-2.0
// What one measurement says of contacts on any two bodies of a segment, to be worked on for longer
// than the instant. It keeps where the bodies were, and what unit wrenches on each do to all rows.
// No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/measurement.hpp"

namespace touchline {

class PairView {
 public:
  static constexpr int kRows = 64;  // beyond it nothing is searched

  PairView(const Posture& posture, const LinkSurfaces& surfaces, std::size_t rows, int segments)
      : posture_(&posture),
        surfaces_(&surfaces),
        values_(rows),
        white_(rows),
        covariance_(rows * rows) {
    std::size_t most = 0;
    for (int g = 0; g < segments; ++g) most = std::max(most, surfaces.bodies(g).size());
    maps_.resize(most * rows * 6);
    white_maps_.resize(most * rows * 6);
    feels_.resize(most * rows);
    poses_.resize(most);
    twists_.resize(most);
  }

  // Takes what `measurement` has read of segment g, `lag` [s] old; false if that is too much.
  bool take(int g, double lag, const Measurement& measurement) {
    g_ = g;
    lag_ = measurement.lag(lag);
    has_wrench_ = measurement.has_wrench();
    rows_ = measurement.size();
    if (rows_ > kRows) return false;
    measurement.values(values_.data(), 1);
    measurement.covariance(covariance_.data());
    std::copy_n(values_.data(), rows_, white_.data());
    measurement.whiten(white_.data(), 1);
    for (int b = 0; b < bodies(); ++b) {
      poses_[b] = posture_->pose(node(b));
      twists_[b] = posture_->twist(node(b));
      double* own = maps_.data() + b * 6 * rows_;
      double* white = white_maps_.data() + b * 6 * rows_;
      for (int i = 0; i < 6; ++i) {
        double w[6] = {};
        w[i] = 1.0;
        measurement.load(node(b), touchline::load(w), lag_, own + i, 6);
      }
      std::copy_n(own, 6 * rows_, white);
      for (int i = 0; i < 6; ++i) measurement.whiten(white + i, 6);
      for (int r = 0; r < rows_; ++r) feels_[b * rows_ + r] = measurement.feels(r, node(b));
    }
    return true;
  }

  int segment() const { return g_; }
  int rows() const { return rows_; }
  int bodies() const { return static_cast<int>(surfaces_->bodies(g_).size()); }
  int node(int body) const { return surfaces_->bodies(g_)[body].node; }
  const LinkSurfaces& surfaces() const { return *surfaces_; }
  // The measured numbers, and the same to the scale of the noise.
  const double* values() const { return values_.data(); }
  const double* white_values() const { return white_.data(); }
  // What unit wrenches on a body do to the rows (rows, 6), and the same to the scale of the noise.
  const double* map(int body) const { return maps_.data() + body * 6 * rows_; }
  const double* white_map(int body) const { return white_maps_.data() + body * 6 * rows_; }
  // The lower triangle of the covariance of all rows.
  const double* covariance() const { return covariance_.data(); }

  Vec3 to_world(const Vec3& p, int body) const { return poses_[body].R * p + poses_[body].p; }
  Vec3 to_body(const Vec3& p, int body) const {
    return transposed_times(poses_[body].R, p - poses_[body].p);
  }
  Vec3 turn_to_world(const Vec3& v, int body) const { return poses_[body].R * v; }
  // The point of a surface nearest to a point of the world, in world; `face` is -1 beyond `limit`.
  SurfacePoint nearest(int surface, int body, const Vec3& target, double limit) const {
    SurfacePoint p = (*surfaces_)[surface].mesh.nearest_to_point(to_body(target, body), limit);
    p.point = to_world(p.point, body);
    p.normal = turn_to_world(p.normal, body);
    return p;
  }

  // Where a point of a body was when the rows felt it.
  Vec3 earlier(const Vec3& p, int body) const {
    const Spatial& v = twists_[body];
    return p - lag_ * (v.linear + cross(v.angular, p));
  }

  // Independent equations for a contact on each of two bodies: the rows of the wrench, and those
  // that feel only one of the two; without a wrench those that feel either.
  int rank(int a, int b) const {
    int count = has_wrench_ ? 6 : 0;
    for (int i = count; i < rows_; ++i) {
      const bool one = feels_[a * rows_ + i], other = feels_[b * rows_ + i];
      count += has_wrench_ ? one != other : one || other;
    }
    return count;
  }
  // Of any two bodies.
  int most_rank() const {
    int most = 0;
    for (int a = 0; a < bodies(); ++a) {
      for (int b = a; b < bodies(); ++b) most = std::max(most, rank(a, b));
    }
    return most;
  }
  bool has_wrench() const { return has_wrench_; }

 private:
  const Posture* posture_;
  const LinkSurfaces* surfaces_;
  std::vector<Pose> poses_;      // of the bodies, at that instant
  std::vector<Spatial> twists_;  // and how they moved
  std::vector<double> values_, white_, covariance_, maps_, white_maps_;
  std::vector<char> feels_;  // per body and row
  int g_ = 0, rows_ = 0;
  bool has_wrench_ = false;
  double lag_ = 0.0;
};

}  // namespace touchline
