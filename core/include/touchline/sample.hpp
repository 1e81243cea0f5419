// SPDX-License-Identifier: Apache-2.0
// What a robot reports at one instant.
#pragma once

namespace touchline {

// One sample, in the order of the robot's joints (n) and sensors (k). The numbers belong to the
// caller; they are read during the call and not kept.
struct Sample {
  double time;           // stamp [s]; it may jitter, repeat or go back
  const double* q;       // (n) joint positions [rad or m]
  const double* qd;      // (n) joint velocities [rad/s or m/s]
  const double* tau;     // (n) joint torques as logged; NaN where not measured
  const double* wrench;  // (k, 6) fx fy fz mx my mz as logged [N, Nm]; NaN where not measured
};

}  // namespace touchline
