// SPDX-License-Identifier: Apache-2.0
// What one measurement says of contacts on any two bodies of a segment, to be worked on for longer
// than the instant. It keeps where the bodies were, and what unit wrenches on each do to all rows.
// No allocation.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/localizer/pair.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/measurement.hpp"

namespace touchline {

class PairView {
 public:
  static constexpr int kRows = 64;  // beyond it nothing is searched

  // Of segment g.
  PairView(const Posture& posture, const LinkSurfaces& surfaces, std::size_t rows, int g)
      : posture_(&posture),
        surfaces_(&surfaces),
        g_(g),
        values_(rows),
        white_(rows) {
    const std::size_t most = surfaces.bodies(g).size();
    maps_.resize(most * rows * 6);
    information_.resize(most * most * 36);
    vector_.resize(most * 6);
    feels_.resize(most * rows);
    poses_.resize(most);
    twists_.resize(most);
  }

  // Takes what `measurement` has read of the segment, `lag` [s] old; false if that is too much.
  bool take(double lag, const Measurement& measurement) {
    lag_ = measurement.lag(lag);
    has_wrench_ = measurement.has_wrench();
    rows_ = measurement.size();
    if (rows_ > kRows) return false;
    measurement.values(values_.data(), 1);
    std::copy_n(values_.data(), rows_, white_.data());
    measurement.whiten(white_.data(), 1);
    square_ = 0.0;
    for (int r = 0; r < rows_; ++r) square_ += white_[r] * white_[r];
    for (int b = 0; b < bodies(); ++b) {
      poses_[b] = posture_->pose(node(b));
      twists_[b] = posture_->twist(node(b));
      double* own = maps_.data() + b * 6 * rows_;
      for (int i = 0; i < 6; ++i) {
        double w[6] = {};
        w[i] = 1.0;
        measurement.load(node(b), touchline::load(w), lag_, own + i, 6);
        measurement.whiten(own + i, 6);
      }
      for (int r = 0; r < rows_; ++r) feels_[b * rows_ + r] = measurement.feels(r, node(b));
    }
    for (int a = 0; a < bodies(); ++a) {
      double* h = vector_.data() + 6 * a;
      std::fill(h, h + 6, 0.0);
      for (int r = 0; r < rows_; ++r) {
        for (int i = 0; i < 6; ++i) h[i] += maps_[6 * (a * rows_ + r) + i] * white_[r];
      }
      for (int b = a; b < bodies(); ++b) multiply(a, b);
    }
    return true;
  }

  int segment() const { return g_; }
  int rows() const { return rows_; }
  int bodies() const { return static_cast<int>(surfaces_->bodies(g_).size()); }
  int node(int body) const { return surfaces_->bodies(g_)[body].node; }
  const LinkSurfaces& surfaces() const { return *surfaces_; }
  // The measured numbers.
  const double* values() const { return values_.data(); }
  // The normal equations of a wrench on each body, all to the scale of the noise: W_a^T W_b (6, 6),
  // W_a^T y (6) and y^T y, where W_a are the rows of unit wrenches on body a, and y is measured.
  const double* information(int a, int b) const {
    return information_.data() + 36 * (a * bodies() + b);
  }
  const double* vector(int body) const { return vector_.data() + 6 * body; }
  double square() const { return square_; }
  // Those of the wrenches on two bodies together: (12, 12), all of it, and (12).
  void information(int a, int b, double* N, double* h) const {
    const int of[2] = {a, b};
    for (int k = 0; k < 2; ++k) {
      std::copy_n(vector(of[k]), 6, h + 6 * k);
      for (int l = 0; l < 2; ++l) {
        const double* block = information(of[k], of[l]);
        for (int i = 0; i < 6; ++i) std::copy_n(block + 6 * i, 6, N + 12 * (6 * k + i) + 6 * l);
      }
    }
  }

  Vec3 to_world(const Vec3& p, int body) const { return poses_[body].R * p + poses_[body].p; }
  Vec3 to_body(const Vec3& p, int body) const {
    return transposed_times(poses_[body].R, p - poses_[body].p);
  }
  Vec3 turn_to_world(const Vec3& v, int body) const { return poses_[body].R * v; }
  Vec3 turn_to_body(const Vec3& v, int body) const { return transposed_times(poses_[body].R, v); }
  // A pair in the frames of its bodies, and back: in another view they are elsewhere.
  void to_bodies(Pair& s) const {
    for (PairEnd& e : s.ends) {
      e.point = to_body(e.point, e.body);
      e.normal = turn_to_body(e.normal, e.body);
    }
  }
  void to_world(Pair& s) const {
    for (PairEnd& e : s.ends) {
      e.point = to_world(e.point, e.body);
      e.normal = turn_to_world(e.normal, e.body);
    }
  }
  // The point of a surface nearest to a point of the world, in world; `face` is -1 beyond `limit`.
  // `near`: the place of a triangle in the mesh that may be near, if known. `looked`: see `Mesh`.
  SurfacePoint nearest(int surface, int body, const Vec3& target, double limit, int near,
                       int& looked) const {
    SurfacePoint p =
        (*surfaces_)[surface].mesh.nearest_to_point(to_body(target, body), limit, near, looked);
    p.point = to_world(p.point, body);
    p.normal = turn_to_world(p.normal, body);
    return p;
  }

  // `nearest` will be asked for what is near that place.
  void expect(int surface, int near) const { (*surfaces_)[surface].mesh.expect(near); }

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
  // W_a^T W_b, and its transpose.
  void multiply(int a, int b) {
    const double *A = maps_.data() + a * 6 * rows_, *B = maps_.data() + b * 6 * rows_;
    double* own = information_.data() + 36 * (a * bodies() + b);
    double* other = information_.data() + 36 * (b * bodies() + a);
    double sum[36] = {};
    for (int r = 0; r < rows_; ++r, A += 6, B += 6) {
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j < 6; ++j) sum[6 * i + j] += A[i] * B[j];
      }
    }
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) own[6 * i + j] = other[6 * j + i] = sum[6 * i + j];
    }
  }

  const Posture* posture_;
  const LinkSurfaces* surfaces_;
  int g_, rows_ = 0;
  std::vector<Pose> poses_;      // of the bodies, at that instant
  std::vector<Spatial> twists_;  // and how they moved
  std::vector<double> values_, white_, maps_, information_, vector_;
  double square_ = 0.0;
  std::vector<char> feels_;  // per body and row
  bool has_wrench_ = false;
  double lag_ = 0.0;
};

}  // namespace touchline
