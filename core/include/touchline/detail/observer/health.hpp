// SPDX-License-Identifier: Apache-2.0
// The health bits of one sample, and the sanity test of one number.
// Theory: docs/theory.md, section 2.3.
#pragma once

#include <cmath>
#include <cstddef>
#include <cstdint>
#include <cstring>

namespace touchline {

using Health = std::uint32_t;

constexpr Health kSettling = 1;         // less than 5/K since the start, a long gap or a reset
constexpr Health kGap = 2;              // samples are lost: the first one after them
constexpr Health kBadTime = 4;          // the time stamp repeats, goes back or is no number
constexpr Health kMissing = 8;          // a signal that should be there is NaN
constexpr Health kNonFinite = 16;       // a signal is infinite or beyond all bounds
constexpr Health kSaturated = 32;       // a reading is at the end of its range
constexpr Health kSensorExcluded = 64;  // a sensor has been absent for longer than a gap
constexpr Health kModelLimit = 128;     // a joint is outside the limits of the model

// Larger than any position, speed, torque or force of a robot arm; a number beyond is a fault.
constexpr double kAbsurd = 1e6;

// Health of one value that should have been measured; 0 if it can be used.
inline Health judge(double value) {
  if (std::isnan(value)) return kMissing;
  return std::fabs(value) < kAbsurd ? 0 : kNonFinite;
}

// |v| as a number that grows with it, beyond infinity for NaN: tests on many of them vectorize.
inline std::uint64_t magnitude(double v) {
  std::uint64_t bits;
  std::memcpy(&bits, &v, sizeof bits);
  return bits & 0x7fffffffffffffffu;
}
constexpr std::uint64_t kNoLimit = 0x8000000000000000u;

// Is every |value| below its limit, and none NaN?
inline bool all_below(const double* __restrict values, const std::uint64_t* __restrict limits,
                      std::size_t count) {
  std::uint64_t below = kNoLimit;  // the sign bit stays as long as all differences are negative
  for (std::size_t i = 0; i < count; ++i) below &= magnitude(values[i]) - limits[i];
  return below != 0;
}

// Health of values that should all have been measured.
inline Health judge_all(const double* values, std::size_t count) {
  const std::uint64_t limit = magnitude(kAbsurd);
  std::uint64_t below = kNoLimit;
  for (std::size_t i = 0; i < count; ++i) below &= magnitude(values[i]) - limit;
  if (below != 0) return 0;
  Health health = 0;
  for (std::size_t i = 0; i < count; ++i) health |= judge(values[i]);
  return health;
}

// The limit up to which a reading is surely neither absurd nor at the end of its range.
inline double safe_value(double range) { return std::fmin(kAbsurd, (1.0 - 1e-9) * range); }
inline std::uint64_t safe_limit(double range) { return magnitude(safe_value(range)); }

}  // namespace touchline
