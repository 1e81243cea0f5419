// SPDX-License-Identifier: Apache-2.0
// How far an arm has shown that it is not as told.
// Theory: docs/theory.md, section 4.7.
#pragma once

namespace touchline {

// What the detector has learned of one of its rows [N or Nm]: how far the arm is not as told.
struct Standing {
  double start = 0.0;  // stood there when observation began, and a while later; 0: no such thing
  double now = 0.0;    // stands there now and is no touch: since the start, or since a contact
  double drift = 0.0;  // by which that has changed slowly since then; 0: by less than a threshold
  double seen = 0.0;   // one sigma of its noise, when that was largest against what was told
  double ratio = 1.0;  // of that to the sigma that is told; 1: nothing speaks against it
};

}  // namespace touchline
