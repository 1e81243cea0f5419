// SPDX-License-Identifier: Apache-2.0
// What the localizer is told: how places are searched for, and how contacts are followed over time.
// Theory: docs/theory.md, section 8.
#pragma once

#include "touchline/detail/localizer/tuning.hpp"
#include "touchline/detail/place/settings.hpp"

namespace touchline {

struct LocalizerSettings : PlaceSettings, LocalizerTuning {};

}  // namespace touchline
