// SPDX-License-Identifier: Apache-2.0
// What friction a joint has shown, and what may have come of it since the baseline. A torque against
// the joint's own velocity, which changes with that, and of which the segment's force-torque sensor
// feels nothing, is friction: a contact loads the sensor, too. Without a sensor joints show that there
// is friction as they turn, again and again. No allocation after construction.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/detector/row_offsets.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

class FrictionSeen {
 public:
  // All that is handed over stays the caller's.
  FrictionSeen(const Observer& observer, const DetectorRows& rows, const RowOffsets& offsets,
               const DetectorTuning& tuning)
      : observer_(observer),
        rows_(rows),
        offsets_(offsets),
        tuning_(tuning),
        joints_(rows.size()),
        shown_(rows.size()),
        turns_(rows.segments()),
        first_(rows.segments()) {
    for (std::size_t g = 0; g < rows.segments(); ++g) {
      first_[g] = rows.first(g);
      while (first_[g] < rows.end(g) && rows.of_wrench(first_[g])) ++first_[g];
    }
  }

  // Joints that are tested beside a force-torque sensor, which feels none of it; `posture`: null while
  // it is not known. Of those that no contact can load, as `loadable` says by row, all is friction. So is,
  // of a segment whose joints have turned, what they have while `untouched(segment)`.
  template <class Untouched>
  void follow(const Posture* posture, const std::vector<char>& loadable, Untouched&& untouched,
              double dt) {
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      for (const std::size_t i : torques_of(g)) {
        if (!rows_.samples[i].known) continue;
        const double part = std::min(1.0, dt * rows_.bandwidths[i]);
        joints_[i].follow(rows_.samples[i].speed, part, std::min(1.0, part / tuning_.trend), tuning_);
      }
      const bool watched = has_sensor(g), silent = watched && posture != nullptr && is_silent(g);
      if (!watched) follow_turns(g, loadable);
      const Spatial felt = silent ? felt_by_sensor(g, *posture) : Spatial{};
      const bool told = watched || has_turned(g), free = !watched && told && untouched(g);
      double most = 0.0;
      for (const std::size_t i : torques_of(g)) {
        const bool bare = loadable[i] == 0;
        if (!shows(i) || !(told || bare)) continue;
        Joint& joint = joints_[i];
        const bool tells = joint.turned() >= tuning_.friction_turned;
        if ((silent || bare || free) && offsets_.started(i) && tells)
          joint.learn(silent && !bare ? unexplained(i, felt, *posture) : off(i), dt, tuning_);
        shown_[i] = joint.shown(rows_[i].contact, tuning_);
        most = std::max(most, shown_[i]);
      }
      for (const std::size_t i : torques_of(g))
        if (shows(i) && (told || loadable[i] == 0)) expect(i, most);
    }
  }

  // May friction be what row i is off its baseline by? Only of a joint whose way has changed since then,
  // and against that change.
  bool explains(std::size_t i) const {
    const double turn = joints_[i].now - joints_[i].base;
    return !rows_.of_wrench(i) && std::fabs(turn) >= tuning_.friction_turned && off(i) * turn <= 0.0;
  }
  // And how it begins? What comes within the last moments must do so with the joint's way, unless the
  // joint has stood: it breaks away before it is seen to move.
  bool explains_onset(std::size_t i) const {
    if (!explains(i)) return false;
    const Joint& joint = joints_[i];
    const bool stood = std::fabs(joint.trend) < tuning_.friction_stood;
    if (stood || offsets_.quick(i) < offsets_.creep(i)) return true;
    const double change = rows_.samples[i].residual - offsets_.trend(i), lately = joint.now - joint.trend;
    const double least = tuning_.friction_quick * tuning_.creep_share * std::fabs(joint.trend - joint.base);
    return change * lately < 0.0 && std::fabs(lately) >= least;
  }

  // Have joints of a segment without a sensor shown friction by their turns? So often no contact comes
  // just as a joint begins to turn, against that, one way and then the other.
  bool has_turned(std::size_t g) const { return turns_[g] >= tuning_.friction_turns; }

  // What friction may have added to row i since its baseline [N or Nm].
  double added(std::size_t i) const { return joints_[i].added; }

  // The baselines of the rows that are averaged take the present sample; or a segment's rows rest on
  // the mean of the last moments.
  void average(const RowLanes& averaged, double dt) {
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      for (const std::size_t i : torques_of(g))
        if (averaged[i] > 0.0) joints_[i].average(offsets_.share(i, dt));
    }
  }
  void rest(std::size_t i) { joints_[i].base = joints_[i].trend; }

  void go_on_from(const FrictionSeen& other, std::size_t of, std::size_t i) {
    joints_[i] = other.joints_[of];
    int& turns = turns_[rows_[i].segment];
    turns = std::max(turns, other.turns_[other.rows_[of].segment]);
  }

 private:
  struct Joint {
    bool started = false;
    // The way it goes, -1 to 1: at this sample; filtered as its row is now, in the last moments, and of
    // the baseline.
    double now = 0.0;
    double way = 0.0, trend = 0.0, base = 0.0;
    double square = 0.0, product = 0.0;  // sums of how much of it came [s], and with it [N s or Nm s]
    double added = 0.0;
    bool over = false;  // was its row over its limit at the last sample?
    int side = 0;       // the way it turned when that last began against it, 1 or -1; 0: never

    // `part`: what its filter takes of a sample, and `slow_part` the mean of the last moments.
    void follow(double speed, double part, double slow_part, const DetectorTuning& t) {
      now = speed / (std::fabs(speed) + t.friction_speed);
      if (!started) {
        way = trend = base = now;
        started = true;
      }
      way += (now - way) * part;
      trend += (way - trend) * slow_part;
    }

    // What its row is off its baseline by [N or Nm], for dt [s] in which the sensor feels nothing.
    void learn(double off, double dt, const DetectorTuning& t) {
      const double turn = way - base;
      const double keep = std::max(0.0, 1.0 - dt * turn * turn / t.motion_memory);
      square = keep * square + turn * turn * dt;
      product = keep * product - off * turn * dt;
    }

    // The baseline takes the part `gain` of what the last sample has.
    void average(double gain) { base += (way - base) * gain; }

    // The friction that it has shown [N or Nm], 0 where that is less than `least`; and how much of it
    // is sure, 0 to 1.
    double shown(double least, const DetectorTuning& t) const {
      const double friction = product / (square + t.friction_few);
      return friction > least ? friction : 0.0;
    }
    double sure(const DetectorTuning& t) const { return square / (square + t.friction_enough); }

    // Which part of its friction has come since the baseline: 2 once it goes the other way.
    double turned() const { return std::fabs(way - base); }
  };

  bool has_sensor(std::size_t g) const { return observer_.layout().segments[g].sensor >= 0; }
  // Rows of torques stand behind those of the segment's wrench.
  RowRange wrench_of(std::size_t g) const { return {rows_.first(g), first_[g]}; }
  RowRange torques_of(std::size_t g) const { return {first_[g], rows_.end(g)}; }
  // Of a torque.
  bool shows(std::size_t i) const { return rows_.samples[i].known && rows_[i].seen > 0.0; }

  // Counts how often a joint's row goes over its limit as the joint begins to turn: against the turn, and
  // the other way than the time before. What comes along with the turn speaks against friction.
  void follow_turns(std::size_t g, const std::vector<char>& loadable) {
    if (has_turned(g)) return;
    for (const std::size_t i : torques_of(g)) {
      if (!shows(i) || loadable[i] == 0 || !offsets_.started(i)) continue;
      Joint& joint = joints_[i];
      const bool before = std::exchange(joint.over, std::fabs(off(i)) > rows_.limit(i));
      if (!joint.over || before || rows_.samples[i].slowest >= tuning_.reversal_speed) continue;
      if (joint.turned() < tuning_.friction_turned) continue;
      const double turn = joint.way - joint.base;
      const int side = turn > 0.0 ? 1 : -1;
      if (off(i) * turn > 0.0) {
        turns_[g] = std::max(0, turns_[g] - 1);
        joint.side = 0;
        continue;
      }
      turns_[g] += joint.side == -side ? 1 : 0;
      joint.side = side;
    }
  }

  // What may have come of the friction of a joint; `other`: the most that one beside it has shown. A
  // joint of which little has been seen may have as much, or as stood there when it was moving at the
  // start.
  void expect(std::size_t i, double other) {
    Joint& joint = joints_[i];
    const double contact = rows_[i].contact;
    if (offsets_.shown(i) > contact && offsets_.anchor(i) * joint.base < 0.0)
      other = std::max(other, std::fabs(offsets_.anchor(i)));
    const double by_other = other > 0.0 ? (1.0 - joint.sure(tuning_)) * other : 0.0;
    joint.added = std::max(shown_[i], by_other) * joint.turned();
  }

  // Does the sensor of a segment feel nothing?
  bool is_silent(std::size_t g) const {
    bool any = false;
    for (const std::size_t i : wrench_of(g)) {
      if (!rows_.samples[i].known || !offsets_.started(i)) return false;
      any = true;
      if (std::fabs(off(i)) > rows_.limit(i)) return false;
    }
    return any;
  }

  // What a segment's sensor shows, in world [N, Nm].
  Spatial felt_by_sensor(std::size_t g, const Posture& posture) const {
    double w[6] = {};
    for (const std::size_t i : wrench_of(g)) w[rows_[i].component] = off(i);
    const int node = observer_.sensors()[observer_.layout().segments[g].sensor].node;
    return wrench_to_parent(posture.pose(node), load(w));
  }

  // What a joint's row has that no contact explains of which the sensor shows no more than it does,
  // `felt`. One inboard of the joint does not load it; one outboard does by what the sensor shows.
  double unexplained(std::size_t i, const Spatial& felt, const Posture& posture) const {
    const double inboard = off(i);
    double outboard = inboard;
    for (int node : observer_.joints()[rows_[i].joint].nodes)
      outboard -= dot(posture.subspace(node), felt);
    if (inboard * outboard <= 0.0) return 0.0;
    return std::fabs(inboard) < std::fabs(outboard) ? inboard : outboard;
  }

  double off(std::size_t i) const { return rows_.samples[i].residual - offsets_.baseline(i); }

  const Observer& observer_;
  const DetectorRows& rows_;
  const RowOffsets& offsets_;
  const DetectorTuning& tuning_;
  std::vector<Joint> joints_;  // per row
  std::vector<double> shown_;  // per row: the friction that it has shown [N or Nm]
  std::vector<int> turns_;     // per segment without a sensor: see `follow_turns`
  std::vector<std::size_t> first_;  // per segment: its first row of a torque
};

}  // namespace touchline
