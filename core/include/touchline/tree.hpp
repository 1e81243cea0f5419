// SPDX-License-Identifier: Apache-2.0
// The robot as a tree of rigid bodies, and the O(n) recursion over it: one forward pass for poses
// and twists, one backward pass for the momentum and the weight of everything outboard.
//
// All quantities stand in world axes about the world origin, so a subtree is a plain sum.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/spatial.hpp"

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

struct NodeState {
  Pose pose;          // of the node's frame in world
  Spatial twist;      // of the body
  Spatial subspace;   // S times multiplier: the twist per unit of q[coordinate]
  Spatial momentum;   // of the body and all outboard of it
  double mass = 0.0;  // of the body and all outboard of it, and its first moment
  Vec3 first_moment;
};

class Tree {
 public:
  Tree(std::vector<Node> nodes, const Vec3& gravity)
      : nodes_(std::move(nodes)), states_(nodes_.size()), gravity_(gravity) {}

  void update(const double* q, const double* qd) {
    for (std::size_t i = 0; i < nodes_.size(); ++i) forward(i, q, qd);
    for (std::size_t i = nodes_.size(); i-- > 0;) {
      if (nodes_[i].parent >= 0) accumulate(states_[nodes_[i].parent], states_[i]);
    }
  }

  const std::vector<Node>& nodes() const { return nodes_; }
  const NodeState& state(int node) const { return states_[node]; }

  // The wrench of gravity on the node's body and all outboard of it.
  Spatial gravity_wrench(int node) const {
    const NodeState& s = states_[node];
    return {s.mass * gravity_, cross(s.first_moment, gravity_)};
  }

 private:
  void forward(std::size_t i, const double* q, const double* qd) {
    static const NodeState world{};
    const Node& node = nodes_[i];
    NodeState& s = states_[i];
    const NodeState& parent = node.parent >= 0 ? states_[node.parent] : world;
    s.pose.R = parent.pose.R * node.placement.R;
    s.pose.p = parent.pose.R * node.placement.p + parent.pose.p;
    s.twist = parent.twist;
    if (node.kind != NodeKind::fixed) move(node, s, q[node.coordinate], qd[node.coordinate]);
    add_body(node, s);
  }

  static void move(const Node& node, NodeState& s, double q, double qd) {
    const double position = node.multiplier * q + node.offset;
    const Vec3 axis = node.multiplier * s.pose.R.z;
    if (node.kind == NodeKind::revolute) {
      const double c = std::cos(position), n = std::sin(position);
      const Vec3 x = s.pose.R.x, y = s.pose.R.y;
      s.pose.R.x = c * x + n * y;
      s.pose.R.y = c * y - n * x;
      s.subspace = {cross(s.pose.p, axis), axis};
    } else {
      s.pose.p = s.pose.p + position * s.pose.R.z;
      s.subspace = {axis, {}};
    }
    s.twist = s.twist + qd * s.subspace;
  }

  static void add_body(const Node& node, NodeState& s) {
    const Vec3 com = s.pose.R * node.com + s.pose.p;
    const Vec3& w = s.twist.angular;
    s.momentum.linear = node.mass * (s.twist.linear + cross(w, com));
    s.momentum.angular = s.pose.R * (node.inertia * transposed_times(s.pose.R, w)) +
                         cross(com, s.momentum.linear);
    s.mass = node.mass;
    s.first_moment = node.mass * com;
  }

  static void accumulate(NodeState& parent, const NodeState& child) {
    parent.momentum = parent.momentum + child.momentum;
    parent.mass += child.mass;
    parent.first_moment = parent.first_moment + child.first_moment;
  }

  std::vector<Node> nodes_;
  std::vector<NodeState> states_;
  Vec3 gravity_;
};

}  // namespace touchline
