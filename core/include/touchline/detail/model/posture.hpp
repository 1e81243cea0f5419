// SPDX-License-Identifier: Apache-2.0
// The robot at one configuration, all in world axes about the world origin: poses, the twist of
// each joint, and the momentum that a unit velocity of each joint makes. No allocation per sample.
// Theory: docs/theory.md, section 1.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/tree.hpp"

namespace touchline {

inline double dot(const Spatial& a, const Spatial& b) {
  return dot(a.linear, b.linear) + dot(a.angular, b.angular);
}

class Posture {
 public:
  Posture(const Tree& tree, std::size_t joints)
      : tree_(tree),
        state_(tree.make_state<double>()),
        states_(tree.make_state<Lanes>()),
        unit_(joints, 0.0),
        angles_(joints, all_lanes(0.0)),
        units_(angles_),
        poses_(tree.nodes().size()),
        subspaces_(tree.nodes().size()),
        twists_(tree.nodes().size()),
        momenta_(tree.nodes().size() * joints),
        momenta_at_(joints, std::nan("")) {}

  // `qd` may be null: at rest.
  void set(const double* q, const double* qd) {
    if (has_moved(q)) find_momenta(q);
    tree_.sweep(q, qd != nullptr ? qd : unit_.data(), state_);
    for (std::size_t i = 0; i < poses_.size(); ++i) place(i);
  }

  const std::vector<Node>& nodes() const { return tree_.nodes(); }
  const Pose& pose(int node) const { return poses_[node]; }
  // The twist of a unit velocity of the joint that moves this node.
  const Spatial& subspace(int node) const { return subspaces_[node]; }
  // The twist whose product with a wrench is its component along an axis of the node's frame: of
  // the force (0 to 2), of the moment about the frame's origin (3 to 5).
  Spatial axis(int node, int i) const {
    const Pose& X = poses_[node];
    const Vec3 columns[3] = {X.R.x, X.R.y, X.R.z};
    const Vec3& a = columns[i % 3];
    if (i < 3) return {a, {}};
    return {cross(X.p, a), a};
  }
  // Velocity of the body at the world origin, and its angular velocity.
  const Spatial& twist(int node) const { return twists_[node]; }
  // The momentum of a node and all outboard of it, by a unit velocity of a joint.
  const Spatial& momentum(int node, std::size_t joint) const {
    return momenta_[node * unit_.size() + joint];
  }

 private:
  static constexpr double kStill = 2e-3;  // rad or m: within it momenta do not change noticeably

  // They only weigh the noise of velocities: a part in a thousand is nothing to that.
  bool has_moved(const double* q) {
    for (std::size_t j = 0; j < unit_.size(); ++j) {
      if (!(std::fabs(q[j] - momenta_at_[j]) < kStill)) return true;
    }
    return false;
  }

  // Several joints side by side.
  void find_momenta(const double* q) {
    const std::size_t joints = unit_.size();
    for (std::size_t j = 0; j < joints; ++j) angles_[j] = all_lanes(q[j]);
    for (std::size_t first = 0; first < joints; first += kLanes) {
      const std::size_t count = std::min<std::size_t>(kLanes, joints - first);
      for (std::size_t k = 0; k < count; ++k) set_lane(units_[first + k], static_cast<int>(k), 1.0);
      tree_.sweep(angles_.data(), units_.data(), states_);
      for (std::size_t k = 0; k < count; ++k) units_[first + k] = all_lanes(0.0);
      for (std::size_t i = 0; i < poses_.size(); ++i) {
        const NodeState<Lanes>& s = states_.node(static_cast<int>(i));
        const BasicVec3<Lanes> &l = s.linear_momentum, k = s.angular_momentum + cross(s.p, l);
        for (std::size_t j = 0; j < count; ++j) {
          const int at = static_cast<int>(j);
          momenta_[i * joints + first + j] = {{lane(l.x, at), lane(l.y, at), lane(l.z, at)},
                                              {lane(k.x, at), lane(k.y, at), lane(k.z, at)}};
        }
      }
    }
    std::copy(q, q + joints, momenta_at_.begin());
  }

  void place(std::size_t i) {
    const NodeState<double>& s = state_.node(static_cast<int>(i));
    const Node& node = tree_.nodes()[i];
    poses_[i] = {plain(s.R), plain(s.p)};
    twists_[i] = {plain(s.velocity + cross(s.p, s.angular)), plain(s.angular)};
    const Vec3 axis = plain(node.multiplier * s.R.z);
    if (node.kind == NodeKind::revolute) subspaces_[i] = {cross(poses_[i].p, axis), axis};
    if (node.kind == NodeKind::prismatic) subspaces_[i] = {axis, {}};
  }

  const Tree& tree_;
  TreeState<double> state_;
  TreeState<Lanes> states_;
  std::vector<double> unit_;  // zeros: of an arm at rest
  std::vector<Lanes> angles_, units_;
  std::vector<Pose> poses_;                  // per node
  std::vector<Spatial> subspaces_, twists_;  // per node
  std::vector<Spatial> momenta_;             // per node and joint
  std::vector<double> momenta_at_;           // joint positions
};

}  // namespace touchline
