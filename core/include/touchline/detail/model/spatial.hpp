// SPDX-License-Identifier: Apache-2.0
// Spatial algebra: 3-vectors, rotations, twists and wrenches ([linear; angular] and
// [force; moment], both about one stated point). T is double, or several samples side by side.
// Theory: docs/theory.md, section 1.1.
#pragma once

#include <cmath>

// Calls of functions this small cost as much as the work in them.
#if defined(__GNUC__) || defined(__clang__)
#define TOUCHLINE_INLINE __attribute__((always_inline)) inline
#else
#define TOUCHLINE_INLINE inline
#endif

namespace touchline {

template <class T>
struct BasicVec3 {
  T x{}, y{}, z{};

  BasicVec3& operator+=(const BasicVec3& b) { return x += b.x, y += b.y, z += b.z, *this; }
  BasicVec3& operator-=(const BasicVec3& b) { return x -= b.x, y -= b.y, z -= b.z, *this; }
};

template <class A, class B>
using Product = decltype(A{} * B{});

template <class T>
BasicVec3<T> operator+(const BasicVec3<T>& a, const BasicVec3<T>& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
template <class T>
BasicVec3<T> operator-(const BasicVec3<T>& a, const BasicVec3<T>& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
template <class A, class B>
BasicVec3<Product<A, B>> operator*(const A& s, const BasicVec3<B>& a) {
  return {s * a.x, s * a.y, s * a.z};
}
template <class A, class B>
TOUCHLINE_INLINE Product<A, B> dot(const BasicVec3<A>& a, const BasicVec3<B>& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
template <class A, class B>
TOUCHLINE_INLINE BasicVec3<Product<A, B>> cross(const BasicVec3<A>& a, const BasicVec3<B>& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}

// A rotation or an inertia, by columns.
template <class T>
struct BasicMat3 {
  BasicVec3<T> x, y, z;
};

template <class A, class B>
TOUCHLINE_INLINE BasicVec3<Product<A, B>> operator*(const BasicMat3<A>& m, const BasicVec3<B>& v) {
  return {m.x.x * v.x + m.y.x * v.y + m.z.x * v.z, m.x.y * v.x + m.y.y * v.y + m.z.y * v.z,
          m.x.z * v.x + m.y.z * v.y + m.z.z * v.z};
}
template <class A, class B>
BasicMat3<Product<A, B>> operator*(const BasicMat3<A>& a, const BasicMat3<B>& b) {
  return {a * b.x, a * b.y, a * b.z};
}
// m^T v without forming the transpose.
template <class A, class B>
TOUCHLINE_INLINE BasicVec3<Product<A, B>> transposed_times(const BasicMat3<A>& m, const BasicVec3<B>& v) {
  return {dot(m.x, v), dot(m.y, v), dot(m.z, v)};
}

// A twist [v; w], a momentum [l; k] or a wrench [f; m].
template <class T>
struct BasicSpatial {
  BasicVec3<T> linear, angular;
};

template <class T>
BasicSpatial<T> operator+(const BasicSpatial<T>& a, const BasicSpatial<T>& b) {
  return {a.linear + b.linear, a.angular + b.angular};
}
template <class T>
BasicSpatial<T> operator-(const BasicSpatial<T>& a, const BasicSpatial<T>& b) {
  return {a.linear - b.linear, a.angular - b.angular};
}

using Vec3 = BasicVec3<double>;
using Mat3 = BasicMat3<double>;
using Spatial = BasicSpatial<double>;

inline double norm(const Vec3& v) { return std::sqrt(dot(v, v)); }

template <class T>
BasicMat3<T> identity() {
  const T zero{}, one = zero + 1.0;
  return {{one, zero, zero}, {zero, one, zero}, {zero, zero, one}};
}

// Pose of a frame B in A: x_A = R x_B + p.
template <class T>
struct BasicPose {
  BasicMat3<T> R = identity<T>();
  BasicVec3<T> p;
};
using Pose = BasicPose<double>;

// A wrench from frame B to A, with the pose of B in A.
template <class T>
TOUCHLINE_INLINE BasicSpatial<T> wrench_to_parent(const BasicPose<T>& X, const BasicSpatial<T>& w) {
  const BasicVec3<T> f = X.R * w.linear;
  return {f, X.R * w.angular + cross(X.p, f)};
}
// A wrench from frame A to B, with the pose of B in A.
template <class T>
TOUCHLINE_INLINE BasicSpatial<T> wrench_to_child(const BasicPose<T>& X, const BasicSpatial<T>& w) {
  return {transposed_times(X.R, w.linear),
          transposed_times(X.R, w.angular - cross(X.p, w.linear))};
}

template <class T>
BasicVec3<T> load_vector(const T* in) {
  return {in[0], in[1], in[2]};
}
template <class T>
BasicMat3<T> load_rotation(const T* in) {
  return {load_vector(in), load_vector(in + 3), load_vector(in + 6)};
}
template <class T>
BasicPose<T> load_pose(const T* in) {
  return {load_rotation(in), load_vector(in + 9)};
}
template <class T>
BasicSpatial<T> load(const T* in) {
  return {load_vector(in), load_vector(in + 3)};
}

template <class T>
void store(const BasicSpatial<T>& a, T* out) {
  out[0] = a.linear.x;
  out[1] = a.linear.y;
  out[2] = a.linear.z;
  out[3] = a.angular.x;
  out[4] = a.angular.y;
  out[5] = a.angular.z;
}

}  // namespace touchline
