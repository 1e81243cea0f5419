// SPDX-License-Identifier: Apache-2.0
// What the classifier was tuned with: contact or collision, clamped or free. Thresholds of force
// and of its growth are the robot's own (`BlowLimits`).
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct ClassifierTuning {
  // ---- Contact or collision ----
  // The rate of a force is taken over so long [s]. Behind a filter of K = 100 rad/s a step of F
  // shows as 0.63 F over this time. Half: noise makes twice the rate, and onsets have to be set
  // twice as high. Double: a blow that is over in 10 ms shows half of its rate.
  double rate_window = 0.01;
  // A collision must show so soon after detection [s]; a force of 2 / K has grown by then. Half: a
  // blow at K = 40 may still count as a contact. Double: reactions to a contact wait for 0.1 s.
  double decide_within = 0.05;
  // Joint torques count as forces at this distance [m]: half the reach of a middling arm. Half:
  // twice the force is read from them, and pushes near the base count as blows. Double: blows near
  // the tool count as contacts.
  double lever = 0.5;
  // A contact that carries at least this share of a segment's load is the one that a blow is of.
  // Half: both of two contacts may be called collisions. Double: only the sole one ever is.
  double leading_share = 0.5;

  // ---- Clamped or free ----
  // Two forces oppose each other only if both are larger than this [N]: what noise and an error of
  // weight leave is smaller. Half: a hand's weight beside a push may count. Double: a soft clamp of
  // 8 N on both sides is not told.
  double opposed_force = 5.0;
  // And if the smaller one is at least this part of the larger. Half: a hard push beside a light
  // touch counts as a clamp. Double: the clamped arm's own weight, on one side, hides it.
  double opposed_ratio = 0.3;
  // And if the cosine between them is below this: 120 degrees apart. Half: pushes at right angles
  // nearly count. Double: nothing opposes anything.
  double opposed_cosine = -0.5;
  // For so long they must oppose each other without a break [s]: longer than the filters need to
  // follow at K = 100. Half: two blows at the same time count. Double: a clamp is told 20 ms later.
  double opposed_time = 0.02;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("rate_window", "s", t.rate_window);
    v("decide_within", "s", t.decide_within);
    v("lever", "m", t.lever);
    v("leading_share", "1", t.leading_share);
    v("opposed_force", "N", t.opposed_force);
    v("opposed_ratio", "1", t.opposed_ratio);
    v("opposed_cosine", "1", t.opposed_cosine);
    v("opposed_time", "s", t.opposed_time);
  }
};

}  // namespace touchline
