// SPDX-License-Identifier: Apache-2.0
// What the model says of one instant, from positions and velocities alone: the rows of momentum
// and n-bar (eqs. 11, 12), the joints' lines of action and the sensors' poses, without matrices.
// Theory: docs/theory.md, section 2.1.
#pragma once

#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/tree.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/signals.hpp"

namespace touchline {

// Where each term stands in the numbers of one instant.
struct TermsLayout {
  std::size_t joints, lines, sensors;  // lines: room for them, a multiple of four

  std::size_t joint_momentum() const { return 0; }
  std::size_t joint_bias() const { return joints; }
  // Six blocks of one number per line: the twist per unit of its joint's speed.
  std::size_t subspaces() const { return 2 * joints; }
  std::size_t sensor(std::size_t s) const { return 2 * joints + 6 * lines + kPerSensor * s; }
  std::size_t width() const { return sensor(sensors); }

  // Within a sensor's block.
  static constexpr std::size_t kMomentum = 0;       // outboard, in world, about its origin
  static constexpr std::size_t kWeight = 6;         // the wrench of gravity, likewise
  static constexpr std::size_t kPose = 12;          // of the sensor frame in world
  static constexpr std::size_t kLogRotation = 24;   // of the frame of the log in world
  static constexpr std::size_t kLocalMomentum = 33;  // in the sensor frame
  static constexpr std::size_t kLocalBias = 39;
  static constexpr std::size_t kPerSensor = 45;  // numbers in all
};

template <class T>
class Terms {
 public:
  // `local`: per sensor, are its rows in its own frame wanted?
  Terms(const Tree& tree, const Layout& layout, const std::vector<JointRow>& joints,
        const std::vector<SensorRow>& sensors, std::vector<char> local)
      : tree_(tree),
        sensors_(sensors),
        local_(std::move(local)),
        at_{joints.size(), (layout.lines.size() + 3) / 4 * 4, sensors.size()},
        state_(tree.make_state<T>()) {
    for (const JointRow& joint : joints) {
      rows_.push_back({joint.rotor_inertia, joint.compensated, joint.nodes.size()});
      for (int i : joint.nodes) {
        const Node& node = tree.nodes()[i];
        lines_.push_back({node.multiplier, i, node.kind == NodeKind::revolute});
      }
    }
  }

  const TermsLayout& at() const { return at_; }
  const TreeState<T>& state() const { return state_; }

  // Brings the tree to joint positions q and velocities qd.
  void sweep(const T* q, const T* qd) { tree_.sweep(q, qd, state_); }

  // The same, and writes a row of `at().width()` numbers; joint rows are without what
  // the joint's driver has already taken out of its torque.
  void evaluate(const T* q, const T* qd, T* out) {
    evaluate_without_poses(q, qd, out);
    put_poses(out);
  }
  // The same without the sensors' poses: `pose` tells them, and `put_poses` writes them.
  void evaluate_without_poses(const T* q, const T* qd, T* out) {
    sweep(q, qd);
    std::size_t line = 0;
    for (std::size_t j = 0; j < rows_.size(); ++j) {
      const Row& row = rows_[j];
      T p = row.rotor_inertia * qd[j], n{};
      for (const std::size_t end = line + row.lines; line < end; ++line) {
        const Line& on = lines_[line];
        const Vector a = axis(on);
        add_row(on, a, p, n);
        if (row.compensated == Compensated::gravity) n += weight_on(on, a);
        put_line(out, line, on, a);
      }
      if (row.compensated == Compensated::model) p = n = T{};
      put(out, at_.joint_momentum() + j, p);
      put(out, at_.joint_bias() + j, n);
    }
    for (std::size_t s = 0; s < sensors_.size(); ++s) put_sensor(out, s);
  }

  BasicPose<T> pose(std::size_t s) const {
    const NodeState<T>& node = state_.node(sensors_[s].node);
    return {plain(node.R), plain(node.p)};
  }
  void put_poses(T* out) const {
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const SensorRow& sensor = sensors_[s];
      const NodeState<T>& node = state_.node(sensor.node);
      const std::size_t first = at_.sensor(s);
      put(out, first + TermsLayout::kPose, node.R);
      put(out, first + TermsLayout::kPose + 9, node.p);
      if (!sensor.turned) continue;
      const NodeState<T>& log = state_.node(sensor.log_node);  // -1: the world
      put(out, first + TermsLayout::kLogRotation, log.R * sensor.R_node_log);
    }
  }

  // Momentum and n-bar of joint j, without regard to what its driver compensates.
  void joint_row(std::size_t j, const T& qd, T& p, T& n) const {
    p = rows_[j].rotor_inertia * qd;
    n = T{};
    for (const Line& on : lines_) {
      if (tree_.nodes()[on.node].coordinate == static_cast<int>(j)) add_row(on, axis(on), p, n);
    }
  }

  // Momentum and n-bar of sensor s, in its own frame.
  void sensor_row(std::size_t s, BasicSpatial<T>& p, BasicSpatial<T>& n) const {
    const int i = sensors_[s].node;
    const NodeState<T>& node = state_.node(i);
    p.linear = plain(transposed_times(node.R, node.linear_momentum));
    p.angular = plain(transposed_times(node.R, node.angular_momentum));
    n.linear = plain(transposed_times(node.R, force_bias(i)));
    n.angular = plain(transposed_times(node.R, moment_bias(i)));
  }

 private:
  using Vector = typename Packing<T>::Vector;
  using Matrix = typename Packing<T>::Matrix;

  // What a joint has and, of each node that moves with it, its line of action: close together, since
  // a core's first cache has to hold all that a step of several samples works on.
  struct Row {
    double rotor_inertia;
    Compensated compensated;
    std::size_t lines;
  };
  struct Line {
    double multiplier;
    int node;
    bool turns;
  };

  Vector axis(const Line& on) const { return on.multiplier * state_.node(on.node).R.z; }

  // The wrench of gravity on all outboard of node i, about that node's origin.
  Vector weight(int i) const { return (T{} + tree_.mass_outboard(i)) * tree_.gravity(); }
  Vector weight_moment(int i) const {
    return cross(state_.node(i).first_moment, tree_.gravity());
  }

  // v x* H less that wrench.
  Vector force_bias(int i) const {
    const NodeState<T>& s = state_.node(i);
    return cross(s.angular, s.linear_momentum) - weight(i);
  }
  Vector moment_bias(int i) const {
    const NodeState<T>& s = state_.node(i);
    return cross(s.angular, s.angular_momentum) + cross(s.velocity, s.linear_momentum) -
           weight_moment(i);
  }

  // The part of a node with axis a in its joint's momentum and n-bar.
  void add_row(const Line& on, const Vector& a, T& p, T& n) const {
    const NodeState<T>& s = state_.node(on.node);
    if (on.turns) {
      p += dot(a, s.angular_momentum);
      n += dot(a, moment_bias(on.node));
    } else {
      p += dot(a, s.linear_momentum);
      n += dot(a, force_bias(on.node));
    }
  }

  // What gravity exerts along it.
  T weight_on(const Line& on, const Vector& a) const {
    return dot(a, on.turns ? weight_moment(on.node) : weight(on.node));
  }

  void put_line(T* out, std::size_t line, const Line& on, const Vector& a) const {
    const std::size_t linear = at_.subspaces() + line, angular = linear + 3 * at_.lines;
    if (on.turns) {
      put(out, linear, cross(state_.node(on.node).p, a), at_.lines);
      put(out, angular, a, at_.lines);
    } else {
      put(out, linear, a, at_.lines);
      put(out, angular, Vector{}, at_.lines);
    }
  }

  void put_sensor(T* out, std::size_t s) const {
    const SensorRow& sensor = sensors_[s];
    const NodeState<T>& node = state_.node(sensor.node);
    const std::size_t first = at_.sensor(s);
    const Vector l = node.linear_momentum, G = weight(sensor.node);
    put(out, first + TermsLayout::kMomentum, l);
    put(out, first + TermsLayout::kMomentum + 3, node.angular_momentum + cross(node.p, l));
    put(out, first + TermsLayout::kWeight, G);
    put(out, first + TermsLayout::kWeight + 3, weight_moment(sensor.node) + cross(node.p, G));
    if (!local_[s]) return;
    BasicSpatial<T> p, n;
    sensor_row(s, p, n);
    put(out, first + TermsLayout::kLocalMomentum, p.linear);
    put(out, first + TermsLayout::kLocalMomentum + 3, p.angular);
    put(out, first + TermsLayout::kLocalBias, n.linear);
    put(out, first + TermsLayout::kLocalBias + 3, n.angular);
  }

  static void put(T* out, std::size_t at, const T& value) {
    out[at] = value;
  }
  static void put(T* out, std::size_t at, const Vector& v, std::size_t stride = 1) {
    const BasicVec3<T>& a = plain(v);
    put(out, at, a.x);
    put(out, at + stride, a.y);
    put(out, at + 2 * stride, a.z);
  }
  static void put(T* out, std::size_t at, const Matrix& m) {
    put(out, at, m.x);
    put(out, at + 3, m.y);
    put(out, at + 6, m.z);
  }

  const Tree& tree_;
  const std::vector<SensorRow>& sensors_;
  std::vector<char> local_;
  std::vector<Row> rows_;    // one per joint
  std::vector<Line> lines_;  // joint by joint
  TermsLayout at_;
  TreeState<T> state_;
};

}  // namespace touchline
