// SPDX-License-Identifier: Apache-2.0
// Points spread over the surfaces of a body, in its frame and, at a posture, in world.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/localizer/pair_view.hpp"

namespace touchline {

class BodyStarts {
 public:
  static constexpr int kMost = 40;  // room: points on a body

  // Shared out by the areas of the body's surfaces.
  BodyStarts(const LinkSurfaces& surfaces, const Body& body) {
    double total = 0.0;
    std::vector<double> areas;
    for (int s : body.surfaces) {
      areas.push_back(0.0);
      for (const Triangle& t : surfaces[s].mesh.triangles()) areas.back() += norm(cross(t.ab, t.ac));
      total += areas.back();
    }
    for (std::size_t k = 0; k < areas.size(); ++k) {
      const auto& samples = surfaces.samples(body.surfaces[k]);
      const int share = std::max(1, static_cast<int>(kMost * areas[k] / total));
      for (int i = 0; i < share && !samples.empty(); ++i) {
        if (surface_.size() == kMost) break;
        const SurfaceSample& p = samples[(2 * i + 1) * samples.size() / (2 * share)];
        surface_.push_back(body.surfaces[k]);
        own_.push_back(p);
      }
    }
    reach_ = kNear * std::sqrt(0.5 * total / std::max(1.0, 1.0 * own_.size()));
    for (auto* posed : {&points_, &normals_, &earlier_}) posed->resize(own_.size());
  }

  // To where the body is now.
  void pose(const PairView& view, int body) {
    for (std::size_t i = 0; i < own_.size(); ++i) {
      points_[i] = view.to_world(own_[i].point, body);
      normals_[i] = view.turn_to_world(own_[i].normal, body);
      earlier_[i] = view.earlier(points_[i], body);
    }
  }

  int count() const { return static_cast<int>(own_.size()); }
  // How far it is from anywhere on the body to one of them, or little farther [m].
  double reach() const { return reach_; }
  int surface(int i) const { return surface_[i]; }
  // In the frame of the node.
  const Vec3& own_point(int i) const { return own_[i].point; }
  const Vec3& own_normal(int i) const { return own_[i].normal; }
  // The triangle's place in the mesh.
  int place(int i) const { return own_[i].place; }
  const Vec3* points() const { return points_.data(); }
  const Vec3* normals() const { return normals_.data(); }
  // Where the points were when the rows felt them.
  const Vec3* earlier() const { return earlier_.data(); }

 private:
  static constexpr double kNear = 0.75;  // times the root of the area that one stands for

  double reach_ = 0.0;
  std::vector<int> surface_;
  std::vector<SurfaceSample> own_;  // in the frame of the node
  std::vector<Vec3> points_, normals_, earlier_;  // in world
};

}  // namespace touchline
