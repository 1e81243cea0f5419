// SPDX-License-Identifier: Apache-2.0
// What friction a joint has shown, and what may have come of it since the baseline. A torque against
// the joint's own velocity, which changes with that, and of which the segment's force-torque sensor
// feels nothing, is friction: a contact loads the sensor, too. No allocation after construction.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class FrictionSeen {
 public:
  explicit FrictionSeen(std::size_t rows) : rows_(rows) {}

  // Row i is of a joint that moves at `speed` [rad/s or m/s]; `part`: what its filter takes of a sample,
  // and `slow_part` the mean of the last moments.
  void follow(std::size_t i, double speed, double part, double slow_part, const DetectorTuning& t) {
    Row& row = rows_[i];
    const double way = speed / (std::fabs(speed) + t.friction_speed);
    if (!row.started) row = {true, way, way, way, 0.0, 0.0};
    row.way += (way - row.way) * part;
    row.trend += (row.way - row.trend) * slow_part;
  }

  // Has enough of the friction of row i come since the baseline to tell of it?
  bool tells(std::size_t i, const DetectorTuning& t) const { return turned(i) >= t.friction_turned; }

  // What row i is off its baseline by [N or Nm], for dt [s] in which its sensor feels nothing.
  void learn(std::size_t i, double off, double dt, const DetectorTuning& t) {
    Row& row = rows_[i];
    const double turned = row.way - row.base;
    const double keep = std::max(0.0, 1.0 - dt * turned * turned / t.motion_memory);
    row.square = keep * row.square + turned * turned * dt;
    row.product = keep * row.product - off * turned * dt;
  }

  // The baseline of row i takes the part `gain` of what the last sample has, or rests on the mean of
  // the last moments.
  void average(std::size_t i, double gain) {
    rows_[i].base += (rows_[i].way - rows_[i].base) * gain;
  }
  void rest(std::size_t i) { rows_[i].base = rows_[i].trend; }

  // The friction that row i has shown [N or Nm], 0 where that is less than `least`; and how much of it
  // is sure, 0 to 1.
  double shown(std::size_t i, double least, const DetectorTuning& t) const {
    const Row& row = rows_[i];
    const double friction = row.product / (row.square + t.friction_few);
    return friction > least ? friction : 0.0;
  }
  double sure(std::size_t i, const DetectorTuning& t) const {
    return rows_[i].square / (rows_[i].square + t.friction_enough);
  }

  // Which part of the joint's friction has come since the baseline: 2 once it goes the other way.
  double turned(std::size_t i) const { return std::fabs(rows_[i].way - rows_[i].base); }
  // The way it went while the baseline was averaged, -1 to 1.
  double way(std::size_t i) const { return rows_[i].base; }

  void go_on_from(const FrictionSeen& other, std::size_t of, std::size_t i) {
    rows_[i] = other.rows_[of];
  }

 private:
  struct Row {
    bool started = false;
    // Of the joint, -1 to 1, filtered as the row is: now, in the last moments, and of the baseline.
    double way = 0.0, trend = 0.0, base = 0.0;
    double square = 0.0, product = 0.0;  // sums of how much of it came [s], and with it [N s or Nm s]
  };
  std::vector<Row> rows_;
};

}  // namespace touchline
