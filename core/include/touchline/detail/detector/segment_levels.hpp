// SPDX-License-Identifier: Apache-2.0
// The life of what a segment feels: when it becomes an event, what that most likely is, a push or the
// arm's own doing, and when it is over. What is left of it may come to rest as an offset. No
// allocation after construction.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/activity.hpp"
#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/friction_seen.hpp"
#include "touchline/detail/detector/row_offsets.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

// What has been seen of a segment's noise since observation began.
enum class Seen { little, some, enough };

// What the tests say of a segment at one sample.
struct SegmentScore {
  double peak = 0.0;       // the largest share of its rows
  double score = 0.0, borne = 0.0;  // of all tests, in thresholds; of what no single sample moves
  double collision = 0.0, borne_collision = 0.0;  // of its rows, in thresholds of a collision
  double age = 0.0;        // since its first settled sample [s]
  Seen seen = Seen::little;
};

class SegmentLevels {
 public:
  // All that is handed over stays the caller's.
  SegmentLevels(const DetectorRows& rows, const ActivityMeter& motion, const DetectionTimes& times,
                const DetectorTuning& tuning, RowOffsets& offsets, FrictionSeen& friction)
      : rows_(rows),
        motion_(motion),
        times_(times),
        tuning_(tuning),
        offsets_(offsets),
        friction_(friction),
        segments_(rows.segments()),
        levels_(rows.segments(), 0) {}

  const std::vector<int>& levels() const { return levels_; }  // per segment: a `Level`
  bool is_felt(std::size_t g) const { return levels_[g] > 0; }
  // Does a test hold, but not for long enough yet?
  bool is_pending(std::size_t g) const { return segments_[g].contact.holds; }
  bool is_quiet(std::size_t g) const { return !is_felt(g) && !is_pending(g); }
  // May offsets be followed: is nothing felt, or only by what has been an offset since?
  bool adapts(std::size_t g, double peak) const {
    return is_felt(g) ? peak < times_.release : !is_pending(g);
  }

  // Is what is felt of a segment most likely the arm's own doing: an error of its model in motion?
  bool is_own_doing(std::size_t g) const {
    return began_by_itself(g) || (is_off(g) && motion_.moves() && is_learned(g));
  }
  // The same, as it began as no push does.
  bool began_by_itself(std::size_t g) const {
    return is_off(g) && motion_.moves() && segments_[g].origin != Origin::push;
  }
  // May it be so, as far as one can tell? In motion an arm that has shown anywhere that it is not as told
  // feels what begins as no push does. So it does, before motion has shown how much the model errs, what
  // is no larger than its offsets let expect.
  bool may_be_own_doing(std::size_t g) const {
    const Segment& s = segments_[g];
    const bool moves = s.in_motion || motion_.moves();  // or has it set off since?
    if (!s.arm_off || !moves) return false;
    return s.origin != Origin::push || (s.moved < tuning_.motion_told && is_expected(g));
  }

  // Motion has yet to show how much the model of this segment errs.
  void expect_errors(std::size_t g) { segments_[g].moved = 0.0; }

  // Does an error of the model begin to show, or may it grow after it has been felt? Then it is learned
  // quickly. What exceeds its limits anew may be a push.
  bool is_beginning(std::size_t g) const {
    return is_felt(g) ? is_own_doing(g) : segments_[g].grows > 0.0 && !is_pending(g);
  }

  // Has the arm shown that it is not as told, and does it move, or has it since the event began?
  bool has_moved_off(std::size_t g) const {
    return is_off(g) && (segments_[g].in_motion || motion_.moves());
  }

  // Does a sensor's wrench change faster than motions do? That is not learned as one of their errors.
  bool steps(std::size_t g) const {
    for (const std::size_t i : rows_.of(g)) {
      if (!rows_.of_wrench(i) || !rows_.samples[i].known) continue;
      if (offsets_.quick(i) > std::max(rows_[i].contact, offsets_.creep(i))) return true;
    }
    return false;
  }

  // A sample, dt [s] after the one before.
  void decide(std::size_t g, const SegmentScore& now, double dt) {
    Segment& s = segments_[g];
    if (is_joined(g)) {  // what there was is an offset, and the push is its own event
      come_to_rest(g);
      s.lasted = 0.0;
      s.in_motion = true;
      return;
    }
    const bool quiet = is_quiet(g);
    const bool may_begin = now.score > 1.0 || now.collision > 1.0 || (is_off(g) && motion_.moves());
    if (quiet && may_begin) s.origin = origin(g, now, dt);
    // What creeps may be over its limit a moment before a push is: that has no before.
    const bool recent = s.lasted < tuning_.trend / rows_.slowest(g);
    const bool other = s.origin == Origin::reversal || (s.origin == Origin::creep && recent);
    if ((!quiet || may_begin) && other && is_pushed(g)) s.origin = Origin::push;
    s.contact.advance(now.score, dt);
    s.collision.advance(now.collision, dt);
    // What motion shows soon exceeds no limit; it need not fall below a part of it. Where samples are slow,
    // nor need what was strong: single ones of noise are all that is left of it.
    const bool was_strong = rows_.is_slow(g, tuning_.slow) && tuning_.trace * s.top > 1.0;
    const double release = is_own_doing(g) || was_strong ? 1.0 : times_.release;
    s.below = lasting(now.score < release, dt, s.below);
    if (lasts(g, s.contact, now, now.score, now.borne)) levels_[g] = std::max(levels_[g], 1);
    if (lasts(g, s.collision, now, now.collision, now.borne_collision)) levels_[g] = 2;
    if (!is_felt(g)) {
      s.top = s.top_wrench = s.rest = s.back = s.below = s.lasted = s.clear = 0.0;
      s.in_motion = motion_.moves();
      s.arm_off = is_arm_off();
      if (s.in_motion) s.moved += dt;
      s.grows = std::max(0.0, s.grows - dt);
      if (is_off(g) && motion_.moves()) s.shown += dt;
      return;
    }
    follow(g, dt);
  }

 private:
  enum class Origin {  // what an event began with
    start,     // of observation: an offset that has yet to be seen whole
    reversal,  // only of joints that hardly move, as friction does that changes its sign
    creep,     // no faster than motions change
    push
  };

  // Does a test hold, since when without a break [s], and how high has its score been meanwhile?
  struct Holding {
    bool holds = false;
    double since = 0.0, highest = 0.0;
    void advance(double score, double dt) {
      const bool now = score > 1.0;
      since = now && holds ? since + dt : 0.0;
      holds = now;
      highest = now ? std::max(highest, score) : 0.0;
    }
    void end() {
      holds = false;
      since = 0.0;
    }
  };

  struct Segment {
    Holding contact, collision;
    Origin origin = Origin::start;
    bool in_motion = false;  // did the present event begin while the arm moved?
    double grows = 0.0;  // for how long what was the arm's own doing may go on to grow [s]
    bool arm_off = false;  // has the arm shown that it is not as told, up to now in an event?
    double moved = 0.0;  // for how long the arm has moved, but for events [s]
    double shown = 0.0;  // for how long motion had shown before it what the arm is off by [s]
    // Of the present event, for how long [s]:
    double lasted = 0.0;
    double clear = 0.0;  // it has been known to exceed its limits clearly
    double below = 0.0;  // it has been below what releases it
    double rest = 0.0;   // little has been left of it, and that has not changed
    double back = 0.0;   // all has been as before the offset that stands there now
    // Its largest mean of the last moments, in limits; the same of the sensors' rows alone.
    double top = 0.0, top_wrench = 0.0;
  };

  // Has the arm shown that it is not as told?
  bool is_off(std::size_t g) const { return rows_.off[g] != 0; }
  bool is_arm_off() const {
    for (std::size_t g = 0; g < segments_.size(); ++g)
      if (is_off(g)) return true;
    return false;
  }

  // Is the present event as small as motion may make of the offsets that the arm has shown, on sensors
  // where the segment has one?
  bool is_expected(std::size_t g) const {
    const Segment& s = segments_[g];
    const Rows which = s.top_wrench > 0.0 ? Rows::wrench : Rows::all;
    double offset = 0.0;
    for (std::size_t i = 0; i < rows_.size(); ++i)
      if (counts(i, which)) offset = std::max(offset, offsets_.shown(i) / rows_.limit(i));
    return (which == Rows::all ? s.top : s.top_wrench) < tuning_.motion_times * offset;
  }

  // May a push that has lasted for so long be an error of the model after all? Not where motion had
  // shown for as long how large these are, and a sensor has clearly more: friction loads joints alone.
  bool is_learned(std::size_t g) const {
    const Segment& s = segments_[g];
    return s.lasted > tuning_.hand && !(s.shown > tuning_.hand && s.top_wrench > tuning_.hand_times);
  }

  // Which rows of a segment: all, or those that its sensor's wrench has.
  enum class Rows { all, wrench };
  bool counts(std::size_t i, Rows which) const {
    return rows_.samples[i].known && (which == Rows::all || rows_.of_wrench(i));
  }

  // The present event goes on, or ends.
  void follow(std::size_t g, double dt) {
    Segment& s = segments_[g];
    s.lasted += dt;
    s.arm_off = s.arm_off || is_arm_off();
    s.top = std::max(s.top, lately(g));
    s.top_wrench = std::max(s.top_wrench, lately(g, Rows::wrench));
    if (s.top > tuning_.barely) s.clear += dt;
    s.rest = lasting((may_rest(g) && is_steady(g)) || only_joints_left(g), dt, s.rest);
    if (s.below >= hold(g)) {
      levels_[g] = 0;
      s.grows = times_.hold - s.below;  // only the arm's own doing ends before
    }
    const double least = tuning_.rest / rows_.slowest(g);
    const double least_moving = std::max(least, tuning_.rest_moving);
    if (is_felt(g) && s.rest >= (motion_.stands() ? least : least_moving)) come_to_rest(g);
    const bool back = motion_.stands() && offsets_.is_back(g, times_.release) && is_steady(g);
    s.back = lasting(back, dt, s.back);
    if (is_felt(g) && s.back >= least_moving) go_back(g);
  }

  // Has a test held for long enough, not by one sample alone, and not by noise that has yet to be
  // seen? Where a test need not last, its threshold is one of calibration, which has met all that.
  bool lasts(std::size_t g, const Holding& test, const SegmentScore& now, double score,
             double borne) const {
    if (!test.holds || test.since < times_.min_duration) return false;
    if (times_.min_duration <= 0.0) return true;
    const Segment& s = segments_[g];
    const bool barely = s.contact.highest < tuning_.barely && is_off(g) && motion_.moves();
    const double moments = tuning_.trend / rows_.slowest(g);
    if (barely && test.since < moments) return false;  // an error of the model passes
    switch (now.seen) {
      case Seen::little: return score > tuning_.unseen;
      case Seen::some: return score > tuning_.alone;
      default: return score > tuning_.alone || borne > 1.0;
    }
  }

  // How long an event must be below what releases it, to end [s]: what wavers about that is one push. Of
  // the arm's own doing limits have grown, and it is over with the mean of the last moments.
  double hold(std::size_t g) const {
    return is_own_doing(g) ? std::min(times_.hold, tuning_.trend / rows_.slowest(g)) : times_.hold;
  }

  // For how long something has held, but for single samples of noise.
  double lasting(bool holds, double dt, double duration) const {
    return holds ? duration + dt : std::max(0.0, duration - tuning_.spike * dt);
  }

  // What an event that begins now would have begun with.
  Origin origin(std::size_t g, const SegmentScore& now, double dt) const {
    const double settled = tuning_.start / rows_.slowest(g) + tuning_.start_samples * dt;
    if (now.age < settled) return Origin::start;
    bool slow = true, creeps = true;
    for (const std::size_t i : rows_.of(g)) {
      if (rows_.shares[i] < std::min(1.0, now.peak)) continue;
      slow = slow && rows_.samples[i].slowest < tuning_.reversal_speed &&
             friction_.explains_onset(i);
      creeps = creeps && offsets_.quick(i) < offsets_.creep(i);
    }
    return slow ? Origin::reversal : creeps ? Origin::creep : Origin::push;
  }

  // Has a sensor's wrench stepped over its limit? Friction in joints, whichever moves them, does not
  // load a sensor: what began with joints that hardly move is a push after all. So is what began while
  // the sensor was lost, if it shows a load when it is known again. Friction of a joint that turns loads
  // no other joint either: one that is clearly over its limit, and not by friction, is pushed.
  bool is_pushed(std::size_t g) const {
    const bool reversal = segments_[g].origin == Origin::reversal;
    for (const std::size_t i : rows_.of(g)) {
      const bool wrench = rows_.of_wrench(i);
      if (rows_.shares[i] < (wrench ? 1.0 : tuning_.barely)) continue;
      if (!wrench && (!reversal || friction_.explains(i))) continue;
      if (offsets_.is_anew(i) || offsets_.quick(i) >= offsets_.creep(i)) return true;
    }
    return false;
  }

  // Is what is felt an error of the model, though nothing else has shown that there is one? Joints alone
  // have felt it, of an arm in motion, hardly over their limits, for longer than pushes take to rise. What
  // has clearly exceeded them within the last moments may be a push on top of that.
  bool is_faint(std::size_t g) const {
    const Segment& s = segments_[g];
    return s.in_motion && s.top_wrench <= 1.0 && s.clear < tuning_.trend / rows_.slowest(g) &&
           s.lasted - s.clear > tuning_.rest_moving;
  }

  // Does a push join what most likely is the arm's own doing, or what only joints have felt, of an arm
  // in motion that is not as told or is felt but faintly? A sensor's wrench then steps by more than its
  // limit. What lasts for less than the mean of the last moments has no before.
  bool is_joined(std::size_t g) const {
    const Segment& s = segments_[g];
    if (!is_felt(g) || !(has_moved_off(g) || is_faint(g))) return false;
    if (s.top_wrench > 1.0 && (s.origin == Origin::push || !is_own_doing(g))) return false;
    if (s.lasted < tuning_.trend / rows_.slowest(g)) return false;
    for (const std::size_t i : rows_.of(g))
      if (counts(i, Rows::wrench) && offsets_.quick(i) > rows_.limit(i)) return true;
    return false;
  }

  // May what the last moments have of a contact be friction or an error of the model? Only if it is
  // little of the contact's peak. An arm that stands must have shown that it is not as told. Of one
  // that moves, by itself and not by the contact alone, hardly anything may be left. Two contacts
  // against each other leave more.
  bool may_rest(std::size_t g) const {
    const Segment& s = segments_[g];
    const bool little = s.origin == Origin::start || lately(g) < tuning_.little * s.top;
    if (!little || !(is_off(g) || s.in_motion)) return false;
    return motion_.stands() ? is_off(g) : lately(g) < std::max(tuning_.barely, tuning_.trace * s.top);
  }

  // Does nothing of a contact load the segment's sensors any more, of such an arm? What its joints
  // then have is friction that has changed meanwhile: no contact that clamps the arm loses its load on
  // the sensors at once and keeps that on the joints. A sensor that is lost says nothing of its load.
  bool only_joints_left(std::size_t g) const {
    return has_moved_off(g) && segments_[g].top_wrench > 1.0 && knows_wrench(g) &&
           lately(g, Rows::wrench) < times_.release && is_steady(g, Rows::wrench);
  }
  bool knows_wrench(std::size_t g) const {
    for (const std::size_t i : rows_.of(g))
      if (counts(i, Rows::wrench)) return true;
    return false;
  }

  // The mean of the last moments, in limits: the largest of a segment's rows.
  double lately(std::size_t g, Rows which = Rows::all) const {
    double most = 0.0;
    for (const std::size_t i : rows_.of(g))
      if (counts(i, which)) most = std::max(most, std::fabs(offsets_.lasting(i)) / rows_.limit(i));
    return most;
  }

  // Has no row of the segment changed of late by what would matter?
  bool is_steady(std::size_t g, Rows which = Rows::all) const {
    for (const std::size_t i : rows_.of(g))
      if (counts(i, which) && offsets_.quick(i) > times_.release * rows_.limit(i)) return false;
    return true;
  }

  void come_to_rest(std::size_t g) {
    offsets_.come_to_rest(g);
    end(g);
  }
  void go_back(std::size_t g) {
    offsets_.go_back(g);
    end(g);
  }
  void end(std::size_t g) {
    for (const std::size_t i : rows_.of(g)) friction_.rest(i);
    levels_[g] = 0;
    Segment& s = segments_[g];
    s.contact.end();
    s.collision.end();
    s.below = s.top = s.top_wrench = s.rest = s.back = s.clear = 0.0;
  }

  const DetectorRows& rows_;
  const ActivityMeter& motion_;
  const DetectionTimes& times_;
  const DetectorTuning& tuning_;
  RowOffsets& offsets_;
  FrictionSeen& friction_;
  std::vector<Segment> segments_;
  std::vector<int> levels_;
};

}  // namespace touchline
