// SPDX-License-Identifier: Apache-2.0
// A 3-vector of one instant in one register, where registers have room for it: the recursion over
// the tree does three components at once. Every operation is that of `BasicVec3`, component by
// component, so the numbers are the same to the last bit. The fourth component is not looked at.
// Theory: docs/theory.md, section 1.3.
#pragma once

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/spatial.hpp"

namespace touchline {

// What the recursion holds vectors and rotations in: `T` is double, or several samples side by side.
template <class T>
struct Packing {
  using Vector = BasicVec3<T>;
  using Matrix = BasicMat3<T>;
};

// The same vector or matrix, component by component: for those who do not know of registers.
template <class T>
const BasicVec3<T>& plain(const BasicVec3<T>& v) {
  return v;
}
template <class T>
const BasicMat3<T>& plain(const BasicMat3<T>& m) {
  return m;
}

#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))

struct PackedVec3 {
  Lanes v{};

  PackedVec3() = default;
  explicit PackedVec3(const Lanes& lanes) : v(lanes) {}
  PackedVec3(const Vec3& a) : v{a.x, a.y, a.z, 0.0} {}

  PackedVec3& operator+=(const PackedVec3& b) { return v += b.v, *this; }
};

inline PackedVec3 operator+(const PackedVec3& a, const PackedVec3& b) { return PackedVec3(a.v + b.v); }
inline PackedVec3 operator-(const PackedVec3& a, const PackedVec3& b) { return PackedVec3(a.v - b.v); }
inline PackedVec3 operator*(double s, const PackedVec3& a) { return PackedVec3(s * a.v); }

inline double dot(const PackedVec3& a, const PackedVec3& b) {
  const Lanes products = a.v * b.v;
  return products[0] + products[1] + products[2];
}
inline PackedVec3 cross(const PackedVec3& a, const PackedVec3& b) {
  const Lanes next_a = __builtin_shufflevector(a.v, a.v, 1, 2, 0, 3);
  const Lanes next_b = __builtin_shufflevector(b.v, b.v, 1, 2, 0, 3);
  const Lanes turned = a.v * next_b - next_a * b.v;  // z, x, y
  return PackedVec3(__builtin_shufflevector(turned, turned, 1, 2, 0, 3));
}

struct PackedMat3 {
  PackedVec3 x, y, z;

  PackedMat3() = default;
  PackedMat3(const PackedVec3& x, const PackedVec3& y, const PackedVec3& z) : x(x), y(y), z(z) {}
  PackedMat3(const Mat3& m) : x(m.x), y(m.y), z(m.z) {}
};

inline PackedVec3 operator*(const PackedMat3& m, const Vec3& a) {
  return PackedVec3(m.x.v * a.x + m.y.v * a.y + m.z.v * a.z);
}
inline PackedVec3 operator*(const PackedMat3& m, const PackedVec3& a) {
  return PackedVec3(m.x.v * __builtin_shufflevector(a.v, a.v, 0, 0, 0, 0) +
                    m.y.v * __builtin_shufflevector(a.v, a.v, 1, 1, 1, 1) +
                    m.z.v * __builtin_shufflevector(a.v, a.v, 2, 2, 2, 2));
}
inline PackedMat3 operator*(const PackedMat3& a, const Mat3& b) { return {a * b.x, a * b.y, a * b.z}; }
// The products of three dots stand in three registers: turned, their sums come out side by side.
inline PackedVec3 transposed_times(const PackedMat3& m, const PackedVec3& a) {
  const Lanes x = m.x.v * a.v, y = m.y.v * a.v, z = m.z.v * a.v;
  const Lanes xy = __builtin_shufflevector(x, y, 0, 4, 2, 6) + __builtin_shufflevector(x, y, 1, 5, 3, 7);
  const Lanes zz = z + __builtin_shufflevector(z, z, 1, 0, 3, 2);
  const Lanes third = __builtin_shufflevector(__builtin_shufflevector(x, y, 0, 4, 2, 6), z, 2, 3, 6, 7);
  return PackedVec3(__builtin_shufflevector(xy, zz, 0, 1, 4, 5) + third);
}

// For several samples side by side: a matrix of constants, the same for all of them.
inline BasicVec3<Lanes> operator*(const PackedMat3& m, const BasicVec3<Lanes>& a) {
  return {m.x.v[0] * a.x + m.y.v[0] * a.y + m.z.v[0] * a.z,
          m.x.v[1] * a.x + m.y.v[1] * a.y + m.z.v[1] * a.z,
          m.x.v[2] * a.x + m.y.v[2] * a.y + m.z.v[2] * a.z};
}

template <>
struct Packing<double> {
  using Vector = PackedVec3;
  using Matrix = PackedMat3;
};

inline Vec3 plain(const PackedVec3& a) { return {a.v[0], a.v[1], a.v[2]}; }
inline Mat3 plain(const PackedMat3& m) { return {plain(m.x), plain(m.y), plain(m.z)}; }

#endif

}  // namespace touchline
