// SPDX-License-Identifier: Apache-2.0
// How noisy the signals are.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <vector>

namespace touchline {

// One sigma per sample of the signals, and what no filter takes away.
struct NoiseFigures {
  std::vector<double> qd, tau, wrench;  // n, n, 6 k
  double period = 1e-3;                 // between samples [s]
  // Errors of gains and model, as a part of the load.
  double wrench_error = 0.0, torque_error = 0.0;
  // `wrench_error` of an arm on which a wrench stands off, at least.
  double wrench_error_off = 0.0;
  double force = 2e-3, moment = 5e-4;   // floors [N, Nm]
};

}  // namespace touchline
