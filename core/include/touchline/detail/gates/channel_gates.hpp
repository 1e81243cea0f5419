// SPDX-License-Identifier: Apache-2.0
// Is what a channel reports possible? Judges each channel of a sample against its own past, before
// anything is estimated from it. What cannot be is held for a few samples, then left out as NaN.
//
// A jump of one channel: no contact moves one channel alone. What a force does to one axis of a
// sensor, it does to others too, to the sensors and joints inboard, or to the speed. So a jump
// counts as a fault only where nothing else in the sample bears it out. If the new level then
// stays and lives (its last digits move), it is taken after all, a few samples late, unless there
// is a sensor inboard that would have had to feel it too. Dry friction that the description knows
// turns within a sample or two as its joint does: that is no jump.
//
// A stuck channel (stuck_watch.hpp), and a velocity that is not the derivative of its position
// (speed_watch.hpp), are left out. Where a position or a velocity is not believed, the other one of the
// joint stands in for it (joint_ways.hpp).
//
// Limits follow from what this arm has shown, and from physics where it has shown nothing yet.
// Theory: docs/theory.md, sections 3.1, 3.2 and 3.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <utility>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/gates/gate_limits.hpp"
#include "touchline/detail/gates/joint_ways.hpp"
#include "touchline/detail/gates/speed_watch.hpp"
#include "touchline/detail/gates/stuck_watch.hpp"
#include "touchline/detail/gates/tuning.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/robot.hpp"
#include "touchline/sample.hpp"

namespace touchline {

// Does a channel that is told reach the estimates?
enum class Passes { no, begins, goes_on };

// A channel is at another level, and no other one bears that out.
enum class Moved {
  no,
  alone,   // a push may do that, but not within one sample as a blow
  wrongly  // a contact would have moved others too
};

class ChannelGates {
 public:
  // Of a robot whose parts fit.
  explicit ChannelGates(const Robot& robot, const GatesTuning& tuning = {})
      : tuning_(tuning),
        at_{robot.joints.size(), robot.sensors.size()},
        period_(std::max(robot.noise.period, kShortest)),
        memory_(std::min(1.0, period_ / tuning_.memory)),
        warm_up_(samples(tuning_.warm_up, tuning_.least_seen)),
        held_most_(std::min(samples(tuning_.held, tuning_.sure + 1), tuning_.held_most)),
        return_(samples(tuning_.returns, tuning_.good)),
        dwell_(samples(tuning_.dwell, tuning_.least_dwell)),
        limits_(robot, at_, period_, tuning_),
        stuck_(at_.tau(), at_.count(), silent(), tuning_),
        speeds_(at_.joints, period_, silent(), tuning_),
        ways_(at_.joints, period_, tuning_),
        now_(at_.count()),
        last_(at_.count(), kNever),
        out_(at_.count()),
        candidate_(at_.count()),
        mean_(at_.count()),
        step_(at_.count()),
        ratio_(at_.count()),
        ratio_before_(at_.count()),
        spiked_(at_.count(), -std::numeric_limits<double>::infinity()),
        moved_(at_.count(), Moved::no),
        unproven_(at_.count(), 0),
        read_(6 * at_.sensors),
        read_step_(6 * at_.sensors),
        read_step_before_(6 * at_.sensors),
        grown_(6 * at_.sensors, 0),
        shown_from_(at_.joints),
        far_(at_.joints),
        since_(at_.count()),
        calm_(at_.count()),
        passes_(at_.count(), Passes::no),
        fault_(at_.count(), Fault::none) {
    for (std::size_t j = 0; j < at_.joints; ++j) {
      if (robot.joints[j].measured() && robot.joints[j].rough()) rough_.push_back({j, robot.joints[j]});
    }
  }

  ChannelGates(const ChannelGates&) = delete;
  ChannelGates& operator=(const ChannelGates&) = delete;

  const ChannelLayout& layout() const { return at_; }

  // The sample to go on with: `sample` itself as long as all channels are believed, else one that
  // stays valid until the next call.
  Sample judge(const Sample& sample) {
    const double dt = sample.time - time_;
    if (!(dt > 0.0)) return refused(sample);
    refusals_ = 0;
    time_ = sample.time;
    gather(sample);
    const bool gap = !(dt < tuning_.step_periods * period_);
    const bool usual = measure(dt);
    if (any_unproven_) prove();
    if (!usual || !all_sound_ || absurd_ || gap) settle(dt, gap);
    learn();
    track(dt, gap);
    const bool differ = !gap && speeds_.compare(now_, last_, dt, rate_);
    if (differ || (!gap && any_far_)) judge_speeds();
    if (moving() && stuck_.count_changes(now_, last_, dt, rate_) && seen_ > warm_up_) find_stuck();
    std::copy(now_.begin(), now_.end(), last_.begin());
    return all_sound_ ? sample : believed(sample.time);
  }

  bool all_sound() const { return all_sound_; }
  // Does any channel say nothing yet of how fast anything grows: is it held, or has it stepped where its
  // own sensor alone bears it out, and not changed since? A sensor that dies steps by one force, too.
  bool any_unproven() const { return any_unproven_ || !all_sound_; }
  bool unproven(std::size_t c) const { return unproven_[c] != 0 || fault_[c] == Fault::spike; }
  // Of positions and velocities that were not there: what another one stands in for.
  Health absent() const { return absent_; }
  // Has channel c jumped twice of late since the last call, or been taken at another level, which no
  // other one bears out?
  Moved take_moved(std::size_t c) { return std::exchange(moved_[c], Moved::no); }
  // The same, and it may be asked again.
  Moved moved_lately(std::size_t c) const { return moved_[c]; }
  // Has any channel, and was not taken yet?
  bool any_moved() const {
    return std::any_of(moved_.begin(), moved_.end(), [](Moved moved) { return moved != Moved::no; });
  }
  // Does a channel that is told reach the estimates again, which have yet to settle? They begin anew
  // with the first such sample.
  bool passes(std::size_t c) const { return passes_[c] != Passes::no; }
  bool begins_to_pass(std::size_t c) const { return passes_[c] == Passes::begins; }
  // Per channel; ratio: of its last step over what is believed at once.
  const std::vector<Fault>& faults() const { return fault_; }
  const std::vector<double>& ratios() const { return ratio_; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kShortest = 1e-6;    // [s] of a period
  static constexpr double kAgain = 0.5;        // [s] within which a second jump is no accident
  int samples(double seconds, int least) const {
    return std::max(least, static_cast<int>(std::lround(std::min(seconds / period_, 1e6))));
  }
  int silent() const { return samples(tuning_.silent, tuning_.least_silent); }

  void gather(const Sample& sample) {
    const std::size_t n = at_.joints;
    std::copy_n(sample.q, n, now_.data() + at_.q());
    std::copy_n(sample.qd, n, now_.data() + at_.qd());
    std::copy_n(sample.tau, n, now_.data() + at_.tau());
    std::copy_n(sample.wrench, 6 * at_.sensors, now_.data() + at_.wrench());
  }

  // A stamp that does not advance: the observer refuses the sample, and nothing is learned from
  // it, unless the clock was set back.
  Sample refused(const Sample& sample) {
    const bool first = time_ != time_ && std::isfinite(sample.time);
    if (first || ++refusals_ > tuning_.refusals) {
      time_ = sample.time;
      refusals_ = 0;
      gather(sample);
      last_ = now_;
      for (std::size_t c = 0; c < at_.count(); ++c) take(c);
      for (std::size_t j = 0; j < at_.joints; ++j) begin_tracking(j);
      all_sound_ = true;
    }
    return all_sound_ ? sample : believed(sample.time);
  }

  // The step of each channel and its ratio; returns whether all are usual.
  bool measure(double dt) {
    std::swap(ratio_, ratio_before_);
    const std::size_t n = at_.joints, count = at_.count();
    const double* __restrict now = now_.data();
    const double* __restrict last = last_.data();
    const double* __restrict mean = mean_.data();
    const double* __restrict floor = limits_.floors().data();
    double* __restrict step = step_.data();
    double* __restrict ratio = ratio_.data();
    for (std::size_t c = n; c < count; ++c) step[c] = std::fabs(now[c] - last[c]);
    for (std::size_t j = 0; j < n; ++j)
      step[j] = std::fabs(now[j] - last[j] - 0.5 * dt * (now[n + j] + last[n + j]));
    const double jump = tuning_.jump;
    double worst = 0.0, all = 0.0;
    for (std::size_t c = 0; c < count; ++c) {
      const double usual = jump * mean[c];
      ratio[c] = step[c] / (usual > floor[c] ? usual : floor[c]);
      worst = ratio[c] > worst ? ratio[c] : worst;
    }
    for (std::size_t c = 0; c < 2 * n; ++c) all += now[c];
    return worst <= 1.0 && all == all;  // infinite readings are none of them
  }

  // Not a usual sample: who is believed? Leaves in `now_` the readings to go on with, and in
  // `step_` those steps that something can be learned from.
  void settle(double dt, bool gap) {
    absurd_ = false;
    absent_ = 0;
    follow_loads(gap);
    take_out_friction();
    carry(dt);
    for (std::size_t c = 0; c < at_.count(); ++c) {
      const bool jumps = ratio_[c] > 1.0 && !gap, motion = c < at_.tau();
      if (std::fabs(now_[c]) >= kAbsurd) {
        now_[c] = kNever;  // told as such, of torques and wrenches by the observer
        absurd_ = true;
        if (motion) absent_ |= kNonFinite;
      } else if (motion && now_[c] != now_[c]) {
        absent_ |= kMissing;
      }
      const bool odd = jumps || fault_[c] != Fault::none || (motion && now_[c] != now_[c]);
      if (limits_.is_watched(c) && odd && seen_ >= warm_up_) judge(c, dt);
      if (gap || fault_[c] != Fault::none) step_[c] = kNever;
      else if (jumps && seen_ >= warm_up_) step_[c] = gate(c);
    }
    if (gap) speeds_.forget_all();
    find_all_sound();
  }

  // Follows how each axis of a sensor steps, whatever is believed of it.
  void follow_loads(bool gap) {
    std::swap(read_step_, read_step_before_);
    for (std::size_t i = 0; i < read_.size(); ++i) {
      const std::size_t c = at_.wrench() + i;
      const double before = fault_[c] == Fault::none ? last_[c] : read_[i];
      read_[i] = now_[c];
      read_step_[i] = gap ? kNever : (now_[c] - before) / gate(c);
    }
  }

  // Does an axis go on as it went in the last sample, and others of its sensor with it? A load that grows
  // does that: two forces against each other, too, whose wrench is that of no force. What an axis makes up
  // goes now up, now down.
  bool goes_on(std::size_t c) const {
    const std::size_t axis = c - at_.wrench(), first = axis - axis % 6;
    double along = 0.0, here = 0.0, before = 0.0;
    int moving = 0;
    for (std::size_t i = first; i < first + 6; ++i) {
      const double step = read_step_[i], last = read_step_before_[i], size = std::fabs(step);
      const double size_before = std::fabs(last);
      const bool alike = step * last > 0.0 && size_before < kAlike * size && size < kAlike * size_before;
      if (i == axis && !alike) return false;
      if (i == axis || !limits_.is_watched(at_.wrench() + i)) continue;
      along += step * last;
      here += step * step;
      before += last * last;
      const std::size_t other = at_.wrench() + i;
      moving += size * gate(other) > tuning_.moves * mean_[other] + kLeastMove ? 1 : 0;
    }
    return moving >= kSeveral && along > kSameWay * std::sqrt(here * before);
  }
  static constexpr double kAlike = 2.5;    // times: steps of a blow that turns at its peak
  static constexpr double kSameWay = 0.8;  // cosine: one in 36 pairs of random steps of five axes has it
  static constexpr int kSeveral = 2;       // other axes that move: more than the crosstalk of one that fails

  // Of the steps that are too large for their channel: what known friction has made of them counts
  // for nothing.
  void take_out_friction() {
    for (const Rough& of : rough_) {
      const std::size_t c = at_.tau() + of.number, v = at_.qd() + of.number;
      if (!(ratio_[c] > 1.0)) continue;
      const double turned = of.joint.dry_friction(now_[v]) - of.joint.dry_friction(last_[v]);
      const double rest = now_[c] - last_[c] - turned / (of.joint.sign * of.joint.gain);
      if (!(std::fabs(rest) < step_[c])) continue;
      step_[c] = std::fabs(rest);
      ratio_[c] = step_[c] / gate(c);
    }
  }

  void find_all_sound() {
    all_sound_ = std::all_of(fault_.begin(), fault_.end(), [](Fault f) { return f == Fault::none; });
  }

  double gate(std::size_t c) const { return std::max(limits_.floors()[c], tuning_.jump * mean_[c]); }

  void judge(std::size_t c, double dt) {
    const double x = now_[c];
    const Passes passed = std::exchange(passes_[c], Passes::no);
    if (x != x) return c < at_.tau() ? leave(c, Fault::absent) : take(c);
    switch (fault_[c]) {
      case Fault::none:
        if (c < at_.qd() && wraps(c, dt)) {
          const double turns = kTurn * std::round((x - last_[c]) / kTurn);
          last_[c] += turns;
          ways_.turn(c, turns);
          return;
        }
        if (c < at_.tau() && speeds_.is_rounding(c, std::fabs(x - last_[c]))) return;
        if (borne_out(c, dt)) {
          const bool first = !(ratio_before_[c] > 1.0);  // what goes on to step changes
          if (first && c >= at_.wrench() && !felt_elsewhere(c)) unproven_[c] = any_unproven_ = true;
          return;
        }
        fault_[c] = Fault::spike;
        since_[c] = calm_[c] = 0;
        if (c >= at_.wrench()) grown_[c - at_.wrench()] = 0;
        if (time_ - spiked_[c] < kAgain) moved_[c] = moved(c);
        spiked_[c] = time_;
        if (c >= at_.qd() && c < at_.tau()) shown_from_[c - at_.qd()] = {time_ - dt, last_[c - at_.qd()]};
        hold(c, dt);
        return;
      case Fault::spike: return go_on_holding(c, dt);
      case Fault::wild: return wait_for_calm(c, passed);
      case Fault::absent: return near(c) ? take(c) : leave(c, Fault::wild);
      case Fault::stuck:
        if (now_[c] == last_[c]) return;
        if (limits_.early(c)) passes_[c] = after(passed);
        if (++since_[c] < tuning_.changes) return;
        return c >= at_.tau() || near(c) ? take(c) : leave(c, Fault::wild);
      case Fault::step:
        calm_[c] = ratio_[c] > 1.0 ? tuning_.sure : std::max(calm_[c] - 1, 0);
        if (calm_[c] == 1 || ++since_[c] >= return_) take(c);
        return;
      case Fault::disagrees:  // see `judge_speeds`
      case Fault::suspect: return;  // no gate says so
    }
  }

  // What has stepped and changes again lives.
  void prove() {
    any_unproven_ = false;
    for (std::size_t c = at_.wrench(); c < at_.count(); ++c) {
      unproven_[c] = unproven_[c] != 0 && fault_[c] == Fault::none && !lives(c, last_[c]);
      any_unproven_ = any_unproven_ || unproven_[c] != 0;
    }
  }

  // A reading counts no more.
  void leave(std::size_t c, Fault fault) {
    if (fault_[c] == fault) return;
    const bool held = fault_[c] == Fault::none || fault_[c] == Fault::spike;
    if (held && c < at_.qd()) ways_.lose(c, usable_speed(c), time_);
    fault_[c] = fault;
    since_[c] = calm_[c] = 0;
    if (c < at_.tau()) speeds_.forget(c % at_.joints);
  }

  bool usable(std::size_t c) const {
    return (fault_[c] == Fault::none || fault_[c] == Fault::spike) && now_[c] == now_[c];
  }
  // The velocity of joint j; null: not believed.
  const double* usable_speed(std::size_t j) const {
    return usable(at_.qd() + j) ? &now_[at_.qd() + j] : nullptr;
  }

  // Joints whose positions are not believed go on by their speeds.
  void carry(double dt) {
    for (std::size_t j = 0; j < at_.joints; ++j) {
      if (fault_[j] == Fault::none || fault_[j] == Fault::spike) continue;
      const double* speed = usable_speed(j);
      ways_.carry(j, speed != nullptr ? *speed : kNever, dt);
    }
  }

  // Is a reading that comes back where what stands in for it is, or is nothing known of it?
  bool near(std::size_t c) const {
    const std::size_t j = c % at_.joints;  // of a velocity nothing is known where the position is not
    const double at = c < at_.qd() ? ways_.anchor(j) : ways_.speed(j) + 0.0 * ways_.tracked(j);
    return !(std::fabs(now_[c] - at) > gate(c));
  }

  // Follows the positions: where joints are and how fast, without the velocities.
  void track(double dt, bool gap) {
    const std::size_t n = at_.joints;
    if (!all_sound_ || gap) {
      for (std::size_t j = 0; j < n; ++j) {
        const bool lost = !usable(j),
            jumped = std::fabs(now_[j] - ways_.tracked(j)) > gate(j) + dt * tuning_.fastest;
        if (gap || lost || jumped) begin_tracking(j);
        else ways_.follow(j, now_[j], dt);
      }
    } else {
      for (std::size_t j = 0; j < n; ++j) ways_.follow(j, now_[j], dt);
    }
    ways_.followed(time_);
  }
  void begin_tracking(std::size_t j) {
    ways_.begin(j, usable(j) ? now_[j] : ways_.anchor(j), usable_speed(j), time_);
  }

  static Passes after(Passes before) {
    return before == Passes::no ? Passes::begins : Passes::goes_on;
  }

  void go_on_holding(std::size_t c, double dt) {
    const double x = now_[c];
    if (ratio_[c] <= 1.0) return take(c);
    const bool stays = std::fabs(x - candidate_[c]) <= gate(c);
    calm_[c] = stays && lives(c, candidate_[c]) ? calm_[c] + 1 : 0;
    if (calm_[c] >= tuning_.sure && c >= at_.tau()) {  // a step that lasts
      if (!witnessed(c)) {
        moved_[c] = moved(c);
        return take(c);
      }
      fault_[c] = Fault::step;
      since_[c] = calm_[c] = 0;
      last_[c] = x;
      return;
    }
    if (c >= at_.qd() && c < at_.tau() && borne_out(c, dt)) return take(c);
    if (c >= at_.wrench() && !witnessed(c)) {
      int& grown = grown_[c - at_.wrench()];
      grown = goes_on(c) ? grown + 1 : 0;
      if (grown >= kGrows) return take(c);
    }
    if (++since_[c] < held_most_) return hold(c, dt);
    candidate_[c] = last_[c];  // where it was good
    leave(c, stays && c >= at_.tau() ? Fault::stuck : Fault::wild);
    last_[c] = x;
  }

  // A wild channel comes back after some usual steps; a position after the way that its joint has
  // come by its speed, or for good as another one. Where that way is not known any more it waits less.
  // A torque or an axis reaches the filters before that, from its first usual step on, or where it was
  // before: they settle meanwhile, and count after that.
  void wait_for_calm(std::size_t c, Passes passed) {
    const bool calm = ratio_[c] <= 1.0 && lives(c, last_[c]);
    if (c < at_.qd()) {
      if (near(c)) return take(c);
      since_[c] = calm ? since_[c] + 1 : 0;
      if (since_[c] >= (ways_.blind(c) < tuning_.way_blind ? return_ : tuning_.good)) take(c);
      return;
    }
    if (!calm && c < at_.tau()) speeds_.forget(c - at_.qd());
    since_[c] = calm && (c >= at_.tau() || near(c)) ? since_[c] + 1 : 0;
    const bool returned = std::fabs(now_[c] - candidate_[c]) <= gate(c);
    if (limits_.early(c) && (since_[c] > 0 || returned)) passes_[c] = after(passed);
    if (since_[c] >= tuning_.good) take(c);
  }

  bool lives(std::size_t c, double before) const {
    return now_[c] != before || (c < at_.tau() ? speeds_.is_dull(c) : stuck_.is_dull(c));
  }

  // The reading counts again.
  void take(std::size_t c) {
    fault_[c] = Fault::none;
    passes_[c] = Passes::no;
    since_[c] = 0;
    stuck_.forget(c);
    if (c < at_.tau()) speeds_.forget(c % at_.joints);
    if (c >= at_.qd()) return;
    const std::size_t v = at_.qd() + c;
    const bool nothing_known = ways_.tracked(c) != ways_.tracked(c);
    if (nothing_known && fault_[v] == Fault::absent && now_[v] == now_[v]) fault_[v] = Fault::none;
    begin_tracking(c);
  }

  static constexpr int kGrows = 2;  // samples in a row in which an axis goes on: of noise one in seven does

  // The last good reading stands for this one; a joint is where its speed has brought it.
  void hold(std::size_t c, double dt) {
    candidate_[c] = now_[c];
    now_[c] = c < at_.qd() ? last_[c] + dt * last_[at_.qd() + c] : last_[c];
  }

  // Does anything else in this sample bear out the jump of a channel?
  bool borne_out(std::size_t c, double dt) const {
    if (c < at_.qd()) return false;
    if (c < at_.tau()) return speed_borne_out(c - at_.qd(), dt);
    if (felt_elsewhere(c)) return true;
    const std::size_t first = at_.wrench();
    if (c < first || witnessed(c)) return false;
    const std::size_t sensor = (c - first) / 6;
    return one_force(sensor, c) || shares_blow(sensor, c);
  }

  // Does any channel move with it that is no axis of its own sensor?
  bool felt_elsewhere(std::size_t c) const {
    const std::size_t first = at_.wrench(), sensor = c < first ? 0 : (c - first) / 6;
    const bool sudden = news(c) > kSudden * ratio_[c];
    for (std::size_t other = at_.qd(); other < at_.count(); ++other) {
      const bool same = c == other || (c >= first && other >= first && (other - first) / 6 == sensor);
      if (same || !moves(other)) continue;
      const bool bears = sudden ? news(other) > tuning_.equal * news(c)
                                : ratio_[other] > tuning_.equal * ratio_[c];
      if (bears) return true;
    }
    return false;
  }

  // Does another axis of its sensor jump that others bear out? A blow moves this one far more than them,
  // and no axis fails in the very sample of a blow.
  bool shares_blow(std::size_t sensor, std::size_t c) const {
    for (std::size_t i = at_.wrench() + 6 * sensor, end = i + 6; i < end; ++i) {
      if (i != c && ratio_[i] > 1.0 && moves(i) && felt_elsewhere(i)) return true;
    }
    return false;
  }

  // How much more a channel steps than in the sample before. What others have done for some samples does
  // not bear out what one does suddenly: a push that is let go does not explain a jump of one torque.
  double news(std::size_t c) const { return ratio_[c] - ratio_before_[c]; }
  static constexpr double kSudden = 0.5;  // part of a step that the last one had not: more than a ramp's

  // Is there a sensor inboard that feels all that this channel can feel, and is it believed?
  bool witnessed(std::size_t c) const {
    const int witness = limits_.witness(c);
    if (witness < 0) return false;
    const std::size_t first = at_.wrench() + 6 * static_cast<std::size_t>(witness);
    for (std::size_t i = first; i < first + 6; ++i) {
      if (fault_[i] != Fault::none || !(step_[i] == step_[i])) return false;
    }
    return true;
  }

  Moved moved(std::size_t c) const { return limits_.pushable(c) ? Moved::alone : Moved::wrongly; }

  // Has a position gone on after a whole turn?
  bool wraps(std::size_t j, double dt) const {
    const double way = now_[j] - last_[j];
    return limits_.wraps(j) && std::fabs(way - kTurn * std::round(way / kTurn) -
                                  dt * last_[at_.qd() + j]) <= gate(j);
  }
  static constexpr double kTurn = 6.283185307179586;  // [rad]

  bool moves(std::size_t c) const {
    return limits_.is_watched(c) && fault_[c] == Fault::none &&
        step_[c] > tuning_.moves * mean_[c] + kLeastMove;
  }
  static constexpr double kLeastMove = 1e-9;  // of any unit: rounding

  // A step of speed shows in the way since then, unless positions are too rough for so short a time.
  bool speed_borne_out(std::size_t j, double dt) const {
    const std::size_t v = at_.qd() + j;
    const bool held = fault_[v] == Fault::spike;
    const double over = held ? time_ - shown_from_[j].time : dt;
    const double from = held ? shown_from_[j].position : last_[j];
    const double before = last_[v], jump = std::fabs(now_[v] - before);
    const double shown = std::fabs((now_[j] - from) / over - before);
    return !(shown + tuning_.moves * mean_[j] / over < tuning_.borne_out * jump);
  }

  // Is the step of a sensor that of one force on a link: no moment along it, none beyond reach, and
  // not along axis c alone? What moves the others far less is another load, or motion.
  bool one_force(std::size_t sensor, std::size_t c) const {
    const std::size_t first = at_.wrench() + 6 * sensor;
    double d[6];
    int moving = 0;
    for (int i = 0; i < 6; ++i) {
      if (!limits_.is_watched(first + i)) return false;
      d[i] = now_[first + i] - last_[first + i];
      moving += moves(first + i) && ratio_[first + i] > tuning_.equal * ratio_[c] ? 1 : 0;
    }
    const double force = std::hypot(d[0], d[1], d[2]), moment = std::hypot(d[3], d[4], d[5]);
    const double along = std::fabs(d[0] * d[3] + d[1] * d[4] + d[2] * d[5]);
    const double* usual = mean_.data() + first;  // the arm's own motion adds to the step
    const double slack = force * std::hypot(usual[3], usual[4], usual[5]) +
                         moment * std::hypot(usual[0], usual[1], usual[2]);
    return moving >= 2 && moment <= tuning_.reach * force &&
        along <= tuning_.pitch * force * moment + slack;
  }

  // What this sample teaches of the steps of each channel.
  void learn() {
    rate_ = std::max(memory_, 1.0 / (seen_ + 1.0));
    seen_ += seen_ < kSeenMost ? 1 : 0;
    double* __restrict mean = mean_.data();
    const double* __restrict step = step_.data();
    const double rate = rate_;
    for (std::size_t c = 0; c < mean_.size(); ++c) {
      const double off = step[c] - mean[c];
      mean[c] += off == off ? rate * off : 0.0;
    }
  }
  static constexpr int kSeenMost = 1 << 20;  // samples: the mean has forgotten them long ago

  void judge_speeds() {
    any_far_ = false;
    for (std::size_t j = 0; j < at_.joints; ++j) {
      Fault &position = fault_[j], &speed = fault_[at_.qd() + j];
      const bool told = speed == Fault::disagrees;
      if (told) {
        far_[j] = speeds_.far(j) ? dwell_ : far_[j] - 1;
        if (far_[j] <= 0) take(j), take(at_.qd() + j);
      } else {
        far_[j] = speeds_.far(j) ? far_[j] + 1 : 0;
        const bool free = position == Fault::none && speed == Fault::none;
        const bool stands = stands_still(j);
        if (!free || seen_ <= warm_up_) continue;
        if (dead(j)) leave(at_.qd() + j, Fault::stuck);
        else if (far_[j] >= dwell_ || (far_[j] > 0 && stands)) tell_one(j);
      }
      any_far_ = any_far_ || far_[j] > 0;
    }
    find_all_sound();
  }

  // Has a velocity that changes with each sample stopped to do so while its joint moves?
  bool dead(std::size_t j) const {
    return speeds_.is_still(j) && speeds_.same(j) < 1.0 &&
           std::fabs(ways_.speed(j)) > tuning_.stuck_speed;
  }
  // Has a position stopped to change while its velocity does?
  bool stands_still(std::size_t j) const {
    return speeds_.same(j) >= tuning_.stands && speeds_.same(at_.qd() + j) < 1.0;
  }

  // Position and velocity of a joint disagree: one that has stood still since is the wrong one.
  void tell_one(std::size_t j) {
    const std::size_t v = at_.qd() + j;
    const double same = speeds_.same(j);
    if (stands_still(j)) {
      leave(j, Fault::stuck);
      ways_.lose_at(j, now_[j] + same * period_ * now_[v]);  // what it has missed so far
      return;
    }
    if (speeds_.same(v) >= dwell_ && same < dwell_) return leave(v, Fault::stuck);
    fault_[j] = fault_[v] = Fault::disagrees;
  }

  bool moving() const {
    double speed = 0.0;
    const double* __restrict qd = now_.data() + at_.qd();
    for (std::size_t j = 0; j < at_.joints; ++j) {
      const double v = std::fabs(qd[j]);
      speed = v > speed ? v : speed;
    }
    return speed > tuning_.stuck_speed;
  }

  void find_stuck() {
    for (std::size_t c = at_.tau(); c < at_.count(); ++c) {
      if (!limits_.is_watched(c) || fault_[c] != Fault::none || !stuck_.is_stuck(c, now_[c])) continue;
      fault_[c] = Fault::stuck;
      since_[c] = 0;
    }
    find_all_sound();
  }

  Sample believed(double time) {
    for (std::size_t c = 0; c < at_.count(); ++c)
      out_[c] = fault_[c] == Fault::none || fault_[c] == Fault::spike || passes(c) ? now_[c] : kNever;
    for (std::size_t j = 0; j < at_.joints; ++j) {
      const std::size_t v = at_.qd() + j;
      const bool way = usable(j), speed = usable(v);
      if (!way && speed && fault_[j] != Fault::none &&
          ways_.blind(j) < tuning_.way_blind) out_[j] = ways_.anchor(j);
      if (!speed && way && fault_[v] != Fault::none) out_[v] = ways_.speed(j);
    }
    return {time, out_.data() + at_.q(), out_.data() + at_.qd(), out_.data() + at_.tau(),
            out_.data() + at_.wrench()};
  }

  // Where a joint was.
  struct Place {
    double time, position;  // [s]; [rad or m]
  };
  // A joint with dry friction that the description knows.
  struct Rough {
    std::size_t number;
    JointRow joint;
  };

  GatesTuning tuning_;
  ChannelLayout at_;
  std::vector<Rough> rough_;
  double period_, memory_;  // [s]; part of a mean that one sample is at least
  int warm_up_, held_most_, return_, dwell_;  // [samples]
  GateLimits limits_;
  StuckWatch stuck_;
  SpeedWatch speeds_;
  JointWays ways_;
  // Now: as read, but for what is held. Out: what goes on, with NaN.
  std::vector<double> now_, last_, out_, candidate_;
  std::vector<double> mean_, step_, ratio_, ratio_before_;  // of steps
  std::vector<double> spiked_;  // when it jumped last [s]
  std::vector<Moved> moved_;    // see `take_moved`
  std::vector<char> unproven_;  // see `any_unproven`
  // Of axes, as long as samples are not usual: as read last, believed or not, and the last two steps, in
  // parts of what is believed at once. For how many samples has one that is held gone on alike?
  std::vector<double> read_, read_step_, read_step_before_;
  std::vector<int> grown_;
  std::vector<Place> shown_from_;  // per joint, before its velocity was held
  std::vector<int> far_;
  std::vector<int> since_, calm_;  // samples, of what a fault waits for
  std::vector<Passes> passes_;
  std::vector<Fault> fault_;
  double time_ = kNever, rate_ = 0.0;
  int seen_ = 0, refusals_ = 0;
  bool all_sound_ = true, any_far_ = false, absurd_ = false, any_unproven_ = false;
  Health absent_ = 0;
};

}  // namespace touchline
