// SPDX-License-Identifier: Apache-2.0
// Which sensors and joints lie outboard of which: worked out once, from the tree.
// Theory: docs/theory.md, section 2.4.
#pragma once

#include <stdexcept>
#include <vector>

#include "touchline/detail/model/tree.hpp"
#include "touchline/detail/observer/signals.hpp"

namespace touchline {

// A pair for projections: the load of a sensor, on a line: a node that moves with a joint.
struct Projection {
  int line, sensor;
};

struct Segment {
  int sensor;                   // at its inboard end; -1: the root segment
  std::vector<int> successors;  // six-axis sensors at its outboard ends
};

class Layout {
 public:
  Layout(const Tree& tree, const std::vector<JointRow>& joints,
         const std::vector<SensorRow>& sensors)
      : segment_of_sensor(sensors.size(), -1), tree_(tree), sensors_(sensors) {
    check(joints);
    make_segments();
    for (std::size_t s = 0; s < sensors.size(); ++s) segments_outboard.push_back(outboard_of(s));
    for (const JointRow& joint : joints) {
      inboard_sensors.push_back(next_inboard(joint));
      outboard_sensors.push_back(next_outboard(joint));
      source_sensors.push_back(on_same_path(joint));
      for (int node : joint.nodes) lines.push_back(node);
    }
  }

  // Is `outer` the node `inner` itself or outboard of it?
  bool is_outboard(int outer, int inner) const {
    while (outer > inner) outer = tree_.nodes()[outer].parent;
    return outer == inner;
  }

  std::vector<Segment> segments;  // one per six-axis sensor in their order, then the root's
  std::vector<int> segment_of_sensor;                // -1: has fewer than six axes
  std::vector<std::vector<int>> segments_outboard;   // per sensor: all of them
  std::vector<int> lines;                            // nodes that move, joint by joint
  // Per joint: the nearest six-axis sensor inboard, if any (and if no other joint mimics this
  // one), and after it the next ones outboard of that sensor on branches which the joint does not
  // carry. Then the next ones outboard of the joint, and those that the joint is read from.
  std::vector<std::vector<Projection>> inboard_sensors, outboard_sensors, source_sensors;

 private:
  void check(const std::vector<JointRow>& joints) const {
    const int count = static_cast<int>(tree_.nodes().size());
    for (int i = 0; i < count; ++i) {
      if (tree_.nodes()[i].parent >= i) throw std::invalid_argument("a parent must come first");
    }
    for (const SensorRow& sensor : sensors_) {
      if (sensor.node < 0 || sensor.node >= count) throw std::invalid_argument("sensor node");
    }
    for (const JointRow& joint : joints) {
      for (int node : joint.nodes) {
        if (node < 0 || node >= count) throw std::invalid_argument("joint node");
      }
      for (int source : joint.sources) {
        if (source < 0 || source >= static_cast<int>(sensors_.size()))
          throw std::invalid_argument("source sensor");
      }
    }
  }

  // The six-axis sensor whose segment node `node` belongs to; without `self`, that of its parent.
  int inboard(int node, bool self) const {
    if (!self) node = tree_.nodes()[node].parent;
    for (; node >= 0; node = tree_.nodes()[node].parent) {
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        if (sensors_[s].six_axis() && sensors_[s].node == node) return static_cast<int>(s);
      }
    }
    return -1;
  }

  void make_segments() {
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      if (!sensors_[s].six_axis()) continue;
      segment_of_sensor[s] = static_cast<int>(segments.size());
      segments.push_back({static_cast<int>(s), {}});
    }
    // What is bolted to the world inboard of the first sensor cannot be felt: no segment.
    bool root = false;
    for (std::size_t n = 0; n < tree_.nodes().size(); ++n) {
      const bool moves = tree_.nodes()[n].kind != NodeKind::fixed;
      root = root || (moves && inboard(static_cast<int>(n), true) < 0);
    }
    if (root) segments.push_back({-1, {}});
    for (Segment& segment : segments) {
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        if (sensors_[s].six_axis() && inboard(sensors_[s].node, false) == segment.sensor)
          segment.successors.push_back(static_cast<int>(s));
      }
    }
  }

  std::vector<int> outboard_of(std::size_t sensor) const {
    std::vector<int> found;
    for (std::size_t g = 0; g < segments.size(); ++g) {
      const int s = segments[g].sensor;
      if (s >= 0 && segment_of_sensor[sensor] >= 0 &&
          is_outboard(sensors_[s].node, sensors_[sensor].node))
        found.push_back(static_cast<int>(g));
    }
    return found;
  }

  // The line of the i-th node of the joint that is being worked on.
  Projection pair(std::size_t i, int sensor) const {
    return {static_cast<int>(lines.size() + i), sensor};
  }

  std::vector<Projection> next_inboard(const JointRow& joint) const {
    const int sensor = joint.nodes.size() == 1 ? inboard(joint.nodes[0], true) : -1;
    if (sensor < 0) return {};
    std::vector<Projection> pairs{pair(0, sensor)};
    for (int t : segments[segment_of_sensor[sensor]].successors) {
      if (!is_outboard(sensors_[t].node, joint.nodes[0])) pairs.push_back(pair(0, t));
    }
    return pairs;
  }

  std::vector<Projection> next_outboard(const JointRow& joint) const {
    std::vector<Projection> pairs;
    for (std::size_t i = 0; i < joint.nodes.size(); ++i) {
      const int own = inboard(joint.nodes[i], true);
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        if (sensors_[s].six_axis() && is_outboard(sensors_[s].node, joint.nodes[i]) &&
            inboard(sensors_[s].node, false) == own)
          pairs.push_back(pair(i, static_cast<int>(s)));
      }
    }
    return pairs;
  }

  // A source counts where it lies outboard or inboard of the joint, not on another branch.
  std::vector<Projection> on_same_path(const JointRow& joint) const {
    std::vector<Projection> pairs;
    for (int source : joint.sources) {
      const int node = sensors_[source].node;
      for (std::size_t i = 0; i < joint.nodes.size(); ++i) {
        if (is_outboard(node, joint.nodes[i]) || is_outboard(joint.nodes[i], node))
          pairs.push_back(pair(i, source));
      }
    }
    return pairs;
  }

  const Tree& tree_;
  const std::vector<SensorRow>& sensors_;
};

}  // namespace touchline
