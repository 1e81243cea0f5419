// SPDX-License-Identifier: Apache-2.0
// What the tracking of contacts was tuned with: one or several on a segment, over time. K is the
// bandwidth of the segment's filter, so that 1 / K is its memory. chi2 and costs have no unit: they
// are squared distances in sigmas of the noise.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct LocalizerTuning {
  // ---- The life of a contact ----
  // Times 1 / K until a contact counts as known: the filter then shows 95 % of it. Half: second
  // contacts are looked for in what the first has yet to show. Double: a second one that begins
  // within 6 / K is told as one that cannot be separated.
  double young = 3.0;
  // Times 1 / K between fits of a sole contact, and between notes of what is known: filtered noise
  // tells little new sooner. Half: time. Double: slow slides are followed in steps.
  double refit = 0.5;
  // Times 1 / K between searches; in between the same places are looked at. Half: time. Double: a
  // face that comes into question is met later.
  double look = 0.35;
  // Times 1 / K: how old a note of what is known gets once forces have risen. Half: the rise of a
  // newcomer, or the first millimetres of a slide taken for a change of force, are in it. Double:
  // what crept since is missing.
  double lasting = 2.0;
  // They have, when the filter lacks less than this part. Half: a slide in the first tenth of a second
  // breaks off. Double: a newcomer in it is placed with a force that was not whole.
  double risen_note = 1e-4;
  // Places that differ by less are the same [m]: no mesh is better. Half or double: noise-free
  // only.
  double same_place = 2e-3;
  // Sigmas of two places within which they agree. Half: one in eight samples disagrees by chance.
  // Double: slides are noticed twice as late.
  double agree_sigmas = 3.0;
  // Times 1 / K until what is not explained is told as a newcomer, even without a place. Half:
  // noise is told now and then. Double: it is told later.
  double suspected = 2.0;
  // A filtered force is at most so many times 1 / K old: what is left of it by then is hardly felt.
  // Half: forces that fall are taken for younger. Double: noise is taken for old.
  double oldest = 5.0;

  // ---- Do known contacts explain: data association ----
  // Gate in sigmas of a normal variable within which forces are held. Half: forces follow noise.
  // Double: they change late.
  double gate_held = 3.0;
  // Gate beyond which known contacts do not explain a sample. Independent looks come every 2 / K:
  // with ideal noise and K = 100 rad/s there is one false arrival in 19 h of contact. Half: one in
  // a second. Double: second contacts must be several newtons stronger.
  double gate_arrival = 5.0;

  // ---- Process noise of known contacts ----
  // Variance of a place before it is known [m2]: 0.1 m. Half and double: nothing, it is measured at
  // once.
  double anywhere = 1e-2;
  // Of forces that are held [N2/s]: a hand trembles by 0.02 N in a second. Half: regions of several
  // contacts get too small where forces walk. Double: too wide.
  double tremor = 3e-4;
  // How restless a hand is follows from its last moments [s]: three waves of one that trembles at 10
  // Hz. Half: it wavers. Double: a step counts as unrest for longer.
  double unrest_memory = 0.3;
  // A sole force must have moved by so many times what noise lets expect, squared: two looks do
  // once in 3000 by chance. Half: steady hands are followed with less care. Double: a second
  // contact beside a hand that trembles by 0.1 N is placed too surely.
  double unrest_clear = 4.0;
  // And of several, the corrections of a force, squared: then its unrest grows, at most so many
  // times in 2 / K. Half: it grows by chance, or slowly. Double: late, or by leaps.
  double unrest_more = 2.0;
  double unrest_step = 4.0;
  // Places are learnt over many looks, and a tremor of 1 to 10 Hz goes one way for several. The
  // variance of a restless force then grows by so many times the sum over looks. Half: regions of
  // trembling contacts are too small. Double: a second one passes for the first's unrest.
  double unrest_lasts = 3.0;
  // Doubt of how much a force that rises still changes, and of its direction, in parts of the
  // variance foreseen. Half: too sure in the rise. Double: too wide there.
  double doubt = 0.05;
  double doubt_across = 0.005;
  // Variance of a place at least [m2]: 20 um. Half or double: noise-free only.
  double sharpest = 4e-10;
  // And what places add in a second [m2/s]: 45 um. Half: slow slides break off. Double: places of
  // several contacts scatter more.
  double place_creep = 2e-9;

  // ---- Contacts that slide, let go or meet ----
  // They slide no faster [m/s]. Half: a fast stroke is a second contact. Double: a second contact
  // nearby counts as a slide for longer.
  double fastest_slide = 0.5;
  // Of chi2: a difference that tells which one slides; three sigmas. Half: the wrong one now and
  // then. Double: it is ambiguous for longer.
  double slide_margin = 9.0;
  // And in sigmas, what counts against one that cannot slide. Half and double: how long it takes to
  // be decided.
  double slide_never = 5.0;
  // Times 1 / K of rest, where it cannot be told which one has slid. Half: decided by less. Double:
  // ambiguous for 0.2 s at K = 100.
  double slide_long = 10.0;
  // A contact lets go if what is said takes its force back: cosine below minus this, and at most so
  // many times its force. Half: contacts against each other count. Double: nothing does.
  double back_straight = 0.95;
  double back_most = 1.1;
  // A contact has gone if its force is less than so many of its sigmas. Half: noise keeps it for
  // longer. Double: weak contacts beside strong ones end.
  double gone_sigmas = 4.0;

  // ---- Events: the mean over a contact's samples ----
  // Samples above this part of the peak so far speak for an event: for its force, its joint and its
  // place. Half: the rise of a push, when little is known, has a part in its place. Double: only
  // the peak itself has, one sample's noise.
  double strong_share = 0.5;
  // No sample rules a place out: its probability is at least this. Half or double: two thirds of a
  // nat of evidence.
  double floor = 1e-3;
  // Independent looks that an event is worth at most: less of what errs may be known to err alike in all
  // than does. Half: less sure of long events. Double: too sure with errors of the model.
  double looks = 3.0;
  // Variance that meshes add to a place [m2]: 0.1 mm. Half or double: noise-free only.
  double smoothness = 1e-8;

  // ---- Evidence for links, by joint torques alone ----
  // What any joint's torque shows of the largest load, in parts of the error of gains: a sensor is
  // bent by all that its joint carries, and a hand is no point. Half: too sure of the link. Double:
  // links are told apart less often.
  double crosstalk = 1.5;
  // One sigma of a joint's torque, in parts of what it shows at rest: friction and payloads change
  // as the arm gives way. Half: too sure of links where there is friction. Double: arms that are
  // off, but steadily, tell links apart less often.
  double offset_doubt = 0.5;
  // All patches are looked at within so long [s]. Half: twice the time in a sample. Double: bodies
  // get their probability 30 ms later.
  double walk = 0.03;
  // The step of a touch is remembered over so long [s]. Half: its mean is noisier. Double: it lags
  // behind a force that changes.
  double step_memory = 1.0;
  // An arm that has moved so far stands elsewhere [rad or m]. Half: less is averaged in motion.
  // Double: postures are mixed.
  double turned = 0.05;
  // Of the step: less is no other step, and needs no other walk. Half: time. Double: shares are
  // old.
  double changed = 0.03;
  // Of the log of the evidence, below the best, that counts as nothing. Half: 0.2 % is left out.
  // Double: time.
  double negligible_patch = 12.0;

  // ---- Two contacts that begin together ----
  // Work on them in a second of the sensors' clock: a unit is three pairs of points that are tried, or a
  // box of a mesh that is looked into, some 0.04 us. A sample has its share: 62 us at 1 kHz, 8 us at 8 kHz.
  // Half: fewer places are narrowed within 0.1 s of the onset. Double: samples are late.
  int pair_work = 1540000;
  // Times 1 / K until forces are worth a second search, and a walk from it. Half: it walks on a force
  // of 63 %. Double: later.
  double risen = 2.0;
  // Searches are so far apart, as a part of the time since the first. Half: time. Double: later.
  double search_growth = 0.5;

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("young", "1/K", t.young);
    v("refit", "1/K", t.refit);
    v("look", "1/K", t.look);
    v("lasting", "1/K", t.lasting);
    v("risen_note", "1", t.risen_note);
    v("same_place", "m", t.same_place);
    v("agree_sigmas", "sigmas", t.agree_sigmas);
    v("suspected", "1/K", t.suspected);
    v("oldest", "1/K", t.oldest);
    v("gate_held", "sigmas", t.gate_held);
    v("gate_arrival", "sigmas", t.gate_arrival);
    v("anywhere", "m2", t.anywhere);
    v("tremor", "N2/s", t.tremor);
    v("unrest_memory", "s", t.unrest_memory);
    v("unrest_clear", "1", t.unrest_clear);
    v("unrest_more", "1", t.unrest_more);
    v("unrest_step", "1", t.unrest_step);
    v("unrest_lasts", "1", t.unrest_lasts);
    v("doubt", "1", t.doubt);
    v("doubt_across", "1", t.doubt_across);
    v("sharpest", "m2", t.sharpest);
    v("place_creep", "m2/s", t.place_creep);
    v("fastest_slide", "m/s", t.fastest_slide);
    v("slide_margin", "chi2", t.slide_margin);
    v("slide_never", "sigmas", t.slide_never);
    v("slide_long", "1/K", t.slide_long);
    v("back_straight", "1", t.back_straight);
    v("back_most", "1", t.back_most);
    v("gone_sigmas", "sigmas", t.gone_sigmas);
    v("strong_share", "1", t.strong_share);
    v("floor", "1", t.floor);
    v("looks", "1", t.looks);
    v("smoothness", "m2", t.smoothness);
    v("crosstalk", "1", t.crosstalk);
    v("offset_doubt", "1", t.offset_doubt);
    v("walk", "s", t.walk);
    v("step_memory", "s", t.step_memory);
    v("turned", "rad", t.turned);
    v("changed", "1", t.changed);
    v("negligible_patch", "nats", t.negligible_patch);
    v("pair_work", "units/s", t.pair_work);
    v("risen", "1/K", t.risen);
    v("search_growth", "1", t.search_growth);
  }
};

}  // namespace touchline
