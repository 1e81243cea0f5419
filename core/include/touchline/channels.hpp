// SPDX-License-Identifier: Apache-2.0
// The rows of one robot: which balances and filters each joint, segment and sensor has.
#pragma once

#include <cstddef>
#include <vector>

#include "touchline/filter.hpp"
#include "touchline/layout.hpp"
#include "touchline/signals.hpp"

namespace touchline {

// `segment` filters the momentum of each segment in world axes: no ghost contact in motion.
// `paper` filters each residual in its own sensor frame and subtracts afterwards (18).
enum class Method { segment, paper };

class Channels {
 public:
  // The filter that a sensor's wrench is taken from where the segments do not tell it.
  enum class SensorFilter { none, world, local };

  Channels(const Layout& layout, const std::vector<JointRow>& joints,
           const std::vector<SensorRow>& sensors, Method method, Discretization rule)
      : filters(rule),
        joints_(joints.size()),
        segments_(layout.segments.size()),
        local_balances_(sensors.size(), 0),
        sensor_filters_(sensors.size(), 0) {
    for (std::size_t j = 0; j < joints_; ++j) balances.add(1);
    for (std::size_t g = 0; g < segments_; ++g) balances.add(6);
    for (std::size_t s = 0; s < sensors.size(); ++s) balances.add(6);
    for (int part = 0; part < 3; ++part) {
      for (const JointRow& joint : joints) filters.add(1, joint.bandwidth);
    }
    for (const Segment& segment : layout.segments)
      filters.add(6, segment.sensor < 0 ? 1.0 : sensors[segment.sensor].bandwidth);
    for (std::size_t s = 0; s < sensors.size(); ++s) {
      kinds_.push_back(kind(layout, sensors, s, method));
      if (kinds_[s] == SensorFilter::local) local_balances_[s] = balances.add(6);
      if (kinds_[s] != SensorFilter::none)
        sensor_filters_[s] = filters.add(6, sensors[s].bandwidth);
    }
  }

  // Numbers of groups of balances.
  std::size_t joint(std::size_t j) const { return j; }
  std::size_t segment(std::size_t g) const { return joints_ + g; }
  std::size_t sensor(std::size_t s) const { return joints_ + segments_ + s; }
  std::size_t local(std::size_t s) const { return local_balances_[s]; }

  // Numbers of groups of filters: all of a joint's external torque, without what the next sensors
  // outboard see, without what the sensor inboard sees; the wrenches.
  std::size_t external(std::size_t j) const { return j; }
  std::size_t own(std::size_t j) const { return joints_ + j; }
  std::size_t parity(std::size_t j) const { return 2 * joints_ + j; }
  std::size_t segment_filter(std::size_t g) const { return 3 * joints_ + g; }
  SensorFilter kind(std::size_t s) const { return kinds_[s]; }
  std::size_t sensor_filter(std::size_t s) const { return sensor_filters_[s]; }

  Balances balances;
  Filters filters;

 private:
  static SensorFilter kind(const Layout& layout, const std::vector<SensorRow>& sensors,
                           std::size_t s, Method method) {
    if (method == Method::paper || !sensors[s].six_axis()) return SensorFilter::local;
    const Segment& segment = layout.segments[layout.segment_of_sensor[s]];
    return segment.successors.empty() ? SensorFilter::none : SensorFilter::world;
  }

  std::size_t joints_, segments_;
  std::vector<std::size_t> local_balances_, sensor_filters_;
  std::vector<SensorFilter> kinds_;
};

}  // namespace touchline
