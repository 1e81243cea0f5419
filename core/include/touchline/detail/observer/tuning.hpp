// SPDX-License-Identifier: Apache-2.0
// What the observer was tuned with: every number that is neither physics nor the robot's own.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct ObserverTuning {
  // ---- Time stamps ----
  // A step is a gap above this many typical periods. Two lost packets of a robot's driver are no
  // news (3 periods, and half of one for jitter). Half: every lost packet is told as a gap. Double:
  // gaps of 7 periods are integrated over without a bit and without a doubt.
  double gap_periods = 3.5;
  // Stamps closer than this are repetitions [s]. The fastest robots report at 8 kHz; stamps in
  // seconds since 1970 resolve 2e-7 s. A tenth or ten times as much changes nothing.
  double shortest_step = 1e-9;
  // The typical period is never taken for longer than this [s]: no robot reports less often. Half
  // or double only matters for logs of that rate.
  double longest_period = 10.0;
  // So many stamps in a row that do not go forward, each after the other: the clock was set back.
  // Half: a burst of five late packets restarts all. Double: 20 samples are lost where it was.
  int patience = 10;
  // The typical period moves by this factor a sample towards the step seen: it tends to the median
  // whatever the jitter. 1.05 follows a rate ten times slower within some 30 samples (with
  // `gap_growth`); half of the 5 % takes twice as long, double trembles by 10 %.
  double period_growth = 1.05;
  // The same for a step that is a gap, which a change of rate shows first as. Half of the 25 %:
  // twice as many gaps are told after a change of rate. Double: one gap moves the period by half.
  double gap_growth = 1.25;

  // ---- Gaps ----
  // A filter of bandwidth K goes on over steps dt up to K dt = this. There it has forgotten 86 % of
  // what it knew, so that a restart would lose little more; Tustin's pole would ring from there on.
  // On a real Panda at K = 100 the residuals are then 0.06 Nm off at most. Half: a gap of 20 ms at
  // K = 100 restarts. Double: 40 ms there, with nearly nothing left of what was known.
  double bridged_steps = 2.0;
  // No filter goes on over more than this [s]: at 1 rad/s a joint then turns by 0.1 rad, and what
  // acts on it between is no longer near the mean of both ends. Half: 50 ms at K <= 40. Double:
  // bridges at K = 10 that take the load of a fast motion for a contact.
  double longest_bridge = 0.1;

  // ---- Filters ----
  // A filter has settled after this many time constants 1/K: 0.7 % of what it began with is left.
  // Half: 8 % is left when the first event may begin. Double: twice as long blind.
  double settled_steps = 5.0;
  // `Discretization::automatic` takes Tustin's rule up to this K dt: its error is the smallest, its
  // pole tends to zero at K dt = 2. Half and double: 0.2 % and 13 % of error in the pole.
  double tustin_steps = 0.5;

  // ---- Readings ----
  // A joint may be so far outside of the model's limits [rad or m] without the bit for it: encoders
  // and hard stops differ by less. Half or double only moves that bit.
  double limit_tolerance = 0.01;

  // ---- Rest ----
  // A joint that is faster moves [rad/s or m/s]. Half: an arm that trembles is never at rest.
  // Double: one that creeps is tared.
  double rest_speed = 0.01;
  // What is felt at rest is averaged over so long [s]: many time constants of the filters. Half: an
  // offset errs by half as much again. Double: a tare takes a second.
  double rest_window = 0.5;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("gap_periods", "periods", t.gap_periods);
    v("shortest_step", "s", t.shortest_step);
    v("longest_period", "s", t.longest_period);
    v("patience", "samples", t.patience);
    v("period_growth", "1", t.period_growth);
    v("gap_growth", "1", t.gap_growth);
    v("bridged_steps", "1/K", t.bridged_steps);
    v("longest_bridge", "s", t.longest_bridge);
    v("settled_steps", "1/K", t.settled_steps);
    v("tustin_steps", "1/K", t.tustin_steps);
    v("limit_tolerance", "rad", t.limit_tolerance);
    v("rest_speed", "rad/s", t.rest_speed);
    v("rest_window", "s", t.rest_window);
  }
};

}  // namespace touchline
