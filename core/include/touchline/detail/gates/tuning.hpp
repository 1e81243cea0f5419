// SPDX-License-Identifier: Apache-2.0
// What the gates were tuned with: when a reading is not believed.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct GatesTuning {
  // ---- Time stamps ----
  // A longer step in time is no step of a channel [periods]: what lies between is not known. Half:
  // after two lost packets nothing is judged. Double: readings eight periods apart count as a jump.
  double step_periods = 5.0;
  // So many stamps in a row that do not advance are a clock set back: all begins anew. Half: a
  // burst of late packets does that. Double: 32 samples are lost where it was.
  int refusals = 16;

  // ---- What is usual of a channel ----
  // Steps are averaged over so long [s]. Half: a motion that begins looks like jumps for longer
  // than it is usual. Double: an arm that has stopped is judged by its motion for two seconds.
  double memory = 1.0;
  // A channel is judged after so long [s], and so many samples. Half: twenty noisy samples are ten,
  // whose mean errs by a quarter. Double: a fault in the first 0.1 s goes through.
  double warm_up = 0.05;
  int least_seen = 20;

  // ---- Jumps ----
  // A step so many times the mean one is a jump. Of white noise, 20 means are 16 sigmas of a step.
  // Half: 8 sigmas, which a knock on the table passes. Double: only gross faults are caught.
  double jump = 20.0;
  // A step so many times the mean one is a channel that moves at all: 4.8 sigmas of white noise,
  // passed by one step in a million. Half: noise bears faults out. Double: blows are held for a
  // sample, as nothing seems to bear them out.
  double moves = 6.0;
  // No joint moves faster [rad/s or m/s]; real arms reach 4, small ones 8. Half: fast small arms
  // are doubted. Double: jumps of twice the size pass.
  double fastest = 10.0;
  // Way that gravity hardly notices [rad or m]: less is no jump of a position. Half or double only
  // matter for robots at more than 1 kHz.
  double least_travel = 0.01;
  // No velocity changes faster [rad/s2 or m/s2], as in a hard stop, without its position showing it.
  // Half: blows are held for a sample. Double: steps of twice the size pass, whose momentum the filters
  // take for a blow.
  double hardest = 50.0;
  // No contact is less than this, in a force [N] or a torque [Nm]: smaller steps are not judged.
  // Half: weak knocks are judged. Double: spikes of 2 N pass.
  double least_step_force = 1.0;
  double least_step_torque = 0.2;

  // ---- What bears a jump out ----
  // Another channel bears a jump out if its ratio is at least this part of the jump's. Half: an
  // axis's crosstalk bears its spike out. Double: blows far from a joint are held for a sample.
  double equal = 0.05;
  // Positions must show this part of a step of speed to bear it out. Half: what a spike of a
  // velocity leaves in rough positions does. Double: delayed positions do not.
  double borne_out = 0.3;
  // Farther from a sensor no link is [m]: a torque beyond it has no force that makes it. Half: long
  // arms' own links are beyond. Double: a torque of one axis alone goes through.
  double reach = 2.0;
  // Of one force: its moment along itself is at most this part of the whole. Half: what several
  // forces make is doubted. Double: an axis that fails beside a light push passes.
  double pitch = 0.2;

  // ---- How long a channel is doubted ----
  // A reading is held for so long at most [s], and so many samples. Half: at 1 kHz two samples
  // more are lost of a channel that spikes. Double: at 200 Hz nothing new is felt for 10 ms.
  double held = 0.01;
  int held_most = 5;
  // So many samples at a new level make it one. Half: two spikes of one size do. Double: a step
  // that is real is taken 3 ms later at 1 kHz.
  int sure = 3;
  // So many usual steps in a row bring a wild channel back. Half: the pauses of a bad plug do.
  // Double: 10 ms more are lost at 1 kHz.
  int good = 10;
  // What stays elsewhere for so long does so for good [s]. Half: a sensor that has slipped is
  // believed after 1 s. Double: it is left out for 4 s.
  double returns = 2.0;
  // Speeds follow from positions at this rate [rad/s]. Half: they follow a reversal late.
  // Double: the steps of an encoder show as speed.
  double tracking = 200.0;
  // A way follows from its joint's speed for so long [s]; then it is not known. Half: a position is
  // lost sooner. Double: what a speed is wrong by leads it twice as far astray.
  double way_blind = 2.0;

  // ---- Stuck channels ----
  // The arm moves if any joint is as fast as this [rad/s or m/s]. Half: encoder noise may count.
  // Double: what sticks in a slow motion is not seen.
  double stuck_speed = 0.02;
  // Without a change for so long [s], and so many samples, a channel may be stuck. Half: coarse
  // sensors repeat themselves for 10 ms. Double: a stuck one is believed for 40 ms.
  double silent = 0.02;
  int least_silent = 5;
  // What must speak against chance before a channel is stuck, as the logarithm of the odds [nats].
  // Half: coarse sensors may be called stuck by chance. Double: stuck ones are told
  // twice as late.
  double evidence = 40.0;
  // The same at the largest or smallest value that the channel has ever shown, where it is clipped,
  // after so many samples. Half: peaks of a coarse sensor count. Double: a clipped blow is told
  // late.
  double evidence_at_end = 12.0;
  int least_at_end = 4;
  // It must be so many times as long as any run that the channel has shown. Half: an odd second of
  // a coarse sensor. Double: stuck ones are told later after a long run.
  double runs = 3.0;
  // And that is forgotten over so long [s]. Half and double only shift when a run has been
  // forgotten.
  double run_memory = 20.0;
  // A channel that changes in this part of the samples is not the same twice by chance. Half:
  // coarse sensors count as alive. Double: none does.
  double lively = 0.5;
  // So many changes of value bring a stuck channel back. Half: one bit that flickers does. Double:
  // it comes back twice as late.
  int changes = 3;

  // ---- Position against velocity ----
  // Both are compared over so long [s], and so many samples. Half: rough positions disagree.
  // Double: a wrong velocity is told 10 ms later.
  double speed_window = 0.01;
  double speed_window_samples = 3.0;
  // A velocity may be wrong by so much [rad/s or m/s]. Half: delays of one sample count in hard
  // motion. Double: twice the error is believed.
  double speed_error = 0.1;
  // One that changes with each sample may be wrong by this [rad/s or m/s], by this part of itself, and
  // by what it changes in this time [s], if that is less. Half: offsets of 5 mrad/s, scales of a
  // quarter, filters of 5 ms disagree. Double: a wrong sign is not seen below 0.02 rad/s.
  double speed_slight = 0.01;
  double speed_part = 0.5;
  double speed_late = 0.01;
  // So many times the mean difference is a disagreement. Half: motions the arm has not yet shown.
  // Double: twice as wrong.
  double disagrees = 10.0;
  // No joint that moves stands for so many samples. Half: held samples count. Double: twice as
  // late.
  double stands = 5.0;
  // Of a channel that changes as often as this, one that does not change is dead. Half: coarse ones
  // are. Double: none is.
  double surely = 0.99;
  // What disagrees with one that has not changed counts so many times. Half and double: later and
  // sooner told by a few samples.
  double stale = 5.0;
  // A disagreement must last so long [s], and so many samples. Half: a knock is one. Double: 10 ms
  // more of a wrong velocity.
  double dwell = 0.01;
  int least_dwell = 3;

  // ---- One axis against the others ----
  // A relation must be broken for so long [s], and so many samples. Half: one odd sample is enough
  // at 500 Hz. Double: a false axis is felt for 6 ms.
  double parity_dwell = 0.003;
  double parity_least_dwell = 3.0;
  // So many thresholds of a contact must be wrong, of which the other sensor leaves the part `left`
  // at most, and so many thresholds of its own. Half: noise is told as a fault. Double: twice the
  // error passes, or another touch at the same time hides it.
  double parity_clear = 1.2;
  double parity_left = 0.3;
  double parity_noise = 0.4;
  // Of a sensor's load: what any axis but the faulty one may have. Half: an axis with crosstalk is
  // believed. Double: a push along one axis is doubted.
  double parity_alone = 0.2;
  // A channel that others contradict is left out for so long [s]. Half: one that comes and goes is
  // felt twice as often. Double: a segment is watched with less for 4 s.
  double contradicted = 2.0;

  // ---- Handing over to a stand-in ----
  // The one that goes on feels within so long what lasts, or it has ended [s]. Half: at K = 40 a
  // contact may end and begin anew. Double: one that ended is told 50 ms later.
  double continues = 0.05;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("step_periods", "periods", t.step_periods);
    v("refusals", "samples", t.refusals);
    v("memory", "s", t.memory);
    v("warm_up", "s", t.warm_up);
    v("least_seen", "samples", t.least_seen);
    v("jump", "1", t.jump);
    v("moves", "1", t.moves);
    v("fastest", "rad/s", t.fastest);
    v("least_travel", "rad", t.least_travel);
    v("hardest", "rad/s2", t.hardest);
    v("least_step_force", "N", t.least_step_force);
    v("least_step_torque", "Nm", t.least_step_torque);
    v("equal", "1", t.equal);
    v("borne_out", "1", t.borne_out);
    v("reach", "m", t.reach);
    v("pitch", "1", t.pitch);
    v("held", "s", t.held);
    v("held_most", "samples", t.held_most);
    v("sure", "samples", t.sure);
    v("good", "samples", t.good);
    v("returns", "s", t.returns);
    v("tracking", "rad/s", t.tracking);
    v("way_blind", "s", t.way_blind);
    v("stuck_speed", "rad/s", t.stuck_speed);
    v("silent", "s", t.silent);
    v("least_silent", "samples", t.least_silent);
    v("evidence", "nats", t.evidence);
    v("evidence_at_end", "nats", t.evidence_at_end);
    v("least_at_end", "samples", t.least_at_end);
    v("runs", "1", t.runs);
    v("run_memory", "s", t.run_memory);
    v("lively", "1", t.lively);
    v("changes", "samples", t.changes);
    v("speed_window", "s", t.speed_window);
    v("speed_window_samples", "samples", t.speed_window_samples);
    v("speed_error", "rad/s", t.speed_error);
    v("speed_slight", "rad/s", t.speed_slight);
    v("speed_part", "1", t.speed_part);
    v("speed_late", "s", t.speed_late);
    v("disagrees", "1", t.disagrees);
    v("stands", "samples", t.stands);
    v("surely", "1", t.surely);
    v("stale", "1", t.stale);
    v("dwell", "s", t.dwell);
    v("least_dwell", "samples", t.least_dwell);
    v("parity_dwell", "s", t.parity_dwell);
    v("parity_least_dwell", "samples", t.parity_least_dwell);
    v("parity_clear", "1", t.parity_clear);
    v("parity_left", "1", t.parity_left);
    v("parity_noise", "1", t.parity_noise);
    v("parity_alone", "1", t.parity_alone);
    v("contradicted", "s", t.contradicted);
    v("continues", "s", t.continues);
  }
};

}  // namespace touchline
