// SPDX-License-Identifier: Apache-2.0
// Several samples side by side in one number type: the instantaneous terms of a recording do not
// depend on each other, so `run` computes them for `kLanes` samples at once. Every operation is
// that of a plain double, lane by lane, so the numbers are the same to the last bit.
// Theory: docs/theory.md, section 1.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>

#if (defined(__AVX__) || defined(__SSE2__)) && (defined(__GNUC__) || defined(__clang__))
#include <immintrin.h>
#endif

namespace touchline {

#if defined(__GNUC__) || defined(__clang__)
#if defined(__AVX__)
constexpr int kLanes = 4;  // one AVX register
#else
constexpr int kLanes = 2;  // one SSE2 or NEON register, which every x86-64 and AArch64 has
#endif
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));
#else
constexpr int kLanes = 1;  // no vectors are known of
using Lanes = double;
#endif

template <class T>
struct LaneCount {
  static constexpr int value = static_cast<int>(sizeof(T) / sizeof(double));
};

inline double lane(double v, int) { return v; }
inline void set_lane(double& v, int, double x) { v = x; }
#if defined(__GNUC__) || defined(__clang__)
inline double lane(const Lanes& v, int i) { return v[i]; }
inline void set_lane(Lanes& v, int i, double x) { v[i] = x; }
#endif

inline Lanes all_lanes(double x) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  return Lanes{x, x, x, x};
#elif defined(__GNUC__) || defined(__clang__)
  return Lanes{x, x};
#else
  return x;
#endif
}

// The lanes moved on by one: the first takes `before`, and `before` the last.
inline Lanes move_on(double& before, const Lanes& v) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  const Lanes turned = __builtin_shufflevector(v, v, 3, 0, 1, 2);
  const Lanes out = __builtin_shufflevector(all_lanes(before), turned, 0, 5, 6, 7);
#elif defined(__GNUC__) || defined(__clang__)
  const Lanes turned = __builtin_shufflevector(v, v, 1, 0);
  const Lanes out = __builtin_shufflevector(all_lanes(before), turned, 0, 3);
#else
  const Lanes turned = v, out = before;
#endif
  before = lane(turned, 0);
  return out;
}

// kLanes rows of as many lanes, turned: lane k of row i becomes lane i of row k.
inline void transpose(Lanes* rows) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  const Lanes a = __builtin_shufflevector(rows[0], rows[1], 0, 4, 2, 6);
  const Lanes b = __builtin_shufflevector(rows[0], rows[1], 1, 5, 3, 7);
  const Lanes c = __builtin_shufflevector(rows[2], rows[3], 0, 4, 2, 6);
  const Lanes d = __builtin_shufflevector(rows[2], rows[3], 1, 5, 3, 7);
  rows[0] = __builtin_shufflevector(a, c, 0, 1, 4, 5);
  rows[1] = __builtin_shufflevector(b, d, 0, 1, 4, 5);
  rows[2] = __builtin_shufflevector(a, c, 2, 3, 6, 7);
  rows[3] = __builtin_shufflevector(b, d, 2, 3, 6, 7);
#else
  for (int i = 0; i < kLanes; ++i) {
    for (int k = 0; k < i; ++k) {
      const double swapped = lane(rows[i], k);
      set_lane(rows[i], k, lane(rows[k], i));
      set_lane(rows[k], i, swapped);
    }
  }
#endif
}

inline Lanes load_lanes(const double* from) {
  Lanes v;
  std::memcpy(&v, from, sizeof v);
  return v;
}
inline void store_lanes(const Lanes& v, double* to) { std::memcpy(to, &v, sizeof v); }

// As many floats, as doubles.
inline Lanes lanes_of_floats(const float* from) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  return _mm256_cvtps_pd(_mm_loadu_ps(from));
#elif defined(__GNUC__) || defined(__clang__)
  float __attribute__((vector_size(kLanes * sizeof(float)))) v;
  std::memcpy(&v, from, sizeof v);
  return __builtin_convertvector(v, Lanes);
#else
  return *from;
#endif
}

// `count` signals of kLanes samples, `stride` from one sample to the next: each signal side by side.
inline void gather(const double* from, std::size_t stride, std::size_t count, Lanes* to) {
  if (count < kLanes) {
    for (std::size_t i = 0; i < count; ++i) {
      for (int k = 0; k < kLanes; ++k) set_lane(to[i], k, from[k * stride + i]);
    }
    return;
  }
  for (std::size_t next = 0; next < count; next += kLanes) {
    const std::size_t i = std::min(next, count - kLanes);  // the last block reaches back
    Lanes block[kLanes];
    for (int k = 0; k < kLanes; ++k) block[k] = load_lanes(from + k * stride + i);
    transpose(block);
    for (int k = 0; k < kLanes; ++k) to[i + k] = block[k];
  }
}

// Lane by lane: is it between the two? A NaN is not.
#if defined(__GNUC__) || defined(__clang__)
using LaneMask = decltype(Lanes{} < Lanes{});
inline bool all_of(const LaneMask& mask) {
  long long all = -1;
  for (int k = 0; k < kLanes; ++k) all &= mask[k];
  return all != 0;
}
#else
using LaneMask = bool;
inline bool all_of(bool mask) { return mask; }
#endif
inline LaneMask between(const Lanes& v, double low, double high) { return (v > low) & (v < high); }
inline LaneMask within(const Lanes& v, double low, double high) {
  return (v >= low) & (v <= high);
}

// An instruction for all lanes: a library's root of each has an error to report.
inline Lanes root(Lanes x) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  return _mm256_sqrt_pd(x);
#elif defined(__SSE2__) && (defined(__GNUC__) || defined(__clang__))
  return _mm_sqrt_pd(x);
#endif
  for (int k = 0; k < kLanes; ++k) set_lane(x, k, std::sqrt(lane(x, k)));
  return x;
}

inline Lanes larger(const Lanes& a, const Lanes& b) { return a > b ? a : b; }
inline Lanes smaller(const Lanes& a, const Lanes& b) { return a < b ? a : b; }

inline bool any_below(const Lanes& a, const Lanes& b) {
#if defined(__AVX__) && (defined(__GNUC__) || defined(__clang__))
  return _mm256_movemask_pd(_mm256_cmp_pd(a, b, _CMP_LT_OQ)) != 0;
#else
  bool any = false;
  for (int k = 0; k < kLanes; ++k) any |= lane(a, k) < lane(b, k);
  return any;
#endif
}

// To 2e-8 (Abramowitz and Stegun, Handbook of Mathematical Functions, 4.4.46).
inline Lanes arc_cosine(const Lanes& x) {
  constexpr double kTerms[] = {-0.0012624911, 0.0066700901, -0.0170881256, 0.0308918810,
                               -0.0501743046, 0.0889789874, -0.2145988016, 1.5707963050};
  const Lanes size = smaller(larger(x, -x), all_lanes(1.0));
  Lanes sum = all_lanes(0.0);
  for (double term : kTerms) sum = sum * size + term;
  sum = root(all_lanes(1.0) - size) * sum;
  return x < all_lanes(0.0) ? all_lanes(3.141592653589793) - sum : sum;
}

}  // namespace touchline
