// SPDX-License-Identifier: Apache-2.0
// The version of Touchline: the only place where it stands. CMake and Python read it from here.
#pragma once

#define TOUCHLINE_VERSION "0.1.0"

namespace touchline {

constexpr const char* kVersion = TOUCHLINE_VERSION;

}  // namespace touchline
