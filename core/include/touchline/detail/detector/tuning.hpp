// SPDX-License-Identifier: Apache-2.0
// What the detector was tuned with. Thresholds, times and a robot's noise are not here: they are
// the robot's own (`DetectionRow`, `DetectionSettings`), and calibration writes them. K is the
// bandwidth of a row's filter.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct DetectorTuning {
  // ---- Residuals and their noise ----
  // Time constant of the quick baseline that windows and CUSUM take for offset [s]. Half: a push
  // that rises in 0.1 s is half taken for offset. Double: errors of the model in motion fire.
  double reference = 0.2;
  // What a gap may have left counts this many times, for thresholds and for weights. It is no noise
  // that scatters about zero but the size of one error, which lasts for some 1/K. Half: with one, 3
  // of 250 gaps in three held pushes begin a false contact beside them; with three, one. Double:
  // with five, none, but new contacts are felt later.
  double gap_sigmas = 3.0;
  // Of the mean, that CUSUM is made for [sigmas per sample]: half of it is taken off each sample.
  // Half: weaker loads are found, later. Double: 0.5 sigma a sample is never found.
  double cusum_shift = 1.0;
  // Innovations are summed up only after so long [s], when their filter has settled. Half: its
  // start shows as a load. Double: CUSUM is blind for 0.2 s.
  double cusum_warm_up = 0.1;
  // A sum may grow to so many thresholds while all is felt, so that it clears soon after. Half:
  // below the threshold itself, nothing would ever be felt. Double: a contact clears later.
  double cusum_most = 1.5;
  // Covariances follow the posture this often [s]: a joint at 1 rad/s has moved by 0.01 rad. Half:
  // twice the time for them. Double: nothing that can be seen at ordinary speeds.
  double refresh = 0.01;
  // Speed and acceleration are low-passed over so long [s], so that a collision does not raise its
  // own threshold. Half: it begins to. Double: thresholds lag 0.1 s behind a motion.
  double activity_time = 0.05;

  // ---- Noise as seen ----
  // Times told: noise figures are no better than this. Half: rounding of them counts as noise.
  // Double: noise three times as large as told fires first.
  double noisier = 1.5;
  // Values until which noise may be larger than seen: a sigma of so many is right by a sixth. Half:
  // by a quarter. Double: thresholds stay high for twice as long after the start.
  double noise_enough = 20.0;
  // Times 1 / K: the time constant of the mean that the scatter is about. Half: it takes slow noise
  // away. Double: a slow motion's errors count as noise.
  double noise_mean = 2.0;
  // Values that are remembered: 5 s at K = 100. Half: a sigma trembles by 5 %. Double: what has
  // become quieter is believed after 10 s.
  double noise_most = 500.0;
  // Sigmas beyond which a value is an outlier, and what one counts, as a part of a value. Half and
  // double: how soon noise that has grown is believed, against how much a contact counts as noise.
  double noise_far = 3.0;
  double noise_doubted = 0.1;
  // Sigmas by which a variance must exceed the one that is told. Half: one row in fifty exceeds it
  // by chance. Double: noise that is 1.6 times as told is believed after four times as long.
  double noise_sure = 4.0;
  // Values before anything is judged: fewer may be the beginning of a contact. Half or double:
  // 15 ms sooner or 30 ms later at K = 100.
  double noise_few = 5.0;
  // Third differences before noise is told from the first moments; their median is right by a
  // third. Half: by a half. Double: an arm is watched with raised thresholds for longer.
  int first_few = 16;
  // So many from one look at the median to the next, since sorting takes time. Half: twice the
  // time. Double: noise is told eight samples later.
  int first_often = 8;
  // Times told, that sixteen of them hardly reach by chance. Half: chance does. Double: noise that
  // is three times as large as told fires in the first moments.
  double first_clearly = 2.0;

  // ---- Errors of the model in motion ----
  // What motion has shown is remembered over so long of motion [s]. Half: a pause in a program
  // forgets its friction. Double: what one hard motion has shown dulls the next 20 s.
  double motion_memory = 10.0;
  // What motion has shown is doubted by the share of so long of motion [s]: an error that grows has yet
  // to show the rest. Half: in the first second places are too sure. Double: they are too unsure.
  double motion_few = 0.5;
  // An arm that is not as told must have moved for so long [s] to show how much it errs in motion: until
  // then no link of a small event is sure. Half: first motions name links surely. Double: so do pushes later.
  double motion_told = 1.0;
  // Offsets that it has shown, which motion hardly exceeds until then: a weight that is turned over changes by
  // twice its size. Half: quick first motions name links surely. Double: hard pushes in them do not.
  double motion_times = 2.0;
  // While it is taken for a contact an error counts so many times: it then fills the memory in 0.5
  // s. Half: false events of motion last twice as long. Double: a push that lasts is learned in
  // 0.25 s.
  double motion_touched = 20.0;
  // Root mean squares beyond which motion alone hardly goes. A friction that changes sign exceeds
  // its own twofold. Half: friction fires. Double: pushes in motion must be twice as strong.
  double motion_sigmas = 3.0;
  // An arm leaves the constant part of its model's errors on its way through ordinary motion, so
  // far from where the baseline was averaged [rad]. Half: places spread twice as much. Double: they
  // are stated too sure on models with errors of weight.
  double drift_way = 0.75;
  // Such errors grow as far as this [rad]: weights are periodic. Half: too sure after large
  // motions. Double: nothing but in joints that turn by more.
  double drift_farthest = 2.0;
  // In a joint's own torque there is friction, all of which comes with a motion so fast [rad/s].
  // Half: it comes with a joint that creeps. Double: with one that already turns.
  double drift_speed = 0.1;
  // Root mean squares of what motion has shown that are one sigma of such an error, on an arm that
  // nobody has calibrated. A friction that changes sign exceeds its own twofold. Half: what it leaves
  // is placed as one more contact. Double: pushes on such arms are placed less often.
  double drift_shown = 2.0;
  // The same, of as much as the way that the arm has gone from its baseline is longer than it was. Half:
  // what a load does that swings farther is placed. Double: pushes on such arms are placed less often.
  double drift_grown = 1.0;
  // But ways are at least so long [rad]: on shorter ones noise is most of what is seen. Half and double:
  // how far the errors of an arm that has hardly moved may grow.
  double drift_least = 0.05;

  // ---- Friction ----
  // A joint so fast has shown half of its friction [rad/s], and at ten times that most of it. Half:
  // friction that comes later is a push. Double: what comes at once is expected too late.
  double friction_speed = 0.01;
  // Parts of a joint's friction that must have come before it is learned. Half: noise of velocities
  // tells of it. Double: a slow start is felt for longer before it counts as friction.
  double friction_turned = 0.1;
  // Seconds of a whole change by which a first look is doubted. Half: noise counts as friction for a
  // moment. Double: friction that comes at once is felt.
  double friction_few = 1e-3;
  // Seconds of a whole change after which a joint's own friction is known; before, it may have as much
  // as another one. Half: a first change of part of it counts for all. Double: the doubt lasts longer.
  double friction_enough = 0.02;
  // Times the friction that has come since the baseline, which an event must exceed. Half: friction
  // itself does. Double: pushes on one joint that has turned are felt by sensors alone for longer.
  double friction_margin = 2.0;
  // Times that friction, which are one sigma of it for places. Half: part of it, where a joint is slow,
  // is placed as a contact. Double: joints that turn tell less of places.
  double friction_doubt = 1.5;
  // Of the part by which a row changes quickly: other errors come beside friction, and the way of its
  // joint may change by so much less in the same time. Half: more pushes on joints that turn count as
  // friction. Double: friction beside other errors counts as a push. Of 40 pushes neither changes any.
  double friction_quick = 0.5;
  // Of its friction: a joint of which less has come stands, and breaks away before it is seen to move.
  // Half: one that breaks away is pushed. Double: joints that turn slowly stand, and ten of 40 pushes on
  // an arm without a sensor are lost.
  double friction_stood = 0.5;
  // Turns of joints without a sensor that show friction. Half: two contacts while joints begin to turn
  // are friction. Double: an arm of which only friction is not as told takes one motion more for touched.
  int friction_turns = 3;

  // ---- When an arm moves ----
  // Slower than this it stands [rad/s]; a hand that pushes an arm moves it, too. Half: trembling
  // arms never stand. Double: a slow motion is judged by the rules of rest.
  double standing = 0.02;
  // Faster than this it moves [rad/s]; slower is an arm that a hand pushes aside. Half: such a push
  // counts as the arm's motion. Double: slow motions are taken for rest.
  double moving = 0.1;
  // An arm that stops for less goes on moving [s]. Half: reversals count as rest. Double: a touch
  // soon after a stop is judged as one in motion.
  double pause = 0.3;
  // A joint slower than this is about to turn, or just has [rad/s]: where friction changes its
  // sign. Half: such changes count as pushes. Double: pushes on slow joints count as friction.
  double reversal_speed = 0.2;

  // ---- The start ----
  // Times 1 / K: by then settling leaves nothing of what it began with. Half: its rest counts as an
  // offset. Double: noise that is not as told is believed later.
  double confirm = 8.0;
  // Times 1 / K, and samples where the filter forgets from one to the next: what begins sooner was
  // there before. Half: an offset is called a touch. Double: a touch at once is called an offset.
  double start = 3.0;
  double start_samples = 3.0;
  // A factor within which an offset is still the same one. Half and double: whether an arm that
  // sags a little counts as not as told.
  double alike = 3.0;

  // ---- Slow drift ----
  // Over so long the middle of what the baseline may follow follows it [s], as sensors warm up.
  // Half: a hand that leans on the arm ever more for half a minute is a drift. Double: a sensor that
  // drifts by a threshold in a minute is a touch.
  double warming = 60.0;
  // Thresholds: the largest drift that is followed. Half: sensors that drift farther are touches.
  // Double: hands that lean so slowly are felt later.
  double warming_most = 10.0;

  // ---- What makes an event ----
  // Thresholds: a sample that no noise makes needs no other. Half: two bad packets are an event.
  // Double: blows are told a sample later.
  double alone = 4.0;
  // Thresholds: noise that has yet to be seen is below it. Half: noise ten times as told fires at
  // the start. Double: hard touches in the first moments are missed.
  double unseen = 10.0;
  // Limits: models of arms in motion are not better, and an event must exceed it or last. Half: any
  // does. Double: soft pushes in motion are told 2 / K later.
  double barely = 1.5;
  // Times 1 / K: time constant of the mean of the last moments. Half: its noise is larger, and with
  // it the weakest load that is found. Double: an event is judged over twice as long.
  double trend = 2.0;
  // Of what was there before: a push adds more in 2 / K. Half: motions count as pushes. Double:
  // pushes that rise slowly count as motion.
  double creep_share = 0.25;
  // A push on an arm in motion rarely lasts longer [s]. Half: a guiding hand's push ends early.
  // Double: an error of the model lasts 4 s as an event.
  double hand = 2.0;
  // Limits: motion had shown before how much a model errs, and what jumps on a sensor to so many times that
  // is a hand, however long it lasts. Half: an error of the model may last as an event. Double: a hand that holds on
  // for 2 s hides the pushes of the next 10 s.
  double hand_times = 4.0;

  // ---- What makes gains doubtful ----
  // Of what a wrench's row must exceed to be felt: an offset beyond it may come of a sensor's gain, which
  // errs in a contact as well. Half: noise passes for an offset. Double: an arm whose gains are 1 % off
  // is more often taken for right.
  double doubtful = 0.25;

  // ---- What ends one ----
  // Of an event's peak: what may rest after it, as friction does. Half: what sticks lasts as an
  // event. Double: any held force that does not change comes to rest.
  double little = 0.5;
  // The same of an arm that moves: what two contacts against each other hardly leave. Half: false
  // events in motion go on. Double: one that is clamped is taken for free.
  double trace = 0.25;
  // What a filter keeps of a reading until the next sample, below which samples are slow: noise comes
  // through whole. Half: at 15 Hz what trembles after a touch prolongs it. Double: at 100 Hz what is left
  // of a strong push may end and begin anew.
  double slow = 0.5;
  // Samples of calm that one of noise takes away. Half and double: how soon an event ends in noise.
  double spike = 5.0;
  // Times 1 / K: how long rests what has come to rest. Half: a hand that holds still for 25 ms at
  // K = 100 is gone. Double: events end later.
  double rest = 5.0;
  // And at least so long while the arm moves [s]. Half: a steady push in motion ends. Double: a
  // false one lasts for 0.3 s more.
  double rest_moving = 0.15;
  // Limits: half of what noise is to exceed hardly ever, for turns to and fro. Half: trembling
  // hands are noise. Double: noise is none.
  double fro = 0.5;
  // Times 1 / K: for how long turns to and fro count, and how many are noise. At K = 100 a hand
  // that trembles at 10 Hz makes 1.6. Half: it counts as noise. Double: noise is an event for
  // longer.
  double fro_memory = 8.0;
  double fro_turns = 3.0;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("reference", "s", t.reference);
    v("gap_sigmas", "1", t.gap_sigmas);
    v("cusum_shift", "sigmas", t.cusum_shift);
    v("cusum_warm_up", "s", t.cusum_warm_up);
    v("cusum_most", "1", t.cusum_most);
    v("refresh", "s", t.refresh);
    v("activity_time", "s", t.activity_time);
    v("noisier", "1", t.noisier);
    v("noise_enough", "values", t.noise_enough);
    v("noise_mean", "1/K", t.noise_mean);
    v("noise_most", "values", t.noise_most);
    v("noise_far", "sigmas", t.noise_far);
    v("noise_doubted", "1", t.noise_doubted);
    v("noise_sure", "sigmas", t.noise_sure);
    v("noise_few", "values", t.noise_few);
    v("first_few", "values", t.first_few);
    v("first_often", "values", t.first_often);
    v("first_clearly", "1", t.first_clearly);
    v("motion_memory", "s", t.motion_memory);
    v("motion_few", "s", t.motion_few);
    v("motion_told", "s", t.motion_told);
    v("motion_times", "1", t.motion_times);
    v("motion_touched", "1", t.motion_touched);
    v("motion_sigmas", "1", t.motion_sigmas);
    v("drift_way", "rad", t.drift_way);
    v("drift_farthest", "rad", t.drift_farthest);
    v("drift_speed", "rad/s", t.drift_speed);
    v("drift_shown", "1", t.drift_shown);
    v("drift_grown", "1", t.drift_grown);
    v("drift_least", "rad", t.drift_least);
    v("friction_speed", "rad/s", t.friction_speed);
    v("friction_turned", "1", t.friction_turned);
    v("friction_few", "s", t.friction_few);
    v("friction_enough", "s", t.friction_enough);
    v("friction_margin", "1", t.friction_margin);
    v("friction_doubt", "1", t.friction_doubt);
    v("friction_quick", "1", t.friction_quick);
    v("friction_stood", "1", t.friction_stood);
    v("friction_turns", "turns", t.friction_turns);
    v("standing", "rad/s", t.standing);
    v("moving", "rad/s", t.moving);
    v("pause", "s", t.pause);
    v("reversal_speed", "rad/s", t.reversal_speed);
    v("confirm", "1/K", t.confirm);
    v("start", "1/K", t.start);
    v("start_samples", "samples", t.start_samples);
    v("alike", "1", t.alike);
    v("warming", "s", t.warming);
    v("warming_most", "1", t.warming_most);
    v("alone", "1", t.alone);
    v("unseen", "1", t.unseen);
    v("barely", "1", t.barely);
    v("trend", "1/K", t.trend);
    v("creep_share", "1", t.creep_share);
    v("hand", "s", t.hand);
    v("hand_times", "1", t.hand_times);
    v("doubtful", "1", t.doubtful);
    v("little", "1", t.little);
    v("trace", "1", t.trace);
    v("slow", "1", t.slow);
    v("spike", "samples", t.spike);
    v("rest", "1/K", t.rest);
    v("rest_moving", "s", t.rest_moving);
    v("fro", "1", t.fro);
    v("fro_memory", "1/K", t.fro_memory);
    v("fro_turns", "1", t.fro_turns);
  }
};

}  // namespace touchline
