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
#include <type_traits>
#include <utility>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/packed.hpp"
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
  using Vector = typename Packing<T>::Vector;
  using Matrix = typename Packing<T>::Matrix;

  Matrix R;          // of the node's frame in world
  Vector p;          // its origin
  Vector arm;        // from the parent's origin to it
  Vector velocity;   // of the body at the origin
  Vector angular;    // velocity
  Vector linear_momentum, angular_momentum;  // of the body and all outboard of it
  Vector first_moment;                       // likewise
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
  double mass_outboard(int node) const { return bodies_[node].mass_outboard; }

 private:
  template <class T>
  using Vector = typename Packing<T>::Vector;
  template <class T>
  using Matrix = typename Packing<T>::Matrix;

  // A vector in a parent's frame. Most lie along one of its axes, which saves a product: `axis` is 0
  // to 2 then and `v.x` is the signed length; otherwise `axis` is -1.
  struct Direction {
    Vec3 v;
    int axis;
  };

  // What the recursion needs of a node, close together: a core's first cache has to hold all that a
  // step of several samples works on. The inertia is about the origin of the node's frame.
  struct Body {
    Packing<double>::Matrix inertia;
    Direction arm, x, y, z;  // origin and axes of its frame in the parent's, at position 0
    Vec3 first_moment;
    double mass, mass_outboard;  // of the body; with all outboard of it
    double multiplier, offset;
    int node, parent, coordinate;
    NodeKind kind;
    bool carried;  // is there a joint inboard of it?
  };

  static Direction direction(const Vec3& v);
  static Body make_body(int i, const Node& node);
  bool can_move(int i) const;
  template <class T>
  void find_positions(const T* q, T* positions) const;
  template <class T>
  static Vector<T> turned(const Matrix<T>& R, const Direction& d);
  template <class T>
  static void place(const Body& body, const NodeState<T>& parent, NodeState<T>& s);
  template <class T>
  static void turn(const Body& body, const T& sine, const T& cosine, const T& qd, NodeState<T>& s);
  template <class T>
  static void slide(const Body& body, const T& position, const T& qd, NodeState<T>& s);
  template <class T>
  static void add_body(const Body& body, NodeState<T>& s);
  template <class T>
  static void pass_inboard(const Body& body, const NodeState<T>& s, NodeState<T>& parent);

  std::vector<Node> nodes_;
  std::vector<Body> bodies_;  // one per node
  std::vector<int> moving_;   // nodes with a joint of their own
  Vec3 gravity_;
};

inline Tree::Tree(std::vector<Node> nodes, const Vec3& gravity)
    : nodes_(std::move(nodes)), gravity_(gravity) {
  for (int i = 0; i < static_cast<int>(nodes_.size()); ++i) {
    if (nodes_[i].parent >= i) throw std::invalid_argument("a parent must come first");
    bodies_.push_back(make_body(i, nodes_[i]));
    bodies_.back().carried = can_move(i);
    if (nodes_[i].kind != NodeKind::fixed) moving_.push_back(i);
  }
  for (std::size_t i = nodes_.size(); i-- > 0;) {
    const int parent = nodes_[i].parent;
    if (parent >= 0) bodies_[parent].mass_outboard += bodies_[i].mass_outboard;
  }
}

inline Tree::Direction Tree::direction(const Vec3& v) {
  if (v.y == 0.0 && v.z == 0.0) return {{v.x, 0.0, 0.0}, 0};
  if (v.z == 0.0 && v.x == 0.0) return {{v.y, 0.0, 0.0}, 1};
  if (v.x == 0.0 && v.y == 0.0) return {{v.z, 0.0, 0.0}, 2};
  return {v, -1};
}

inline Tree::Body Tree::make_body(int i, const Node& node) {
  const Vec3& c = node.com;
  const double m = node.mass, cc = dot(c, c);
  const Mat3 about_origin{node.inertia.x + m * (Vec3{cc, 0.0, 0.0} - c.x * c),
                          node.inertia.y + m * (Vec3{0.0, cc, 0.0} - c.y * c),
                          node.inertia.z + m * (Vec3{0.0, 0.0, cc} - c.z * c)};
  const Mat3& R = node.placement.R;
  return {about_origin, direction(node.placement.p), direction(R.x), direction(R.y), direction(R.z),
          m * c, m, m, node.multiplier, node.offset, i, node.parent, node.coordinate, node.kind, false};
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
  const std::size_t room = (moving_.size() + kLanes - 1) / kLanes * kLanes;
  for (auto* of : {&state.positions, &state.sines, &state.cosines}) of->resize(room);
  for (const Body& body : bodies_) {
    if (!body.carried) place(body, state.node(body.parent), state.node(body.node));
  }
  return state;
}

// Calls cost as much as the work in them: all are inlined.
template <class T>
#if defined(__GNUC__)
__attribute__((flatten))
#endif
void Tree::sweep(const T* q, const T* qd, TreeState<T>& state) const {
  find_positions(q, state.positions.data());
  sincos(state.positions.data(), moving_.size(), state.sines.data(), state.cosines.data());
  NodeState<T>* const nodes = state.nodes.data() + 1;
  const T *sine = state.sines.data(), *cosine = state.cosines.data(), *position = state.positions.data();
  for (const Body& body : bodies_) {
    NodeState<T>& s = nodes[body.node];
    if (!body.carried) {
      s.linear_momentum = s.angular_momentum = {};
      s.first_moment = s.R * body.first_moment;
      continue;
    }
    place(body, nodes[body.parent], s);
    if (body.kind == NodeKind::revolute) turn(body, *sine, *cosine, qd[body.coordinate], s);
    if (body.kind == NodeKind::prismatic) slide(body, *position, qd[body.coordinate], s);
    if (body.kind != NodeKind::fixed) ++sine, ++cosine, ++position;
    add_body(body, s);
  }
  for (std::size_t i = bodies_.size(); i-- > 0;) {
    if (bodies_[i].parent >= 0) pass_inboard(bodies_[i], nodes[i], nodes[bodies_[i].parent]);
  }
}

// Positions of one instant go to memory several at once, as they are read from there: what waits for
// single numbers to be written first waits long.
template <class T>
void Tree::find_positions(const T* q, T* positions) const {
  const auto position = [&](std::size_t m) {
    const Body& body = bodies_[moving_[m]];
    return body.multiplier * q[body.coordinate] + body.offset;
  };
  if constexpr (std::is_same_v<T, double>) {
    for (std::size_t m = 0; m < moving_.size(); m += kLanes) {
      Lanes some{};
      for (int k = 0; k < kLanes; ++k) {
        if (m + k < moving_.size()) set_lane(some, k, position(m + k));
      }
      store_lanes(some, positions + m);
    }
  } else {
    for (std::size_t m = 0; m < moving_.size(); ++m) positions[m] = position(m);
  }
}

template <class T>
Tree::Vector<T> Tree::turned(const Matrix<T>& R, const Direction& d) {
  if (d.axis < 0) return R * d.v;
  return d.v.x * (d.axis == 0 ? R.x : d.axis == 1 ? R.y : R.z);
}

// Pose and velocity of a fixed node, or as if its joint stood still at zero.
template <class T>
void Tree::place(const Body& body, const NodeState<T>& parent, NodeState<T>& s) {
  const Vector<T> arm = turned<T>(parent.R, body.arm);
  s.arm = arm;
  s.R = {turned<T>(parent.R, body.x), turned<T>(parent.R, body.y), turned<T>(parent.R, body.z)};
  s.p = parent.p + arm;
  s.velocity = parent.velocity + cross(parent.angular, arm);
  s.angular = parent.angular;
}

template <class T>
void Tree::turn(const Body& body, const T& sine, const T& cosine, const T& qd, NodeState<T>& s) {
  const Vector<T> x = s.R.x, y = s.R.y;
  s.R.x = cosine * x + sine * y;
  s.R.y = cosine * y - sine * x;
  s.angular += (body.multiplier * qd) * s.R.z;
}

template <class T>
void Tree::slide(const Body& body, const T& position, const T& qd, NodeState<T>& s) {
  const Vector<T> shift = position * s.R.z;
  s.arm += shift;
  s.p += shift;
  s.velocity += cross(s.angular, shift) + (body.multiplier * qd) * s.R.z;
}

template <class T>
void Tree::add_body(const Body& body, NodeState<T>& s) {
  const Vector<T> h = s.R * body.first_moment;
  s.first_moment = h;
  s.linear_momentum = body.mass * s.velocity + cross(s.angular, h);
  s.angular_momentum =
      s.R * (body.inertia * transposed_times(s.R, s.angular)) + cross(h, s.velocity);
}

template <class T>
void Tree::pass_inboard(const Body& body, const NodeState<T>& s, NodeState<T>& parent) {
  parent.linear_momentum += s.linear_momentum;
  parent.angular_momentum += s.angular_momentum + cross(s.arm, s.linear_momentum);
  parent.first_moment += s.first_moment + body.mass_outboard * s.arm;
}

}  // namespace touchline
