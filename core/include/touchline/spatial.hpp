// SPDX-License-Identifier: Apache-2.0
// Spatial algebra: 3-vectors, rotations, twists and wrenches ([linear; angular] and
// [force; moment], both about one stated point).
#pragma once

#include <cmath>

namespace touchline {

struct Vec3 {
  double x = 0.0, y = 0.0, z = 0.0;
};

inline Vec3 operator+(const Vec3& a, const Vec3& b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec3 operator-(const Vec3& a, const Vec3& b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec3 operator*(double s, const Vec3& a) { return {s * a.x, s * a.y, s * a.z}; }
inline double dot(const Vec3& a, const Vec3& b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec3 cross(const Vec3& a, const Vec3& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A rotation or an inertia, by columns.
struct Mat3 {
  Vec3 x{1.0, 0.0, 0.0}, y{0.0, 1.0, 0.0}, z{0.0, 0.0, 1.0};
};

inline Vec3 operator*(const Mat3& m, const Vec3& v) { return v.x * m.x + v.y * m.y + v.z * m.z; }
inline Mat3 operator*(const Mat3& a, const Mat3& b) { return {a * b.x, a * b.y, a * b.z}; }
// m^T v without forming the transpose.
inline Vec3 transposed_times(const Mat3& m, const Vec3& v) {
  return {dot(m.x, v), dot(m.y, v), dot(m.z, v)};
}

// Pose of a frame B in A: x_A = R x_B + p.
struct Pose {
  Mat3 R;
  Vec3 p;
};

// A twist [v; w], a momentum [l; k] or a wrench [f; m].
struct Spatial {
  Vec3 linear, angular;
};

inline Spatial operator+(const Spatial& a, const Spatial& b) {
  return {a.linear + b.linear, a.angular + b.angular};
}
inline Spatial operator-(const Spatial& a, const Spatial& b) {
  return {a.linear - b.linear, a.angular - b.angular};
}
inline Spatial operator*(double s, const Spatial& a) { return {s * a.linear, s * a.angular}; }
inline double dot(const Spatial& a, const Spatial& b) {
  return dot(a.linear, b.linear) + dot(a.angular, b.angular);
}

// v x* H for a twist v and a momentum or wrench H.
inline Spatial cross_force(const Spatial& v, const Spatial& H) {
  return {cross(v.angular, H.linear), cross(v.linear, H.linear) + cross(v.angular, H.angular)};
}

// A wrench from frame B to A, with the pose of B in A.
inline Spatial wrench_to_parent(const Pose& X, const Spatial& w) {
  const Vec3 f = X.R * w.linear;
  return {f, X.R * w.angular + cross(X.p, f)};
}
// A wrench from frame A to B, with the pose of B in A.
inline Spatial wrench_to_child(const Pose& X, const Spatial& w) {
  return {transposed_times(X.R, w.linear),
          transposed_times(X.R, w.angular - cross(X.p, w.linear))};
}

inline bool is_finite(const Spatial& a) {
  return std::isfinite(dot(a, a));
}

inline void store(const Spatial& a, double* out) {
  const double values[6] = {a.linear.x,  a.linear.y,  a.linear.z,
                            a.angular.x, a.angular.y, a.angular.z};
  for (int i = 0; i < 6; ++i) out[i] = values[i];
}

}  // namespace touchline
