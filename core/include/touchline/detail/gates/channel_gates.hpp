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
// A stuck channel: how often it changes from sample to sample while the arm moves is learned, and
// so is for how long it keeps a value. Logs that repeat samples repeat all of them, which counts
// for nothing.
//
// A velocity is the derivative of its position: what positions and velocities differ by, over some
// samples, is compared with what they have differed by so far. Where one of the two is not believed
// the other stands in for it. A position is the way that its joint has come by its speed, for a
// while; a speed is what positions show, low-passed.
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
#include "touchline/detail/gates/tuning.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/robot.hpp"
#include "touchline/sample.hpp"

namespace touchline {

// Does a channel that is told reach the estimates?
enum class Passes { no, begins, goes_on };

// A channel is at another level, and no other one bears that out.
enum class Moved {
  no,
  alone,   // a joint torque: a push may do that, but not within one sample as a blow
  wrongly  // a contact would have moved others too
};

class ChannelGates {
 public:
  // Of a robot whose parts fit.
  explicit ChannelGates(const Robot& robot, const GatesTuning& tuning = {})
      : tuning_(tuning),
        at_{robot.joints.size(), robot.sensors.size()},
        period_(std::max(robot.noise.period, kShortest)),
        floor_(at_.count(), std::numeric_limits<double>::infinity()),
        witness_(at_.count(), -1),
        wraps_(at_.joints, 0),
        now_(at_.count()),
        last_(at_.count(), kNever),
        out_(at_.count()),
        candidate_(at_.count()),
        mean_(at_.count()),
        step_(at_.count()),
        ratio_(at_.count()),
        often_(at_.count()),
        evidence_(at_.count()),
        run_(at_.count()),
        longest_(at_.count()),
        highest_(at_.count(), -std::numeric_limits<double>::infinity()),
        lowest_(at_.count(), std::numeric_limits<double>::infinity()),
        drift_(at_.joints),
        usual_drift_(at_.joints),
        anchor_(at_.joints),
        tracked_(at_.joints),
        speed_(at_.joints),
        acceleration_(at_.joints),
        blind_(at_.joints),
        same_(2 * at_.joints),
        spiked_(at_.count(), -std::numeric_limits<double>::infinity()),
        moved_(at_.count(), Moved::no),
        far_(at_.joints),
        since_(at_.count()),
        calm_(at_.count()),
        passes_(at_.count(), Passes::no),
        early_(at_.count(), 0),
        fault_(at_.count(), Fault::none) {
    set_floors(robot);
    for (std::size_t j = 0; j < at_.joints; ++j) {
      if (robot.joints[j].measured() && robot.joints[j].rough()) rough_.push_back({j, robot.joints[j]});
    }
    memory_ = std::min(1.0, period_ / tuning_.memory);
    warm_up_ = samples(tuning_.warm_up, tuning_.least_seen);
    held_most_ = std::min(samples(tuning_.held, tuning_.sure + 1), tuning_.held_most);
    silent_ = samples(tuning_.silent, tuning_.least_silent);
    return_ = samples(tuning_.returns, tuning_.good);
    dwell_ = samples(tuning_.dwell, tuning_.least_dwell);
    kept_ = std::exp(-period_ / compared_over());
    const double pole = std::exp(-std::min(tuning_.tracking, 0.5 / period_) * period_),
        off = 1.0 - pole;
    follows_[0] = 1.0 - pole * pole * pole;
    follows_[1] = 1.5 * off * off * (1.0 + pole) / period_;
    follows_[2] = off * off * off / (period_ * period_);
  }

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
    if (!usual || !all_sound_ || absurd_ || gap) settle(dt, gap);
    learn();
    track(dt, gap);
    if (!gap) compare_speeds(dt);
    if (moving()) count_changes(dt);
    std::copy(now_.begin(), now_.end(), last_.begin());
    return all_sound_ ? sample : believed(sample.time);
  }

  bool all_sound() const { return all_sound_; }
  // Of positions and velocities that were not there: what another one stands in for.
  Health absent() const { return absent_; }
  // Has channel c jumped twice of late since the last call, or been taken at another level, which no
  // other one bears out?
  Moved take_moved(std::size_t c) { return std::exchange(moved_[c], Moved::no); }
  // The same, and it may be asked again.
  Moved moved_lately(std::size_t c) const { return moved_[c]; }
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
  static constexpr double kSettles = 4.0;      // [1/K] that a filter waits at least before it counts
  int samples(double seconds, int least) const {
    return std::max(least, static_cast<int>(std::lround(std::min(seconds / period_, 1e6))));
  }

  // A step that the filters make less of than the threshold of a contact can begin no event.
  void set_floors(const Robot& robot) {
    const auto share = [this](double bandwidth) { return 1.0 - std::exp(-bandwidth * period_); };
    const auto early = [this](double bandwidth) {
      return tuning_.good * period_ * bandwidth <= kSettles;
    };
    std::vector<double> contact(at_.count(), 0.0);
    const Tree tree(robot.nodes, robot.gravity);
    const Layout layout(tree, robot.joints, robot.sensors);
    for (const DetectionRow& row : robot.rows) {
      const int sensor = layout.segments[row.segment].sensor;
      if (row.joint >= 0) contact[at_.tau() + row.joint] = row.contact;
      if (row.component >= 0 && sensor >= 0)
        contact[at_.wrench() + 6 * sensor + row.component] = row.contact;
    }
    for (std::size_t j = 0; j < at_.joints; ++j) {
      const JointRow& joint = robot.joints[j];
      floor_[at_.q() + j] = std::max(tuning_.least_travel, tuning_.fastest * period_);
      floor_[at_.qd() + j] = tuning_.speed_step + tuning_.hardest * period_;
      wraps_[j] = robot.nodes[joint.nodes[0]].kind == NodeKind::revolute;
      if (!layout.inboard_sensors[j].empty())
        witness_[at_.tau() + j] = layout.inboard_sensors[j][0].sensor;
      const double least = std::max(contact[at_.tau() + j], tuning_.least_step_torque);
      if (joint.measured())
        floor_[at_.tau() + j] = least / share(joint.bandwidth) / std::fabs(joint.gain);
      early_[at_.tau() + j] = early(joint.bandwidth);
    }
    for (std::size_t c = at_.wrench(); c < at_.count(); c += 3) {  // axes of the log may be turned
      const SensorRow& sensor = robot.sensors[(c - at_.wrench()) / 6];
      const std::size_t axis = (c - at_.wrench()) % 6;
      const double least = *std::max_element(contact.begin() + c, contact.begin() + c + 3);
      for (std::size_t t = 0; t < at_.sensors; ++t) {
        const int inner = robot.sensors[t].node;
        const bool inboard = sensor.node != inner && layout.is_outboard(sensor.node, inner);
        if (inboard && robot.sensors[t].six_axis())
          std::fill_n(witness_.begin() + c, 3, static_cast<int>(t));
      }
      const double smallest = axis == 0 ? tuning_.least_step_force : tuning_.least_step_torque;
      for (int i = 0; i < 3; ++i) {
        early_[c + i] = early(sensor.bandwidth);
        if (sensor.axes[axis + i])
          floor_[c + i] = std::max(least, smallest) / share(sensor.bandwidth);
      }
    }
  }

  bool watched(std::size_t c) const { return floor_[c] < std::numeric_limits<double>::infinity(); }

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
    const std::size_t n = at_.joints, count = at_.count();
    const double* __restrict now = now_.data();
    const double* __restrict last = last_.data();
    const double* __restrict mean = mean_.data();
    const double* __restrict floor = floor_.data();
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
      if (watched(c) && odd && seen_ >= warm_up_) judge(c, dt);
      if (gap || fault_[c] != Fault::none) step_[c] = kNever;
      else if (jumps && seen_ >= warm_up_) step_[c] = gate(c);
    }
    if (gap) std::fill(drift_.begin(), drift_.end(), 0.0);
    find_all_sound();
  }

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

  double gate(std::size_t c) const { return std::max(floor_[c], tuning_.jump * mean_[c]); }

  void judge(std::size_t c, double dt) {
    const double x = now_[c];
    const Passes passed = std::exchange(passes_[c], Passes::no);
    if (x != x) return c < at_.tau() ? leave(c, Fault::absent) : take(c);
    switch (fault_[c]) {
      case Fault::none:
        if (c < at_.qd() && wraps(c, dt)) {
          const double turns = kTurn * std::round((x - last_[c]) / kTurn);
          last_[c] += turns;
          tracked_[c] += turns;
          return;
        }
        if (borne_out(c, dt)) return;
        fault_[c] = Fault::spike;
        since_[c] = calm_[c] = 0;
        if (time_ - spiked_[c] < kAgain) moved_[c] = moved(c);
        spiked_[c] = time_;
        hold(c, dt);
        return;
      case Fault::spike: return go_on_holding(c, dt);
      case Fault::wild: return wait_for_calm(c, passed);
      case Fault::absent: return near(c) ? take(c) : leave(c, Fault::wild);
      case Fault::stuck:
        if (now_[c] == last_[c]) return;
        if (early_[c] != 0) passes_[c] = after(passed);
        if (++since_[c] < tuning_.changes) return;
        return c >= at_.tau() || near(c) ? take(c) : leave(c, Fault::wild);
      case Fault::step:
        calm_[c] = ratio_[c] > 1.0 ? tuning_.sure : std::max(calm_[c] - 1, 0);
        if (calm_[c] == 1 || ++since_[c] >= return_) take(c);
        return;
      case Fault::disagrees:  // see `compare_speeds`
      case Fault::suspect: return;  // no gate says so
    }
  }

  // A reading counts no more.
  void leave(std::size_t c, Fault fault) {
    if (fault_[c] == fault) return;
    const bool held = fault_[c] == Fault::none || fault_[c] == Fault::spike;
    if (held && c < at_.qd()) {
      anchor_[c] = out_way(c);
      blind_[c] = 0.0;
    }
    fault_[c] = fault;
    since_[c] = calm_[c] = 0;
    if (c < at_.tau()) drift_[c % at_.joints] = 0.0;
  }

  // Where the joint was at the last sample, and has come since by its speed.
  double out_way(std::size_t j) const {
    return tracked_[j] + (time_ - tracked_at_) * (usable(at_.qd() + j) ? now_[at_.qd() + j] : speed_[j]);
  }
  bool usable(std::size_t c) const {
    return (fault_[c] == Fault::none || fault_[c] == Fault::spike) && now_[c] == now_[c];
  }

  // Joints whose positions are not believed go on by their speeds.
  void carry(double dt) {
    for (std::size_t j = 0; j < at_.joints; ++j) {
      if (fault_[j] == Fault::none || fault_[j] == Fault::spike) continue;
      anchor_[j] += dt * (usable(at_.qd() + j) ? now_[at_.qd() + j] : kNever);
      blind_[j] += dt;
    }
  }

  // Is a reading that comes back where what stands in for it is, or is nothing known of it?
  bool near(std::size_t c) const {
    const double at = c < at_.qd() ? anchor_[c] : speed_[c - at_.qd()] + 0.0 * tracked_[c - at_.qd()];
    return !(std::fabs(now_[c] - at) > gate(c));
  }

  // Follows the positions: where joints are and how fast, without the velocities.
  void track(double dt, bool gap) {
    const std::size_t n = at_.joints;
    if (!all_sound_ || gap) {
      for (std::size_t j = 0; j < n; ++j) {
        const bool lost = !usable(j),
            jumped = std::fabs(now_[j] - tracked_[j]) > gate(j) + dt * tuning_.fastest;
        if (gap || lost || jumped) begin_tracking(j);
        else track_one(j, dt);
      }
    } else {
      for (std::size_t j = 0; j < n; ++j) track_one(j, dt);
    }
    tracked_at_ = time_;
  }
  void track_one(std::size_t j, double dt) {
    const double v = speed_[j], a = acceleration_[j], ahead = tracked_[j] + dt * (v + 0.5 * dt * a);
    const double off = now_[j] - ahead;
    tracked_[j] = ahead + follows_[0] * off;
    speed_[j] = v + dt * a + follows_[1] * off;
    acceleration_[j] = a + follows_[2] * off;
  }
  void begin_tracking(std::size_t j) {
    tracked_[j] = usable(j) ? now_[j] : anchor_[j];
    if (usable(at_.qd() + j)) speed_[j] = now_[at_.qd() + j];
    acceleration_[j] = 0.0;
    tracked_at_ = time_;
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
      if (since_[c] >= (blind_[c] < tuning_.way_blind ? return_ : tuning_.good)) take(c);
      return;
    }
    if (!calm && c < at_.tau()) drift_[c - at_.qd()] = 0.0;
    since_[c] = calm && (c >= at_.tau() || near(c)) ? since_[c] + 1 : 0;
    const bool returned = std::fabs(now_[c] - candidate_[c]) <= gate(c);
    if (early_[c] != 0 && (since_[c] > 0 || returned)) passes_[c] = after(passed);
    if (since_[c] >= tuning_.good) take(c);
  }

  bool lives(std::size_t c, double before) const {
    return now_[c] != before || often_[c] < tuning_.lively;
  }

  // The reading counts again.
  void take(std::size_t c) {
    fault_[c] = Fault::none;
    passes_[c] = Passes::no;
    since_[c] = 0;
    evidence_[c] = run_[c] = 0.0;
    if (c < at_.tau()) drift_[c % at_.joints] = 0.0;
    if (c >= at_.qd()) return;
    const std::size_t v = at_.qd() + c;
    const bool nothing_known = tracked_[c] != tracked_[c];
    if (nothing_known && fault_[v] == Fault::absent && now_[v] == now_[v]) fault_[v] = Fault::none;
    begin_tracking(c);
  }

  // The last good reading stands for this one; a joint is where its speed has brought it.
  void hold(std::size_t c, double dt) {
    candidate_[c] = now_[c];
    now_[c] = c < at_.qd() ? last_[c] + dt * last_[at_.qd() + c] : last_[c];
  }

  // Does anything else in this sample bear out the jump of a channel?
  bool borne_out(std::size_t c, double dt) const {
    if (c < at_.qd()) return false;
    if (c < at_.tau()) return speed_borne_out(c - at_.qd(), dt);
    const std::size_t first = at_.wrench(), sensor = c < first ? 0 : (c - first) / 6;
    for (std::size_t other = at_.qd(); other < at_.count(); ++other) {
      const bool same = c == other || (c >= first && other >= first && (other - first) / 6 == sensor);
      if (!same && moves(other) && ratio_[other] > tuning_.equal * ratio_[c]) return true;
    }
    return c >= first && !witnessed(c) && one_force(sensor, c);
  }

  // Is there a sensor inboard that feels all that this channel can feel, and is it believed?
  bool witnessed(std::size_t c) const {
    if (witness_[c] < 0) return false;
    const std::size_t first = at_.wrench() + 6 * witness_[c];
    for (std::size_t i = first; i < first + 6; ++i) {
      if (fault_[i] != Fault::none || !(step_[i] == step_[i])) return false;
    }
    return true;
  }

  // Would a contact that moves it move others, too? Of joint torques alone a push may load one: its
  // line meets the axes of the others.
  Moved moved(std::size_t c) const {
    return c < at_.tau() || c >= at_.wrench() || witness_[c] >= 0 ? Moved::wrongly : Moved::alone;
  }

  // Has a position gone on after a whole turn?
  bool wraps(std::size_t j, double dt) const {
    const double way = now_[j] - last_[j];
    return wraps_[j] && std::fabs(way - kTurn * std::round(way / kTurn) -
                                  dt * last_[at_.qd() + j]) <= gate(j);
  }
  static constexpr double kTurn = 6.283185307179586;  // [rad]

  bool moves(std::size_t c) const {
    return watched(c) && fault_[c] == Fault::none &&
        step_[c] > tuning_.moves * mean_[c] + kLeastMove;
  }
  static constexpr double kLeastMove = 1e-9;  // of any unit: rounding

  // A step of speed shows in the way since the last sample, unless positions are too rough.
  bool speed_borne_out(std::size_t j, double dt) const {
    const double before = last_[at_.qd() + j], jump = std::fabs(now_[at_.qd() + j] - before);
    const double shown = std::fabs((now_[j] - last_[j]) / dt - before);
    return !(shown + tuning_.moves * mean_[j] / dt < tuning_.borne_out * jump);
  }

  // Is the step of a sensor that of one force on a link: no moment along it, none beyond reach, and
  // not along axis c alone? What moves the others far less is another load, or motion.
  bool one_force(std::size_t sensor, std::size_t c) const {
    const std::size_t first = at_.wrench() + 6 * sensor;
    double d[6];
    int moving = 0;
    for (int i = 0; i < 6; ++i) {
      if (!watched(first + i)) return false;
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

  // By how much the way of each joint differs from its speed, over some samples.
  void compare_speeds(double dt) {
    const std::size_t n = at_.joints;
    const double* __restrict now = now_.data();
    const double* __restrict last = last_.data();
    double* __restrict drift = drift_.data();
    double* __restrict usual = usual_drift_.data();
    const double silent = silent_, rate = rate_, kept = kept_;
    const double stands = tuning_.stands, surely = tuning_.surely, stale = tuning_.stale;
    const double disagrees = tuning_.disagrees;
    double* __restrict same = same_.data();
    double* __restrict often = often_.data();
    for (std::size_t c = 0; c < 2 * n; ++c) {
      const bool changes = !(now[c] == last[c]);
      same[c] = changes ? 0.0 : same[c] + 1.0;
      often[c] += same[c] < stands ? rate * ((changes ? 1.0 : 0.0) - often[c]) : 0.0;
    }
    const double least = least_drift();
    double worst = 0.0;
    for (std::size_t j = 0; j < n; ++j) {
      const double off = now[j] - last[j] - 0.5 * dt * (now[n + j] + last[n + j]);
      const double sum = kept * drift[j] + off, size = std::fabs(sum);
      drift[j] = sum == sum ? sum : 0.0;
      const double most = disagrees * usual[j] > least ? disagrees * usual[j] : least;
      const double clipped = size < most ? size : most;
      usual[j] += rate * (clipped - usual[j]);
      const bool dead = same[n + j] >= stands && often[n + j] > surely;
      const double over = dead ? 2.0 : (same[n + j] < silent ? size : stale * size) / most;
      worst = over > worst ? over : worst;
    }
    if (worst > 1.0 || any_far_) judge_speeds();
  }
  double compared_over() const {  // [s]
    return std::max(tuning_.speed_window, tuning_.speed_window_samples * period_);
  }
  double least_drift() const { return tuning_.speed_error * compared_over(); }
  // One that has not changed for so long needs little to be told from one that is right.
  bool stale(std::size_t c) const { return same_[c] >= silent_; }
  bool far(std::size_t j) const {
    const double off = std::fabs(drift_[j]) * (stale(at_.qd() + j) ? tuning_.stale : 1.0);
    return off > std::max(tuning_.disagrees * usual_drift_[j], least_drift());
  }

  void judge_speeds() {
    any_far_ = false;
    for (std::size_t j = 0; j < at_.joints; ++j) {
      Fault &position = fault_[j], &speed = fault_[at_.qd() + j];
      const bool told = speed == Fault::disagrees;
      if (told) {
        far_[j] = far(j) ? dwell_ : far_[j] - 1;
        if (far_[j] <= 0) take(j), take(at_.qd() + j);
      } else {
        far_[j] = far(j) ? far_[j] + 1 : 0;
        const bool free = position == Fault::none && speed == Fault::none;
        const bool stands = same_[j] >= tuning_.stands && same_[at_.qd() + j] < 1.0;
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
    const std::size_t v = at_.qd() + j;
    const bool still = same_[v] >= tuning_.stands && often_[v] > tuning_.surely;
    return still && same_[j] < 1.0 && std::fabs(speed_[j]) > tuning_.stuck_speed;
  }

  // Position and velocity of a joint disagree: one that has stood still since is the wrong one.
  void tell_one(std::size_t j) {
    const std::size_t v = at_.qd() + j;
    if (same_[j] >= tuning_.stands && same_[v] < 1.0) {
      leave(j, Fault::stuck);
      anchor_[j] = now_[j] + same_[j] * period_ * now_[v];  // what it has missed so far
      return;
    }
    if (same_[v] >= dwell_ && same_[j] < dwell_) return leave(v, Fault::stuck);
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

  // How often torques and wrenches change, and since when one has not.
  void count_changes(double dt) {
    const std::size_t first = at_.tau(), count = at_.count();
    const double* __restrict now = now_.data();
    const double* __restrict last = last_.data();
    double* __restrict often = often_.data();
    double* __restrict evidence = evidence_.data();
    double* __restrict run = run_.data();
    double* __restrict longest = longest_.data();
    double* __restrict highest = highest_.data();
    double* __restrict lowest = lowest_.data();
    double changes = 0.0, most = 0.0;
    for (std::size_t c = 0; c < count; ++c) changes += std::fabs(now[c] - last[c]) > 0.0 ? 1.0 : 0.0;
    if (changes == 0.0) return;  // a sample that was held or came twice
    const double kept = 1.0 - std::min(1.0, dt / tuning_.run_memory);
    const double silent = silent_, rate = rate_;
    const double likely = tuning_.evidence, likely_at_end = tuning_.evidence_at_end;
    for (std::size_t c = first; c < count; ++c) {
      const double d = std::fabs(now[c] - last[c]);
      const double p = often[c], p2 = p * p, p8 = p2 * p2 * p2 * p2;
      const double before = longest[c] * kept;
      longest[c] = d > 0.0 && run[c] > before ? run[c] : before;
      run[c] = d == 0.0 ? run[c] + 1.0 : 0.0;
      evidence[c] = d == 0.0 ? evidence[c] + p + p2 + 2.0 * p8 : 0.0;  // about -log(1 - p) each
      const double off = (d > 0.0 ? 1.0 : 0.0) - p;
      often[c] += d == d && run[c] < silent ? rate * off : 0.0;
      const bool edge = now[c] >= highest[c] || now[c] <= lowest[c];
      highest[c] = now[c] > highest[c] ? now[c] : highest[c];
      lowest[c] = now[c] < lowest[c] ? now[c] : lowest[c];
      const double over = evidence[c] - (edge ? likely_at_end : likely);
      most = over > most ? over : most;
    }
    if (most > 0.0 && seen_ > warm_up_) find_stuck();
  }

  void find_stuck() {
    for (std::size_t c = at_.tau(); c < at_.count(); ++c) {
      if (!watched(c) || fault_[c] != Fault::none || run_[c] < tuning_.runs * longest_[c]) continue;
      const bool edge = now_[c] == highest_[c] || now_[c] == lowest_[c];
      const bool stuck = run_[c] >= silent_ && evidence_[c] > tuning_.evidence;
      const bool clipped = edge && run_[c] >= tuning_.least_at_end &&
                           evidence_[c] > tuning_.evidence_at_end;
      if (!stuck && !clipped) continue;
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
          blind_[j] < tuning_.way_blind) out_[j] = anchor_[j];
      if (!speed && way && fault_[v] != Fault::none) out_[v] = speed_[j];
    }
    return {time, out_.data() + at_.q(), out_.data() + at_.qd(), out_.data() + at_.tau(),
            out_.data() + at_.wrench()};
  }

  // A joint with dry friction that the description knows.
  struct Rough {
    std::size_t number;
    JointRow joint;
  };

  GatesTuning tuning_;
  ChannelLayout at_;
  std::vector<Rough> rough_;
  double period_;
  std::vector<double> floor_;  // of steps that are judged; infinite: not a channel
  std::vector<int> witness_;   // the sensor that feels all that a torque or wrench feels; -1: none
  std::vector<char> wraps_;    // per joint: may it turn without end?
  // Now: as read, but for what is held. Out: what goes on, with NaN.
  std::vector<double> now_, last_, out_, candidate_;
  std::vector<double> mean_, step_, ratio_;                // of steps
  std::vector<double> often_, evidence_, run_, longest_, highest_, lowest_;  // of values that stay
  std::vector<double> drift_, usual_drift_, anchor_;      // of joints
  std::vector<double> tracked_, speed_, acceleration_;  // position, velocity, acceleration, of positions
  std::vector<double> blind_;  // [s] without a position that is believed
  std::vector<double> same_;   // samples for which a position or velocity has been the same
  double follows_[3] = {}, tracked_at_ = kNever;
  std::vector<double> spiked_;  // when it jumped last [s]
  std::vector<Moved> moved_;    // see `take_moved`
  std::vector<int> far_;
  std::vector<int> since_, calm_;  // samples, of what a fault waits for
  std::vector<Passes> passes_;
  std::vector<char> early_;   // may it, since the filters wait for longer? Of torques and wrenches
  std::vector<Fault> fault_;
  double time_ = kNever, memory_ = 0.0, rate_ = 0.0, kept_ = 0.0;
  int seen_ = 0, warm_up_ = 0, held_most_ = 1, silent_ = 0, return_ = 0, dwell_ = 0, refusals_ = 0;
  bool all_sound_ = true, any_far_ = false, absurd_ = false;
  Health absent_ = 0;
};

}  // namespace touchline
