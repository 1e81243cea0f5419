// SPDX-License-Identifier: Apache-2.0
// The surfaces of all links at one posture: which bodies make a segment, where a line enters them,
// and points spread evenly over them. No allocation per sample.
// Theory: docs/theory.md, section 1.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/model/mesh.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

// The surface of one link, in the frame of the node that carries it.
struct LinkSurface {
  int node;
  Mesh mesh;
  bool graspable = false;  // may be pulled, along its surface too
  bool touchable = true;   // else it is only in the way
};

// A rigid body: measurements cannot tell its surfaces apart.
struct Body {
  int node;
  std::vector<int> surfaces;
};

struct SurfaceSample {
  Vec3 point, normal;  // in the frame of the node
  int place;           // of its triangle in the mesh
};

class LinkSurfaces {
 public:
  LinkSurfaces(const Observer& observer, const Posture& posture, std::vector<LinkSurface> surfaces)
      : observer_(observer), posture_(posture), surfaces_(std::move(surfaces)) {
    for (int g = 0; g < observer.row_layout().segments; ++g) bodies_.push_back(bodies_of(g));
    for (const LinkSurface& surface : surfaces_) sample(surface);
  }

  const std::vector<LinkSurface>& all() const { return surfaces_; }
  const LinkSurface& operator[](int surface) const { return surfaces_[surface]; }
  // The bodies of segment g that may be touched and can be felt.
  const std::vector<Body>& bodies(int g) const { return bodies_[g]; }
  // Points spread evenly over a surface.
  const std::vector<SurfaceSample>& samples(int surface) const { return samples_[surface]; }

  ForceLine to_node(const ForceLine& line, int node) const {
    const Pose& X = posture_.pose(node);
    return {transposed_times(X.R, line.origin - X.p), transposed_times(X.R, line.direction)};
  }
  Vec3 to_node(const Vec3& p, int node) const {
    const Pose& X = posture_.pose(node);
    return transposed_times(X.R, p - X.p);
  }
  Vec3 to_world(const Vec3& p, int node) const {
    const Pose& X = posture_.pose(node);
    return X.R * p + X.p;
  }
  Vec3 turn_to_world(const Vec3& v, int node) const { return posture_.pose(node).R * v; }
  Vec3 turn_to_node(const Vec3& v, int node) const {
    return transposed_times(posture_.pose(node).R, v);
  }

  // The point of a surface nearest to a point of the world, in world; `face` is -1 beyond `limit`.
  // `near`: the place of a triangle that may be near, or -1. `looked`: see `Mesh`.
  SurfacePoint nearest(int surface, const Vec3& target, double limit, int near, int& looked) const {
    const int node = surfaces_[surface].node;
    const Mesh& mesh = surfaces_[surface].mesh;
    return in_world(mesh.nearest_to_point(to_node(target, node), limit, near, looked), node);
  }

  // The same for a line.
  SurfacePoint nearest(int surface, const ForceLine& line, double limit, int near,
                       int& looked) const {
    const int node = surfaces_[surface].node;
    const Mesh& mesh = surfaces_[surface].mesh;
    return in_world(mesh.nearest_to_line(to_node(line, node), limit, near, looked), node);
  }

  // Calls `visit(SurfacePoint)`, in world, for the point nearest to a line of each triangle that is
  // nearer to it than `limit` and stands against it: at a cosine above `steep`. Left out is what is
  // beside it by a weighed square of `most(cosine)` or more. `walk`, `left`: see `Mesh`.
  template <class Most, class Visit>
  void around(int surface, const ForceLine& line, const Beside& beside, double limit, double steep,
              Mesh::Walk& walk, int& left, Most&& most, Visit&& visit) const {
    const int node = surfaces_[surface].node;
    const Beside own{{turn_to_node(beside.axis[0], node), turn_to_node(beside.axis[1], node)},
                     beside.weight};
    surfaces_[surface].mesh.around(to_node(line, node), own, limit, steep, walk, left, most,
                                   [&](const SurfacePoint& p) { visit(in_world(p, node)); });
  }

  // Calls `visit(surface, point, normal, t)` for each entry of a line into a surface; where it is
  // graspable, for each exit too.
  template <class Visit>
  void entries(int surface, const ForceLine& line, Visit&& visit) const {
    const int node = surfaces_[surface].node;
    surfaces_[surface].mesh.crossings(to_node(line, node), [&](const Crossing& c) {
      const Vec3 normal = turn_to_world(c.normal, node);
      if (surfaces_[surface].graspable || dot(normal, line.direction) < 0.0)
        visit(surface, line.at(c.t), normal, c.t);
    });
  }

 private:
  static constexpr int kSamples = 64;  // room: points per surface

  SurfacePoint in_world(SurfacePoint p, int node) const {
    p.point = to_world(p.point, node);
    p.normal = turn_to_world(p.normal, node);
    return p;
  }

  std::vector<Body> bodies_of(int g) const {
    std::vector<Body> bodies;
    for (std::size_t i = 0; i < surfaces_.size(); ++i) {
      const int node = surfaces_[i].node;
      if (segment_of(node) != g || !surfaces_[i].touchable) continue;
      auto found = std::find_if(bodies.begin(), bodies.end(),
                                [node](const Body& b) { return b.node == node; });
      if (found == bodies.end()) {
        bodies.push_back({node, {}});
        found = bodies.end() - 1;
      }
      found->surfaces.push_back(static_cast<int>(i));
    }
    return bodies;
  }

  // Segment of a node; -1 for what cannot be felt.
  int segment_of(int node) const {
    const auto& segments = observer_.layout().segments;
    bool moves = false;
    for (int n = node; n >= 0; n = posture_.nodes()[n].parent) {
      for (std::size_t g = 0; g < segments.size(); ++g) {
        if (segments[g].sensor >= 0 && observer_.sensors()[segments[g].sensor].node == n)
          return static_cast<int>(g);
      }
      moves = moves || posture_.nodes()[n].kind != NodeKind::fixed;
    }
    if (!moves || segments.back().sensor >= 0) return -1;
    return static_cast<int>(segments.size()) - 1;
  }

  void sample(const LinkSurface& surface) {
    samples_.emplace_back();
    const auto& triangles = surface.mesh.triangles();
    double total = 0.0;
    for (const Triangle& t : triangles) total += norm(cross(t.ab, t.ac));
    double passed = 0.0, next = 0.5 * total / kSamples, u = 0.0, v = 0.0;
    for (const Triangle& t : triangles) {
      for (passed += norm(cross(t.ab, t.ac)); next < passed; next += total / kSamples) {
        u = std::fmod(u + 0.7548776662466927, 1.0);
        v = std::fmod(v + 0.5698402909980532, 1.0);
        const bool inside = u + v <= 1.0;
        samples_.back().push_back(
            {t.a + (inside ? u : 1.0 - u) * t.ab + (inside ? v : 1.0 - v) * t.ac, t.normal,
             static_cast<int>(&t - triangles.data())});
      }
    }
  }

  const Observer& observer_;
  const Posture& posture_;
  std::vector<LinkSurface> surfaces_;
  std::vector<std::vector<Body>> bodies_;            // per segment
  std::vector<std::vector<SurfaceSample>> samples_;  // per surface
};

}  // namespace touchline
