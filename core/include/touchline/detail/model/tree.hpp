// SPDX-License-Identifier: Apache-2.0
// The robot as a tree of rigid bodies, and the O(n) recursion over it: one forward pass for poses
// and velocities, one backward pass for the momentum of everything outboard.
//
// All vectors stand in world axes. Velocities, momenta and first moments of a node are about the
// origin of that node's own frame: the shortest formulas for joint rows.
// Theory: docs/theory.md, section 1.2.
#pragma once

#include <cstddef>
#include <stdexcept>
#include <utility>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/sincos.hpp"
#include "touchline/detail/model/spatial.hpp"

namespace touchline {

enum class NodeKind { fixed, revolute, prismatic };

// A rigid body on a joint (about or along the z axis of its own frame) or on a sensor (fixed).
struct Node {
  int parent = -1;  // index of the inboard node, always smaller than the own; -1: the world
  NodeKind kind = NodeKind::fixed;
  Pose placement;  // of this frame in the parent's, at position 0
  double mass = 0.0;
  Vec3 com;      // in this frame
  Mat3 inertia;  // about the centre of mass, in this frame
  int coordinate = -1;  // position = multiplier * q[coordinate] + offset
  double multiplier = 1.0;
  double offset = 0.0;
};

template <class T>
struct NodeState {
  BasicMat3<T> R;          // of the node's frame in world
  BasicVec3<T> p;          // its origin
  BasicVec3<T> arm;        // from the parent's origin to it
  BasicVec3<T> velocity;   // of the body at the origin
  BasicVec3<T> angular;    // velocity
  BasicVec3<T> linear_momentum, angular_momentum;  // of the body and all outboard of it
  BasicVec3<T> first_moment;                       // likewise
};

// The states of all nodes at one instant, or at several side by side.
template <class T>
struct TreeState {
  std::vector<NodeState<T>> nodes;           // the world, then one per node
  std::vector<T> positions, sines, cosines;  // of the moving nodes, in their order

  const NodeState<T>& node(int i) const { return nodes[i + 1]; }
  NodeState<T>& node(int i) { return nodes[i + 1]; }
};

class Tree {
 public:
  Tree(std::vector<Node> nodes, const Vec3& gravity);

  // Room for `sweep`; the nodes that cannot move get their poses here, once and for all.
  template <class T>
  TreeState<T> make_state() const;

  // Brings all states to joint positions q and velocities qd.
  template <class T>
  void sweep(const T* q, const T* qd, TreeState<T>& state) const;

  const std::vector<Node>& nodes() const { return nodes_; }
  const Vec3& gravity() const { return gravity_; }
  double mass_outboard(int node) const { return constants_[node].mass_outboard; }

 private:
  // What follows from a node's inertia, about the origin of its frame.
  struct Constants {
    Vec3 first_moment;
    Mat3 inertia;
    double mass_outboard;  // of the body and all outboard of it
  };

  bool can_move(int i) const;
  template <class T>
  void place(int i, TreeState<T>& state) const;
  template <class T>
  void reach(int i, const NodeState<T>& parent, NodeState<T>& s) const;
  template <class T>
  void turn(int i, const T& sine, const T& cosine, const T& qd, TreeState<T>& state) const;
  template <class T>
  void slide(int i, const T& position, const T& qd, NodeState<T>& s) const;
  template <class T>
  void add_body(int i, NodeState<T>& s) const;
  template <class T>
  void pass_inboard(int i, TreeState<T>& state) const;

  std::vector<Node> nodes_;
  std::vector<Constants> constants_;
  std::vector<int> resting_, carried_;  // nodes without and with a joint inboard of them
  std::vector<int> moving_;             // nodes with a joint of their own
  Vec3 gravity_;
};

inline Tree::Tree(std::vector<Node> nodes, const Vec3& gravity)
    : nodes_(std::move(nodes)), gravity_(gravity) {
  for (int i = 0; i < static_cast<int>(nodes_.size()); ++i) {
    const Node& node = nodes_[i];
    if (node.parent >= i) throw std::invalid_argument("a parent must come first");
    const Vec3& c = node.com;
    const double m = node.mass, cc = dot(c, c);
    const Mat3 about_origin{node.inertia.x + m * (Vec3{cc, 0.0, 0.0} - c.x * c),
                            node.inertia.y + m * (Vec3{0.0, cc, 0.0} - c.y * c),
                            node.inertia.z + m * (Vec3{0.0, 0.0, cc} - c.z * c)};
    constants_.push_back({m * c, about_origin, m});
    (can_move(i) ? carried_ : resting_).push_back(i);
    if (node.kind != NodeKind::fixed) moving_.push_back(i);
  }
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    const int parent = nodes_[i].parent;
    if (parent >= 0) constants_[parent].mass_outboard += constants_[i].mass_outboard;
  }
}

inline bool Tree::can_move(int i) const {
  for (; i >= 0; i = nodes_[i].parent) {
    if (nodes_[i].kind != NodeKind::fixed) return true;
  }
  return false;
}

template <class T>
TreeState<T> Tree::make_state() const {
  TreeState<T> state;
  state.nodes.resize(nodes_.size() + 1);
  state.nodes[0].R = identity<T>();
  for (auto* of : {&state.positions, &state.sines, &state.cosines}) of->resize(moving_.size());
  for (int i : resting_) place(i, state);
  return state;
}

// Calls cost as much as the work in them: all are inlined.
template <class T>
#if defined(__GNUC__)
__attribute__((flatten))
#endif
void Tree::sweep(const T* q, const T* qd, TreeState<T>& state) const {
  for (std::size_t m = 0; m < moving_.size(); ++m) {
    const Node& node = nodes_[moving_[m]];
    state.positions[m] = node.multiplier * q[node.coordinate] + node.offset;
  }
  sincos(state.positions.data(), moving_.size(), state.sines.data(), state.cosines.data());
  for (int i : resting_) {
    NodeState<T>& s = state.node(i);
    s.linear_momentum = s.angular_momentum = {};
    s.first_moment = s.R * constants_[i].first_moment;
  }
  std::size_t m = 0;
  for (int i : carried_) {
    const Node& node = nodes_[i];
    if (node.kind == NodeKind::revolute) {
      turn(i, state.sines[m], state.cosines[m], qd[node.coordinate], state);
    } else {
      place(i, state);
      if (node.kind == NodeKind::prismatic)
        slide(i, state.positions[m], qd[node.coordinate], state.node(i));
    }
    if (node.kind != NodeKind::fixed) ++m;
  }
  for (int i : carried_) add_body(i, state.node(i));
  for (std::size_t i = nodes_.size(); i-- > 0;) pass_inboard(static_cast<int>(i), state);
}

// Pose and velocity of a fixed node, or as if its joint stood still at zero.
template <class T>
void Tree::place(int i, TreeState<T>& state) const {
  const NodeState<T>& parent = state.node(nodes_[i].parent);
  NodeState<T>& s = state.node(i);
  s.R = parent.R * nodes_[i].placement.R;
  s.angular = parent.angular;
  reach(i, parent, s);
}

template <class T>
void Tree::reach(int i, const NodeState<T>& parent, NodeState<T>& s) const {
  const BasicVec3<T> arm = parent.R * nodes_[i].placement.p;
  s.arm = arm;
  s.p = parent.p + arm;
  s.velocity = parent.velocity + cross(parent.angular, arm);
}

template <class T>
void Tree::turn(int i, const T& sine, const T& cosine, const T& qd, TreeState<T>& state) const {
  const NodeState<T>& parent = state.node(nodes_[i].parent);
  NodeState<T>& s = state.node(i);
  reach(i, parent, s);
  const BasicVec3<T> z = parent.R * nodes_[i].placement.R.z;
  s.R.z = z;
  s.angular = parent.angular + (nodes_[i].multiplier * qd) * z;
  const BasicVec3<T> x = parent.R * nodes_[i].placement.R.x;
  const BasicVec3<T> y = parent.R * nodes_[i].placement.R.y;
  s.R.x = cosine * x + sine * y;
  s.R.y = cosine * y - sine * x;
}

template <class T>
void Tree::slide(int i, const T& position, const T& qd, NodeState<T>& s) const {
  const BasicVec3<T> shift = position * s.R.z;
  s.arm += shift;
  s.p += shift;
  s.velocity += cross(s.angular, shift) + (nodes_[i].multiplier * qd) * s.R.z;
}

template <class T>
void Tree::add_body(int i, NodeState<T>& s) const {
  const Constants& body = constants_[i];
  const BasicVec3<T> h = s.R * body.first_moment;
  s.first_moment = h;
  s.linear_momentum = nodes_[i].mass * s.velocity + cross(s.angular, h);
  s.angular_momentum =
      s.R * (body.inertia * transposed_times(s.R, s.angular)) + cross(h, s.velocity);
}

template <class T>
void Tree::pass_inboard(int i, TreeState<T>& state) const {
  const NodeState<T>& s = state.node(i);
  NodeState<T>& parent = state.node(nodes_[i].parent);
  parent.linear_momentum += s.linear_momentum;
  parent.angular_momentum += s.angular_momentum + cross(s.arm, s.linear_momentum);
  parent.first_moment += s.first_moment + constants_[i].mass_outboard * s.arm;
}

}  // namespace touchline
