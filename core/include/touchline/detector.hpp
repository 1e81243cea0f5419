// SPDX-License-Identifier: Apache-2.0
// Tells contact from noise, per segment: thresholds per row and for all rows together, with
// hysteresis, a minimum duration, and a slow baseline that follows constant offsets while nothing
// touches. No allocation, lock, exception or output in `step`.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/observer.hpp"

namespace touchline {

enum class Level { none = 0, contact = 1, collision = 2 };

// One residual of a segment: a component of its wrench in the frame of its own sensor, or the
// torque that contacts on the segment put on one of its joints.
struct DetectionRow {
  int segment;
  int component;  // 0 to 5 of the segment wrench; -1: a joint
  int joint;
  double contact, collision;  // thresholds [N or Nm]
  double baseline_limit;      // the largest residual that is taken for an offset [N or Nm]
};

struct DetectionTimes {
  double min_duration;  // a test must hold this long to fire [s]
  double hold;          // and be quiet this long to clear [s]
  double baseline;      // time constant of the baseline [s]
  double release;       // cleared below this fraction of the thresholds
};

class Detector {
 public:
  // `sum_limit` (one per segment): the limit of the sum of squares of all normalized rows.
  Detector(const Observer& observer, std::vector<DetectionRow> rows,
           std::vector<double> sum_limit, const DetectionTimes& times)
      : observer_(observer),
        rows_(std::move(rows)),
        sum_limit_(std::move(sum_limit)),
        times_(times),
        states_(rows_.size()),
        segments_(sum_limit_.size()),
        normalized_(rows_.size(), 0.0),
        levels_(sum_limit_.size(), 0),
        quiet_(sum_limit_.size(), 0.0) {}

  // To be called after each step of the observer, with the row it wrote.
  void step(const double* output) {
    row_ = output;
    const double now = observer_.time();
    const double dt = timed_ ? std::max(0.0, now - time_) : 0.0;
    timed_ = true;
    time_ = now;
    for (Segment& s : segments_) s.peak = s.sum = s.collision = 0.0;
    for (std::size_t i = 0; i < rows_.size(); ++i) test_row(i);
    for (std::size_t g = 0; g < segments_.size(); ++g) decide(g, dt);
    for (std::size_t i = 0; i < rows_.size(); ++i) follow_offset(i, dt);
  }

  const std::vector<DetectionRow>& rows() const { return rows_; }
  // Per row: (residual - baseline) / contact threshold; 0 where there is no settled residual.
  const std::vector<double>& normalized() const { return normalized_; }
  const std::vector<int>& levels() const { return levels_; }  // per segment
  // Per segment: over how long its baseline has been averaged [s].
  const std::vector<double>& quiet() const { return quiet_; }
  double baseline(int row) const { return states_[row].baseline; }
  const Observer& observer() const { return observer_; }

 private:
  struct RowState {
    double value = 0.0, baseline = 0.0, age = 0.0;
    bool known = false, started = false;
  };
  struct Segment {
    double peak = 0.0, sum = 0.0, collision = 0.0;  // of the normalized rows
    double above = 0.0, above_collision = 0.0, below = 0.0;  // for how long [s]
    bool pending = false, pending_collision = false;
  };

  double residual(const DetectionRow& row) const {
    const RowLayout& layout = observer_.row_layout();
    if (row.component < 0) {
      return row_[layout.joint_settled() + row.joint] > 0.0
                 ? row_[layout.segment_torque() + row.joint]
                 : std::nan("");
    }
    if (!(row_[layout.segment_settled() + row.segment] > 0.0)) return std::nan("");
    const Spatial w = wrench_to_child(
        observer_.sensor_pose(observer_.layout().segments[row.segment].sensor),
        load(row_ + layout.segment_wrench() + 6 * row.segment));
    double parts[6];
    store(w, parts);
    return parts[row.component];
  }

  void test_row(std::size_t i) {
    const DetectionRow& row = rows_[i];
    RowState& s = states_[i];
    const double value = residual(row);
    s.known = std::isfinite(value);
    normalized_[i] = 0.0;
    if (!s.known) return;
    s.value = value;
    if (!s.started) {  // the first settled residual is taken for an offset, up to the limit
      s.baseline = std::clamp(value, -row.baseline_limit, row.baseline_limit);
      s.started = true;
    }
    const double x = (value - s.baseline) / row.contact;
    normalized_[i] = x;
    Segment& segment = segments_[row.segment];
    segment.peak = std::max(segment.peak, std::fabs(x));
    segment.sum += x * x;
    segment.collision = std::max(segment.collision, std::fabs(x) * row.contact / row.collision);
  }

  void decide(std::size_t g, double dt) {
    Segment& s = segments_[g];
    const double sum = s.sum / sum_limit_[g];
    const double level = std::max(s.peak, std::sqrt(sum));
    advance(level > 1.0, dt, s.pending, s.above);
    advance(s.collision > 1.0, dt, s.pending_collision, s.above_collision);
    s.below = level < times_.release ? s.below + dt : 0.0;
    if (s.pending && s.above >= times_.min_duration) levels_[g] = std::max(levels_[g], 1);
    if (s.pending_collision && s.above_collision >= times_.min_duration) levels_[g] = 2;
    if (levels_[g] > 0 && s.below >= times_.hold) levels_[g] = 0;
  }

  // For how long a test has held without a break.
  static void advance(bool holds, double dt, bool& pending, double& duration) {
    duration = holds && pending ? duration + dt : 0.0;
    pending = holds;
  }

  void follow_offset(std::size_t i, double dt) {
    RowState& s = states_[i];
    const DetectionRow& row = rows_[i];
    if (!s.known || levels_[row.segment] > 0 || segments_[row.segment].pending) return;
    quiet_[row.segment] = s.age += dt;  // a running mean first, a low-pass once it has seen enough
    const double tau = std::min(s.age, times_.baseline);
    if (tau <= 0.0) return;
    const double next = s.baseline + (s.value - s.baseline) * std::min(1.0, dt / tau);
    s.baseline = std::clamp(next, -row.baseline_limit, row.baseline_limit);
  }

  const Observer& observer_;
  const double* row_ = nullptr;
  std::vector<DetectionRow> rows_;
  std::vector<double> sum_limit_;
  DetectionTimes times_;
  std::vector<RowState> states_;
  std::vector<Segment> segments_;
  std::vector<double> normalized_;
  std::vector<int> levels_;
  std::vector<double> quiet_;
  double time_ = 0.0;
  bool timed_ = false;
};

}  // namespace touchline
