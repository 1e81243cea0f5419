// SPDX-License-Identifier: Apache-2.0
// Which balances and filters each joint, segment and sensor of a robot has, and the rules by which
// a filter goes on, waits or begins anew where values were missing.
// Theory: docs/theory.md, section 2.4.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/observer/balance.hpp"
#include "touchline/detail/observer/filter.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/signals.hpp"

namespace touchline {

// `segment` filters the momentum of each segment in world axes: no ghost contact in motion.
// `paper` filters each residual in its own sensor frame and subtracts afterwards (18).
enum class Method { segment, paper };

class Channels {
 public:
  // The filter that a sensor's wrench is taken from where the segments do not tell it.
  enum class SensorFilter { none, world, local };

  Channels(const Layout& layout, const std::vector<JointRow>& joints,
           const std::vector<SensorRow>& sensors, Method method, Discretization rule,
           const ObserverTuning& tuning)
      : balances(tuning.longest_bridge),
        filters(rule, tuning),
        layout_(layout),
        joints_(joints),
        segments_(layout.segments.size()),
        local_balances_(sensors.size(), 0),
        sensor_filters_(sensors.size(), 0) {
    for (const JointRow& joint : joints) balances.add(1, joint.measured());
    for (const Segment& segment : layout.segments) balances.add(6, segment.sensor >= 0);
    for (std::size_t s = 0; s < sensors.size(); ++s) balances.add(6, true);
    for (int part = 0; part < 3; ++part) {
      for (const JointRow& joint : joints) filters.add(1, joint.bandwidth);
    }
    for (const Segment& segment : layout.segments) {
      const bool root = segment.sensor < 0;  // nothing is known of it: any bandwidth in use does
      filters.add(6, root ? joints.at(0).bandwidth : sensors[segment.sensor].bandwidth);
    }
    for (std::size_t s = 0; s < sensors.size(); ++s) {
      kinds_.push_back(choose(sensors, s, method));
      if (kinds_[s] == SensorFilter::local) local_balances_[s] = balances.add(6, true);
      if (kinds_[s] != SensorFilter::none)
        sensor_filters_[s] = filters.add(6, sensors[s].bandwidth);
    }
    over_gap_.reserve(filters.groups());
  }

  // Numbers of groups of balances.
  std::size_t joint(std::size_t j) const { return j; }
  std::size_t segment(std::size_t g) const { return joints_.size() + g; }
  std::size_t sensor(std::size_t s) const { return joints_.size() + segments_ + s; }
  std::size_t local(std::size_t s) const { return local_balances_[s]; }
  // The first row of all sensors, six each, among those of the balances.
  std::size_t sensor_rows() const { return joints_.size() + 6 * segments_; }

  // Numbers of groups of filters: all of a joint's external torque, without what the next sensors
  // outboard see, without what the sensor inboard sees; then the wrenches.
  std::size_t external(std::size_t j) const { return j; }
  std::size_t own(std::size_t j) const { return joints_.size() + j; }
  std::size_t parity(std::size_t j) const { return 2 * joints_.size() + j; }
  std::size_t segment_filter(std::size_t g) const { return 3 * joints_.size() + g; }
  SensorFilter kind(std::size_t s) const { return kinds_[s]; }
  std::size_t sensor_filter(std::size_t s) const { return sensor_filters_[s]; }

  // Enters which joints and sensors have values at this instant; returns whether a next sample
  // with all values needs no books.
  bool book(const std::vector<char>& joint_present, const std::vector<char>& sensor_present,
            const Instant& now) {
    bool regular = true;
    for (std::size_t j = 0; j < joints_.size(); ++j)
      regular &= balances.book(joint(j), joint_present[j] != 0, now);
    for (std::size_t s = 0; s < kinds_.size(); ++s) {
      const bool present = sensor_present[s] != 0;
      regular &= balances.book(sensor(s), present, now);
      if (kinds_[s] == SensorFilter::local) balances.book(local(s), present, now);
    }
    for (std::size_t g = 0; g < segments_; ++g) {
      const Segment& segment = layout_.segments[g];
      bool present = segment.sensor >= 0 && sensor_present[segment.sensor];
      for (int t : segment.successors) present = present && sensor_present[t];
      regular &= balances.book(this->segment(g), present, now);
    }
    return regular;
  }

  // What a joint's torque, or a sensor, had last is not believed: nothing goes on from it.
  void begin_torque_anew(std::size_t j) {
    balances.forget(joint(j));
    for (const std::size_t filter : {external(j), own(j), parity(j)}) filters.forget(filter);
  }
  void begin_sensor_anew(std::size_t s) {
    const int own_sensor = static_cast<int>(s);
    balances.forget(sensor(s));
    if (kinds_[s] == SensorFilter::local) balances.forget(local(s));
    if (kinds_[s] != SensorFilter::none) filters.forget(sensor_filter(s));
    for (std::size_t g = 0; g < segments_; ++g) {
      const Segment& part = layout_.segments[g];
      const std::vector<int>& outer = part.successors;
      if (part.sensor != own_sensor &&
          std::find(outer.begin(), outer.end(), own_sensor) == outer.end())
        continue;
      balances.forget(segment(g));
      filters.forget(segment_filter(g));
    }
    const auto uses = [own_sensor](const std::vector<Projection>& pairs) {
      return std::any_of(pairs.begin(), pairs.end(),
                         [own_sensor](const Projection& pair) { return pair.sensor == own_sensor; });
    };
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      if (uses(layout_.source_sensors[j])) filters.forget(external(j));
      if (uses(layout_.outboard_sensors[j])) filters.forget(own(j));
      if (uses(layout_.inboard_sensors[j])) filters.forget(parity(j));
    }
  }

  // After `book` and the balance: what each filter does with this sample.
  void decide(const Instant& now) {
    over_gap_.clear();
    for (std::size_t j = 0; j < joints_.size(); ++j) decide_joint(j, now);
    for (std::size_t g = 0; g < segments_; ++g) follow(segment_filter(g), segment(g), now);
    for (std::size_t s = 0; s < kinds_.size(); ++s) {
      if (kinds_[s] == SensorFilter::world) follow(sensor_filter(s), sensor(s), now);
      if (kinds_[s] == SensorFilter::local) follow(sensor_filter(s), local(s), now);
    }
    filters.fade_doubts(now);
    for (const std::size_t filter : over_gap_) filters.doubt(filter, now);
  }

  Balances balances;
  Filters filters;

 private:
  SensorFilter choose(const std::vector<SensorRow>& sensors, std::size_t s, Method method) const {
    if (method == Method::paper || !sensors[s].six_axis()) return SensorFilter::local;
    const Segment& segment = layout_.segments[layout_.segment_of_sensor[s]];
    return segment.successors.empty() ? SensorFilter::none : SensorFilter::world;
  }

  void decide_joint(std::size_t j, const Instant& now) {
    if (joints_[j].torque == Torque::from) {
      const Action action = compare(external(j), nullptr, layout_.source_sensors[j], now);
      if (action != Action::filter) *balances.e(joint(j)) = kNaN;
      filters.act(own(j), Action::absent, now);
      filters.act(parity(j), Action::absent, now);
      return;
    }
    const Balances::Group& balance = balances.group(joint(j));
    follow(external(j), joint(j), now);
    compare(own(j), &balance, layout_.outboard_sensors[j], now);
    if (layout_.inboard_sensors[j].empty()) {
      filters.act(parity(j), Action::absent, now);
    } else {
      compare(parity(j), &balance, layout_.inboard_sensors[j], now);
    }
  }

  // A filter of one balance begins anew where the balance did.
  void follow(std::size_t filter, std::size_t balance, const Instant& now) {
    const Balances::Group& group = balances.group(balance);
    const bool fresh = group.fresh && filters.reaches(filter, now.time - group.dt, now);
    const Action action = !group.present ? Action::absent
                          : fresh        ? Action::filter
                                         : Action::restart;
    filters.act(filter, action, now, group.regular ? kNaN : group.dt);
    if (action == Action::filter && group.dt > now.usual_step) over_gap_.push_back(filter);
  }

  // Innovations of several balances are compared only where all of them span the interval from
  // the sample before; a filter that had to wait for that too long begins anew.
  Action compare(std::size_t filter, const Balances::Group* joint,
                 const std::vector<Projection>& pairs, const Instant& now) {
    bool present = joint == nullptr || joint->present;
    bool fresh = joint == nullptr || joint->fresh;
    bool regular = joint == nullptr || joint->regular;
    for (const Projection& pair : pairs) {
      const Balances::Group& group = balances.group(sensor(pair.sensor));
      present = present && group.present;
      regular = regular && group.regular;
    }
    fresh = fresh && filters.reaches(filter, filters.group(filter).time, now);
    const Action action = !present  ? Action::absent
                          : !fresh  ? Action::restart
                          : regular ? Action::filter
                                    : Action::hold;
    filters.act(filter, action, now);
    if (action == Action::filter && !now.usual(now.before)) over_gap_.push_back(filter);
    return action;
  }

  const Layout& layout_;
  const std::vector<JointRow>& joints_;
  std::size_t segments_;
  std::vector<std::size_t> local_balances_, sensor_filters_;
  std::vector<SensorFilter> kinds_;
  std::vector<std::size_t> over_gap_;  // filters whose inputs span a gap
};

}  // namespace touchline
