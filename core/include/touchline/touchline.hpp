// SPDX-License-Identifier: Apache-2.0
// The sense of touch for a robot arm without a skin:
//
//   touchline::RedundantPipeline pipeline(touchline::read_robot("sara.touchline"));
//   const touchline::Result result = pipeline.update({time, q, qd, tau, wrench});
//   for (const touchline::Contact& contact : result.contacts) ...
#pragma once

#include "touchline/pipeline.hpp"
#include "touchline/redundant.hpp"
#include "touchline/result.hpp"
#include "touchline/robot.hpp"
#include "touchline/robot_file.hpp"
#include "touchline/sample.hpp"
#include "touchline/tuning.hpp"
#include "touchline/version.hpp"
