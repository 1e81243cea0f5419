// SPDX-License-Identifier: Apache-2.0
// What a user may choose about the estimation; what belongs to a robot stands in robot.hpp.
#pragma once

#include "touchline/detail/observer/channels.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

struct Tuning {
  Method method = Method::segment;  // of the observer
  Discretization discretization = Discretization::automatic;
  LocalizerSettings localizer;  // but for `friction` and `finger`: the robot's `pushes`
};

}  // namespace touchline
