// SPDX-License-Identifier: Apache-2.0
// The output of one sample: a row of numbers.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/channels.hpp"
#include "touchline/health.hpp"
#include "touchline/layout.hpp"
#include "touchline/spatial.hpp"
#include "touchline/terms.hpp"

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
  int health() const { return segment_settled() + segments; }
  int width() const { return health() + 1; }
};

class RowWriter {
 public:
  RowWriter(const RowLayout& row, const Layout& layout, const std::vector<SensorRow>& sensors,
            Method method)
      : row_(row), layout_(layout), sensors_(sensors), method_(method) {}

  // `poses`: per sensor, in world. Settling joins the health.
  void write(const Channels& channels, const Instant& now, const std::vector<Pose>& poses,
             Health health, double* out) const {
    const bool settled_joints = write_joints(channels, now, out);
    const bool settled_segments = write_segments(channels, now, poses, out);
    for (int s = 0; s < row_.sensors; ++s) write_sensor(s, channels, poses[s], out);
    const bool settled = settled_joints && settled_segments;
    write_health(health | (settled ? 0 : kSettling), out);
  }

  // Nothing is known at this sample.
  void write_nothing(Health health, double* out) const {
    std::fill_n(out, row_.joint_settled(), kNaN);
    std::fill_n(out + row_.joint_settled(), row_.joints + row_.segments, 0.0);
    write_health(health, out);
  }

  void write_health(Health health, double* out) const {
    out[row_.health()] = static_cast<double>(health);
  }

 private:
  // The values of `count` groups of filters from `first` on, `width` rows each.
  static void write_values(const Filters& filters, std::size_t first, int count, int width,
                           double* out) {
    std::copy_n(filters.value(first), count * width, out);
    for (int i = 0; i < count; ++i) {
      if (!filters.group(first + i).present) std::fill_n(out + i * width, width, kNaN);
    }
  }

  bool write_joints(const Channels& channels, const Instant& now, double* out) const {
    // External, own and parity follow each other here as there.
    write_values(channels.filters, channels.external(0), 3 * row_.joints, 1, out + row_.tau_ext());
    std::copy_n(channels.balances.e(channels.joint(0)), row_.joints,
                out + row_.joint_innovation());
    return write_settled(channels.filters, channels.external(0), row_.joints, now,
                         out + row_.joint_settled());
  }

  bool write_segments(const Channels& channels, const Instant& now, const std::vector<Pose>& poses,
                      double* out) const {
    const std::size_t first = channels.segment_filter(0);
    write_values(channels.filters, first, row_.segments, 6, out + row_.segment_wrench());
    std::copy_n(channels.balances.e(channels.segment(0)), 6 * row_.segments,
                out + row_.segment_innovation());
    if (method_ == Method::paper) {
      for (int g = 0; g < row_.segments; ++g) {
        if (channels.filters.group(first + g).present)
          write_paper(g, channels, poses, out + row_.segment_wrench() + 6 * g);
      }
    }
    return write_settled(channels.filters, first, row_.segments, now, out + row_.segment_settled());
  }

  // (18), with both adjoints read as the wrench transformation from each sensor.
  void write_paper(int g, const Channels& channels, const std::vector<Pose>& poses,
                   double* out) const {
    const Segment& segment = layout_.segments[g];
    const auto residual = [&](int s) {
      return wrench_to_parent(poses[s], load(channels.filters.value(channels.sensor_filter(s))));
    };
    Spatial wrench = residual(segment.sensor);
    for (int t : segment.successors) wrench = wrench - residual(t);
    store(wrench, out);
  }

  static bool write_settled(const Filters& filters, std::size_t first, int count,
                            const Instant& now, double* out) {
    bool all = true;
    for (int i = 0; i < count; ++i) {
      const bool settled = filters.settled(first + i, now);
      out[i] = settled ? 1.0 : 0.0;
      all = all && (settled || !filters.group(first + i).present);
    }
    return all;
  }

  void write_sensor(int s, const Channels& channels, const Pose& pose, double* row) const {
    double* out = row + row_.sensor_wrench() + 6 * s;
    if (!channels.balances.group(channels.sensor(s)).present) {
      std::fill_n(out, 6, kNaN);
    } else if (method_ == Method::segment && sensors_[s].six_axis()) {
      store(wrench_to_child(pose, outboard_sum(s, channels, row)), out);
    } else {
      std::copy_n(channels.filters.value(channels.sensor_filter(s)), 6, out);
      for (int i = 0; i < 6; ++i) {
        if (!sensors_[s].axes[i]) out[i] = kNaN;
      }
    }
  }

  // The sum of the segments outboard of sensor s, in world, or if one of them is not known the
  // sensor's own residual.
  Spatial outboard_sum(int s, const Channels& channels, const double* row) const {
    Spatial sum;
    for (int g : layout_.segments_outboard[s]) {
      if (!channels.filters.group(channels.segment_filter(g)).present)
        return load(channels.filters.value(channels.sensor_filter(s)));
      sum = sum + load(row + row_.segment_wrench() + 6 * g);
    }
    return sum;
  }

  RowLayout row_;
  const Layout& layout_;
  const std::vector<SensorRow>& sensors_;
  Method method_;
};

}  // namespace touchline
