// SPDX-License-Identifier: Apache-2.0
// The rows of each segment besides the wrench of its six-axis sensor: joint torques, and the axes of
// sensors that have fewer than six. What a wrench on a body does to each of them.
// Theory: docs/theory.md, section 5.1.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

// A joint's torque, or one axis of a sensor that has fewer than six.
struct SegmentRow {
  int joint, sensor, axis;
};

class SegmentRows {
 public:
  SegmentRows(const Observer& observer, const Posture& posture)
      : observer_(observer), posture_(posture) {
    for (int g = 0; g < observer.row_layout().segments; ++g) rows_.push_back(rows_of(g));
  }

  const std::vector<SegmentRow>& of(int segment) const { return rows_[segment]; }

  std::size_t most() const {
    std::size_t most = 0;
    for (const auto& rows : rows_) most = std::max(most, rows.size());
    return most;
  }

  // Does a row feel contacts on the body of `node`?
  bool feels(const SegmentRow& r, int node) const {
    if (r.joint < 0) return is_outboard(node, observer_.sensors()[r.sensor].node);
    for (int own : observer_.joints()[r.joint].nodes) {
      if (is_outboard(node, own)) return true;
    }
    return false;
  }

  // What a unit wrench on the body of `node` does to a row; false: nothing.
  bool subspace(const SegmentRow& r, int node, double* out) const {
    return subspace(r, posture_, node, out);
  }

  // The same in another posture.
  bool subspace(const SegmentRow& r, const Posture& posture, int node, double* out) const {
    Spatial sum{};
    bool loaded = false;
    if (r.joint >= 0) {
      for (int own : observer_.joints()[r.joint].nodes) {
        if (!is_outboard(node, own)) continue;
        sum = sum + posture.subspace(own);
        loaded = true;
      }
    } else if (is_outboard(node, observer_.sensors()[r.sensor].node)) {
      sum = posture.axis(observer_.sensors()[r.sensor].node, r.axis);
      loaded = true;
    }
    // The power of a wrench along a twist [v; w]: f . v + m . w.
    store(sum, out);
    return loaded;
  }

  // What a wrench on the body of `node`, `lag` [s] old, does to a row; `loaded`: is it felt there?
  double load(const SegmentRow& r, int node, const Spatial& w, double lag, bool& loaded) const {
    double sum = 0.0;
    loaded = false;
    if (r.joint < 0) {
      const int own = observer_.sensors()[r.sensor].node;
      loaded = is_outboard(node, own);
      return loaded ? dot(earlier(posture_.axis(own, r.axis), own, lag), w) : 0.0;
    }
    for (int own : observer_.joints()[r.joint].nodes) {
      if (!is_outboard(node, own)) continue;
      sum += dot(earlier(posture_.subspace(own), own, lag), w);
      loaded = true;
    }
    return sum;
  }

  // What a wrench, `lag` [s] old, would do to the torque of a joint that carries it.
  double carried(const SegmentRow& r, const Spatial& w, double lag) const {
    double sum = 0.0;
    for (int own : observer_.joints()[r.joint].nodes)
      sum += dot(earlier(posture_.subspace(own), own, lag), w);
    return sum;
  }

 private:
  bool is_outboard(int outer, int inner) const {
    return observer_.layout().is_outboard(outer, inner);
  }

  // How the twist along which a row measures was `lag` ago; it moves with the body of `node`.
  Spatial earlier(const Spatial& s, int node, double lag) const {
    const Spatial& v = posture_.twist(node);
    return {s.linear - lag * (cross(v.angular, s.linear) + cross(v.linear, s.angular)),
            s.angular - lag * cross(v.angular, s.angular)};
  }

  std::vector<SegmentRow> rows_of(int g) const {
    std::vector<SegmentRow> rows;
    const RowLayout& layout = observer_.row_layout();
    const int own = observer_.layout().segments[g].sensor;
    for (int j = 0; j < layout.joints; ++j) {
      const JointRow& joint = observer_.joints()[j];
      if (joint.measured() && !joint.nodes.empty() && inboard_sensor(joint.nodes[0]) == own)
        rows.push_back({j, -1, -1});
    }
    for (int s = 0; s < layout.sensors; ++s) {
      const SensorRow& sensor = observer_.sensors()[s];
      if (sensor.six_axis() || inboard_sensor(sensor.node) != own || carries_sensor(sensor.node))
        continue;
      for (int a = 0; a < 6; ++a) {
        if (sensor.axes[a]) rows.push_back({-1, s, a});
      }
    }
    return rows;
  }

  int inboard_sensor(int node) const {
    for (; node >= 0; node = posture_.nodes()[node].parent) {
      for (std::size_t s = 0; s < observer_.sensors().size(); ++s) {
        if (observer_.sensors()[s].six_axis() && observer_.sensors()[s].node == node)
          return static_cast<int>(s);
      }
    }
    return -1;
  }

  bool carries_sensor(int node) const {
    for (const SensorRow& s : observer_.sensors()) {
      if (s.six_axis() && is_outboard(s.node, node)) return true;
    }
    return false;
  }

  const Observer& observer_;
  const Posture& posture_;
  std::vector<std::vector<SegmentRow>> rows_;  // per segment
};

}  // namespace touchline
