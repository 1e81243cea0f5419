// SPDX-License-Identifier: Apache-2.0
// What the search for the place of one contact was tuned with. The friction cone and the free space
// that a push needs are the robot's own (`Pushes`). chi2 and costs have no unit: they are squared
// distances in sigmas of the noise.
// Theory: docs/theory.md, section 8.
#pragma once

namespace touchline {

struct PlaceTuning {
  // ---- What is assumed of forces and places: the prior ----
  // One sigma of the angle by which forces may be beyond the friction cone [rad]: faces of a mesh
  // are flat where links are round. Half: right places on coarse meshes are refused. Double:
  // grazing ones that no push makes are named.
  double cone_softness = 0.1;
  // One sigma of the size of contact forces, where they cannot be seen [N]. Half: pushes of 50 N
  // cost two sigmas where little is measured. Double: open directions make larger false forces.
  double force_scale = 50.0;
  // One sigma of a place on its surface, where it cannot be seen [m]: a link's size. Half: the
  // spread of such places is told too small. Double: it is told larger than the link.
  double place_scale = 0.1;
  // Pushes come near the normal: their angle to it is likely up to `slant`, and beyond falls off
  // with the sigma `slant_sigma` [rad]. Half: oblique pushes are put on faces that they meet
  // straight. Double: of two faces of an edge neither is preferred.
  double slant = 0.3;
  double slant_sigma = 0.2;

  // ---- What explains, and what is said ----
  // Sigmas beyond which one force does not explain a segment. Half: one sample in twenty of a
  // single contact is not explained. Double: two contacts are taken for one for longer.
  double pitch_limit = 4.0;
  // Below this force no place is named [N]. Half: lines of weak forces miss by centimetres where
  // the noise is as told for no less. Double: light touches have no place.
  double least_force = 0.3;
  // Nor is one where the force is not so many sigmas of its own noise. Half: places scatter over
  // whole links. Double: light touches in noise have none.
  double weak_sigmas = 4.0;
  // Cost of the friction cone beyond which nothing is explained: four sigmas. Half and double: 2.8
  // and 5.7 sigmas.
  double implausible_cone = 16.0;
  // Probability of a place that counts as located. Half: one that is as likely wrong as right does.
  // Double is none.
  double certain = 0.9;
  // Explanations nearer than this are one place [m]: a fingertip and a half. Half: both sides of an
  // edge are two. Double: both sides of a thin link are one.
  double place_radius = 0.0225;
  // A place whose spread is more than so many of these radii is not located. Half: 45 mm, many by
  // joint torques are ambiguous. Double: a third of a link counts as located.
  double spread_radii = 4.0;
  // Probability below which a candidate is not told. Half or double: a line more or less in a list.
  double least_told = 1e-3;
  // Of the log of the posterior, below the best: what is less counts as nothing: 5e-5. Half: 0.7 %
  // is left out. Double: time, for nothing.
  double negligible = 10.0;

  // ---- Motion: how old what is felt is ----
  // Of the way that a contact has come since it was felt: what is not known of it, where a steady
  // twist and force are assumed. Half: regions in motion are too small. Double: too large.
  double uncertain_way = 0.1;
  // The same where the past is remembered [m per rad2]: the rest is that of the body's origin, 0.08
  // to 0.1 m in the plane as measured. Half: too sure of turning links. Double: too unsure.
  double uncertain_turn = 0.1;
  // The past counts while so much of the force has kept its direction. Half: means of opposite
  // forces are taken. Double: it begins anew whenever a force turns.
  double past_worn = 0.3;
  // How far points of a body are from its origin [m]: that much of its turn is way. Half and
  // double: of what `uncertain_way` adds.
  double body_reach = 0.15;

  // ---- The search ----
  // Work in one sample on the places of contacts, of all segments together. A unit is a box of a mesh that
  // is looked into, some 0.05 us, and a point that is tried is 10 to 30. What a sample has no work left
  // for, the next ones do. Half: weak contacts are searched for over more samples. Double: samples are late.
  int search_work = 1000;
  // A sample that is shorter has a part of that, in proportion [s]: half of it at 8 kHz. Half: samples at
  // 8 kHz are late. Double: at 4 kHz, too, a search takes more samples, in as much time.
  double short_sample = 2.5e-4;
  // chi2 above the best beyond which an explanation weighs nothing: e^-25. Half: e^-12, which may
  // be seen in a list. Double: time, for nothing.
  double cost_window = 50.0;
  // chi2 above the best where a search is worth while. Half: rims are missed where the line grazes.
  // Double: time.
  double relevant = 25.0;
  // chi2 above the best from which a start may lead to something, and as long as there are few.
  // Half: places behind a ridge are missed. Double: time.
  double rough = 150.0;
  double rough_few = 1e4;
  // Starts on one surface are so far apart [m]. Half: three starts lie together. Double: a small
  // link has only one.
  double start_spacing = 0.04;
  // Farther from the line nothing is what it speaks of [m]. Half: with strong noise the touched
  // link is missed. Double: time.
  double farthest = 0.15;
  // Cost of the friction cone beyond which a point is moved: two sigmas. Half: time. Double: points
  // that are merely grazed stay.
  double grazing = 4.0;
  // Joint torques alone tell no place better than this [m]. Half: time. Double: places a centimetre
  // off the best.
  double coarse = 6e-3;
  // What a place is worth knowing to [m]. Half: time. Double: 2 mm.
  double fine = 1e-3;
  // Points nearer than this are one [m]. Half: a place is listed twice. Double: both faces of a
  // thin edge are one.
  double same_point = 5e-3;
  // Sigmas of a place within which faces are looked for. Half: one in twenty touched faces is
  // missed. Double: time.
  double face_sigmas = 4.0;
  // Faces farther apart are looked at for themselves [m]. Half: time. Double: a rim's other face is
  // missed.
  double faces_apart = 0.015;

  // ---- Moving a point over its surface ----
  // A step goes no farther [m], and a point is looked for within `surface_reach` of it [m]. Half:
  // more steps. Double: steps leave the face on which they were computed.
  double farthest_step = 0.05;
  double surface_reach = 0.06;
  // A shorter one has arrived [m]. Half: a step more. Double: places 0.4 mm off.
  double arrived = 2e-4;
  // Within so far better points are looked for where the cone or an edge stands in the way [m].
  // Half: those behind a rim are missed. Double: a round more of trials.
  double settle_around = 0.064;

  // ---- How a push comes there ----
  // A push that comes from inside a link by `inside_depth` [m] is as unlikely as e^-1, and none is
  // less likely than e^-`inside_most`. Half: where links overlap right places are refused. Double:
  // places inside the arm are named.
  double inside_depth = 3e-3;
  double inside_most = 6.0;
  // A gap is taken as no narrower than this part of a finger, and likely as its width to the power
  // `gap_power`. Half: pushes in gaps are named. Double: they never are.
  double least_gap = 0.1;
  double gap_power = 2.0;

  // ---- The evidence of a place ----
  // One sigma of a force, as a part of it, beyond which the cone bounds it and not the measurement;
  // then the evidence is summed up over the cone. Half: time. Double: Laplace's formula errs by
  // tens of per cent.
  double wide = 0.12;
  // Sigmas to both sides that are summed up over. Half: a third is left out. Double: coarser steps.
  double wide_sigmas = 3.0;

  // ---- Offsets ----
  // Sigmas beyond which an offset is no noise. Half: noise of baselines is taken out, which adds
  // its own. Double: small offsets bend lines of weak forces.
  double offset_sigmas = 3.0;
  // Part of a sample's variance that a baseline of 20 / K has: less is sure. Half: after 40 / K.
  // Double: after 10 / K.
  double offset_sure = 0.1;
  // Joint torques at rest are averaged in blocks of so long [s], and a touch is detected within
  // one. Half: its rise counts as rest. Double: a rest of less than 0.2 s tells nothing.
  double rest_block = 0.05;
  // Their scatter is remembered over so long [s]. Half: it errs by a third. Double: what another
  // posture has shown counts for 4 s.
  double rest_memory = 2.0;

  // ---- The region, for those who ask: it takes milliseconds ----
  // Edge of a cell in sigmas of the place, within `cell_core` sigmas; beyond, edges grow by
  // `cell_growth` per sigma. Half: four times the cells. Double: regions err by some per cent.
  double cell_edge = 0.6;
  double cell_core = 4.0;
  double cell_growth = 0.4;
  // And no edge is longer [m]. Half: four times the cells. Double: curved links are cut through.
  double cell_length = 0.04;
  // Sigmas beyond which there is nothing. Half: long tails are cut off. Double: time.
  double cell_reach = 9.0;
  // chi2 above the best up to which an explanation shapes cells. Half and double: more or fewer.
  double cell_close = 25.0;
  // Of the log of the density, below the densest cell, that is looked at for free space. Half:
  // parts inside of the arm are told. Double: time.
  double cell_negligible = 15.0;

  // A place that is less sure than this is not located [m].
  double spread_limit() const { return spread_radii * place_radius; }

  template <class Self, class Visit>
  static void visit(Self& t, Visit&& v) {
    v("cone_softness", "rad", t.cone_softness);
    v("force_scale", "N", t.force_scale);
    v("place_scale", "m", t.place_scale);
    v("slant", "rad", t.slant);
    v("slant_sigma", "rad", t.slant_sigma);
    v("pitch_limit", "sigmas", t.pitch_limit);
    v("least_force", "N", t.least_force);
    v("weak_sigmas", "sigmas", t.weak_sigmas);
    v("implausible_cone", "chi2", t.implausible_cone);
    v("certain", "1", t.certain);
    v("place_radius", "m", t.place_radius);
    v("spread_radii", "1", t.spread_radii);
    v("least_told", "1", t.least_told);
    v("negligible", "nats", t.negligible);
    v("uncertain_way", "1", t.uncertain_way);
    v("uncertain_turn", "m/rad2", t.uncertain_turn);
    v("past_worn", "1", t.past_worn);
    v("body_reach", "m", t.body_reach);
    v("search_work", "units", t.search_work);
    v("short_sample", "s", t.short_sample);
    v("cost_window", "chi2", t.cost_window);
    v("relevant", "chi2", t.relevant);
    v("rough", "chi2", t.rough);
    v("rough_few", "chi2", t.rough_few);
    v("start_spacing", "m", t.start_spacing);
    v("farthest", "m", t.farthest);
    v("grazing", "chi2", t.grazing);
    v("coarse", "m", t.coarse);
    v("fine", "m", t.fine);
    v("same_point", "m", t.same_point);
    v("face_sigmas", "sigmas", t.face_sigmas);
    v("faces_apart", "m", t.faces_apart);
    v("farthest_step", "m", t.farthest_step);
    v("surface_reach", "m", t.surface_reach);
    v("arrived", "m", t.arrived);
    v("settle_around", "m", t.settle_around);
    v("inside_depth", "m", t.inside_depth);
    v("inside_most", "nats", t.inside_most);
    v("least_gap", "1", t.least_gap);
    v("gap_power", "1", t.gap_power);
    v("wide", "1", t.wide);
    v("wide_sigmas", "sigmas", t.wide_sigmas);
    v("offset_sigmas", "sigmas", t.offset_sigmas);
    v("offset_sure", "1", t.offset_sure);
    v("rest_block", "s", t.rest_block);
    v("rest_memory", "s", t.rest_memory);
    v("cell_edge", "sigmas", t.cell_edge);
    v("cell_core", "sigmas", t.cell_core);
    v("cell_growth", "1", t.cell_growth);
    v("cell_length", "m", t.cell_length);
    v("cell_reach", "sigmas", t.cell_reach);
    v("cell_close", "chi2", t.cell_close);
    v("cell_negligible", "nats", t.cell_negligible);
  }
};

}  // namespace touchline
