// SPDX-License-Identifier: Apache-2.0
// The health bits of one sample, and the sanity test of one number.
#pragma once

#include <cmath>
#include <cstdint>

namespace touchline {

using Health = std::uint32_t;

constexpr Health kSettling = 1;         // less than 5/K since the start, a gap or a reset
constexpr Health kGap = 2;              // the step in time is too long to integrate over
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

}  // namespace touchline
