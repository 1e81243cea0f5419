// SPDX-License-Identifier: Apache-2.0
// Several samples side by side in one number type: the instantaneous terms of a recording do not
// depend on each other, so `run` computes them for `kLanes` samples at once. Every operation is
// that of a plain double, lane by lane, so the numbers are the same to the last bit.
#pragma once

#include <cstddef>

namespace touchline {

#if defined(__GNUC__) || defined(__clang__)
#if defined(__AVX__)
constexpr int kLanes = 4;  // one AVX register
#else
constexpr int kLanes = 2;  // one SSE2 or NEON register, which every x86-64 and AArch64 has
#endif
using Lanes = double __attribute__((vector_size(kLanes * sizeof(double))));
#else
constexpr int kLanes = 1;
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

}  // namespace touchline
