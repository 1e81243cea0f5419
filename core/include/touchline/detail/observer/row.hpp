// SPDX-License-Identifier: Apache-2.0
// The output of one sample: a row of numbers.
// Theory: docs/theory.md, section 2.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/model/spatial.hpp"
#include "touchline/detail/observer/channels.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/terms.hpp"

namespace touchline {

// Where each output stands, for n joints, k sensors and m segments.
struct RowLayout {
  int joints, sensors, segments;
  int tau_ext() const { return 0; }
  int segment_torque() const { return joints; }
  int parity() const { return 2 * joints; }
  int joint_innovation() const { return 3 * joints; }
  int sensor_wrench() const { return 4 * joints; }
  int segment_wrench() const { return sensor_wrench() + 6 * sensors; }
  int segment_innovation() const { return segment_wrench() + 6 * segments; }
  int joint_settled() const { return segment_innovation() + 6 * segments; }
  int segment_settled() const { return joint_settled() + joints; }
  int joint_gap_std() const { return segment_settled() + segments; }
  int segment_gap_std() const { return joint_gap_std() + joints; }  // two each: force, moment
  int health() const { return segment_gap_std() + 2 * segments; }
  int width() const { return health() + 1; }
};

class RowWriter {
 public:
  RowWriter(const RowLayout& row, const TermsLayout& at, const Layout& layout,
            const std::vector<SensorRow>& sensors, Method method)
      : row_(row),
        at_(at),
        layout_(layout),
        sensors_(sensors),
        method_(method),
        quality_(2 * row.joints + 3 * row.segments, 0.0) {}

  // `terms`: those of this instant. In a `steady` step what is not known is NaN already.
  void write(const Channels& channels, const Instant& now, bool steady, const double* terms,
             Health health, double* out) {
    const Filters& filters = channels.filters;
    const double* e = channels.balances.e(0);
    std::copy_n(filters.value(0), 3 * row_.joints, out + row_.tau_ext());
    std::copy_n(e, row_.joints, out + row_.joint_innovation());
    std::copy_n(filters.value(channels.segment_filter(0)), 6 * row_.segments,
                out + row_.segment_wrench());
    std::copy_n(e + row_.joints, 6 * row_.segments, out + row_.segment_innovation());
    if (!steady) blank(filters, out);
    if (method_ == Method::paper) write_paper(channels, terms, out);
    for (int s = 0; s < row_.sensors; ++s) write_sensor(s, channels, terms, steady, out);
    if (!steady || !all_settled_) settle(filters, now);
    if (!steady) doubt(filters, terms);
    std::copy(quality_.begin(), quality_.end(), out + row_.joint_settled());
    write_health(health | (all_settled_ ? 0 : kSettling), out);
  }

  bool all_settled() const { return all_settled_; }
  // What stands from `joint_settled` on as long as no gap and no restart comes.
  const std::vector<double>& quality() const { return quality_; }

  // Nothing is known at this sample.
  void write_nothing(Health health, double* out) const {
    std::fill_n(out, row_.joint_settled(), kNaN);
    std::fill_n(out + row_.joint_settled(), row_.joints + row_.segments, 0.0);
    std::fill_n(out + row_.joint_gap_std(), row_.joints + 2 * row_.segments, kNaN);
    write_health(health, out);
  }

  void write_health(Health health, double* out) const {
    out[row_.health()] = static_cast<double>(health);
  }

 private:
  void blank(const Filters& filters, double* out) const {
    for (int i = 0; i < 3 * row_.joints; ++i) {
      if (!filters.group(i).present) out[row_.tau_ext() + i] = kNaN;
    }
    for (int g = 0; g < row_.segments; ++g) {
      if (!filters.group(3 * row_.joints + g).present)
        std::fill_n(out + row_.segment_wrench() + 6 * g, 6, kNaN);
    }
  }

  void settle(const Filters& filters, const Instant& now) {
    all_settled_ = true;
    const auto enter = [&](std::size_t group, double& settled) {
      settled = filters.settled(group, now) ? 1.0 : 0.0;
      all_settled_ = all_settled_ && (settled > 0.0 || !filters.group(group).present);
    };
    for (int j = 0; j < row_.joints; ++j) enter(j, quality_[j]);
    for (int g = 0; g < row_.segments; ++g)
      enter(3 * row_.joints + g, quality_[row_.joints + g]);
  }

  // One sigma of what gaps may have left in the torques of each joint (the largest of all three),
  // and in the force and the moment about its own sensor's origin of each segment. There no lever
  // arm is in it.
  void doubt(const Filters& filters, const double* terms) {
    const int first = row_.joint_settled();
    for (int j = 0; j < row_.joints; ++j) {
      double& std = quality_[row_.joint_gap_std() - first + j];
      std = filters.group(j).present ? 0.0 : kNaN;
      if (!filters.doubtful()) continue;
      for (int filter = j; filter < 3 * row_.joints; filter += row_.joints) {
        if (!filters.group(filter).present) continue;
        std = std::fmax(std, std::fabs(*filters.half_change(filter)));
        std = std::fmax(std, std::fabs(*filters.surprise(filter)));
      }
    }
    for (int g = 0; g < row_.segments; ++g) {
      const std::size_t filter = 3 * row_.joints + g;
      double* std = quality_.data() + row_.segment_gap_std() - first + 2 * g;
      std[0] = std[1] = filters.group(filter).present ? 0.0 : kNaN;
      if (!filters.doubtful() || !filters.group(filter).present) continue;
      for (const double* wrench : {filters.half_change(filter), filters.surprise(filter)}) {
        const Spatial w = wrench_to_child(pose(terms, layout_.segments[g].sensor), load(wrench));
        std[0] = std::max(std[0], norm(w.linear));
        std[1] = std::max(std[1], norm(w.angular));
      }
    }
  }

  Pose pose(const double* terms, int s) const {
    return load_pose(terms + at_.sensor(s) + TermsLayout::kPose);
  }

  // (18), with both adjoints read as the wrench transformation from each sensor.
  void write_paper(const Channels& channels, const double* terms, double* out) const {
    const auto residual = [&](int s) {
      return wrench_to_parent(pose(terms, s),
                              load(channels.filters.value(channels.sensor_filter(s))));
    };
    for (int g = 0; g < row_.segments; ++g) {
      const Segment& segment = layout_.segments[g];
      if (!channels.filters.group(channels.segment_filter(g)).present) continue;
      Spatial wrench = residual(segment.sensor);
      for (int t : segment.successors) wrench = wrench - residual(t);
      store(wrench, out + row_.segment_wrench() + 6 * g);
    }
  }

  void write_sensor(int s, const Channels& channels, const double* terms, bool steady,
                    double* row) const {
    double* out = row + row_.sensor_wrench() + 6 * s;
    if (!steady && !channels.balances.group(channels.sensor(s)).present) {
      std::fill_n(out, 6, kNaN);
    } else if (channels.kind(s) == Channels::SensorFilter::local) {
      std::copy_n(channels.filters.value(channels.sensor_filter(s)), 6, out);
      for (int i = 0; i < 6; ++i) {
        if (!sensors_[s].axes[i]) out[i] = kNaN;
      }
    } else {
      store(wrench_to_child(pose(terms, s), outboard(s, channels, row)),
            out);
    }
  }

  // The sum of the segments outboard of sensor s, in world, or if one of them is not known the
  // sensor's own residual.
  Spatial outboard(int s, const Channels& channels, const double* row) const {
    Spatial sum;
    for (int g : layout_.segments_outboard[s]) {
      if (!channels.filters.group(channels.segment_filter(g)).present)
        return load(channels.filters.value(channels.sensor_filter(s)));
      sum = sum + load(row + row_.segment_wrench() + 6 * g);
    }
    return sum;
  }

  RowLayout row_;
  TermsLayout at_;
  const Layout& layout_;
  const std::vector<SensorRow>& sensors_;
  Method method_;
  std::vector<double> quality_;  // the columns from `joint_settled` to `segment_gap_std`
  bool all_settled_ = false;
};

}  // namespace touchline
