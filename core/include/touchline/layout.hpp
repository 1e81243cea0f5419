// SPDX-License-Identifier: Apache-2.0
// Which sensors and joints lie outboard of which: worked out once, from the tree.
#pragma once

#include <stdexcept>
#include <vector>

#include "touchline/signals.hpp"
#include "touchline/tree.hpp"

namespace touchline {

// A pair for projections: the load of a sensor, on the joint of the `which`-th node of a row.
struct Projection {
  int which, sensor;
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
    for (const JointRow& joint : joints) {
      inboard_sensor.push_back(joint.nodes.size() == 1 ? inboard(joint.nodes[0], true) : -1);
      outboard_sensors.push_back(next_outboard(joint));
      source_sensors.push_back(on_same_path(joint));
    }
  }

  // Is `outer` the node `inner` itself or outboard of it?
  bool is_outboard(int outer, int inner) const {
    while (outer > inner) outer = tree_.nodes()[outer].parent;
    return outer == inner;
  }

  std::vector<Segment> segments;  // one per six-axis sensor in their order, then the root's
  std::vector<int> inboard_sensor;  // per joint: the nearest six-axis sensor inboard, -1: none
  std::vector<std::vector<Projection>> outboard_sensors;  // per joint: the next ones outboard
  std::vector<std::vector<Projection>> source_sensors;    // per joint: those it is read from
  std::vector<int> segment_of_sensor;                     // -1: has fewer than six axes

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

  std::vector<Projection> next_outboard(const JointRow& joint) const {
    std::vector<Projection> pairs;
    for (std::size_t i = 0; i < joint.nodes.size(); ++i) {
      const int own = inboard(joint.nodes[i], true);
      for (std::size_t s = 0; s < sensors_.size(); ++s) {
        if (sensors_[s].six_axis() && is_outboard(sensors_[s].node, joint.nodes[i]) &&
            inboard(sensors_[s].node, false) == own)
          pairs.push_back({static_cast<int>(i), static_cast<int>(s)});
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
          pairs.push_back({static_cast<int>(i), source});
      }
    }
    return pairs;
  }

  const Tree& tree_;
  const std::vector<SensorRow>& sensors_;
};

}  // namespace touchline
