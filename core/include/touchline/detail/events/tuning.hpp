// SPDX-License-Identifier: Apache-2.0
// What the record of events was tuned with.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct EventsTuning {
  // The mean of so many steps in time is compared with the period that was told: jitter of half a
  // period is gone by then. Half: strong jitter may be told as another rate. Double: a change of
  // rate is told twice as late.
  int period_steps = 64;
  // Beyond this ratio of the two, stated uncertainties err by a tenth, its root, and `health` says
  // so. Half or double are no ratios near 1: 1.1 is told for clocks that only drift.
  double period_ratio = 1.2;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("period_steps", "samples", t.period_steps);
    v("period_ratio", "1", t.period_ratio);
  }
};

}  // namespace touchline
