// SPDX-License-Identifier: Apache-2.0
// What pictures are drawn of: a robot's triangles as it stands, and the camera.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <unordered_map>
#include <utility>
#include <vector>

namespace touchline::render {

struct Vec {
  float x = 0, y = 0, z = 0;
};

inline Vec operator+(Vec a, Vec b) { return {a.x + b.x, a.y + b.y, a.z + b.z}; }
inline Vec operator-(Vec a, Vec b) { return {a.x - b.x, a.y - b.y, a.z - b.z}; }
inline Vec operator*(float s, Vec a) { return {s * a.x, s * a.y, s * a.z}; }
inline float dot(Vec a, Vec b) { return a.x * b.x + a.y * b.y + a.z * b.z; }
inline Vec cross(Vec a, Vec b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Vec unit(Vec a) { return (1.0f / std::sqrt(dot(a, a))) * a; }

struct Box {
  Vec low{1e30f, 1e30f, 1e30f}, high{-1e30f, -1e30f, -1e30f};
  void add(Vec p) {
    low = {std::min(low.x, p.x), std::min(low.y, p.y), std::min(low.z, p.z)};
    high = {std::max(high.x, p.x), std::max(high.y, p.y), std::max(high.z, p.z)};
  }
};

// A pose, rotation row by row.
struct Pose {
  Vec rows[3];
  Vec origin;
  Vec turned(Vec v) const { return {dot(rows[0], v), dot(rows[1], v), dot(rows[2], v)}; }
  Vec moved(Vec v) const { return turned(v) + origin; }
};

struct Triangle {
  Vec corner[3];
};

// Numbers of the points at a triangle's corners.
using Face = std::array<std::uint32_t, 3>;

// Points and the faces between them; a point is moved and projected once for all of its faces.
struct Mesh {
  std::vector<Vec> points;
  std::vector<Face> faces;

  explicit Mesh(const std::vector<Triangle>& triangles) {
    struct Hash {
      std::size_t operator()(const std::array<float, 3>& v) const {
        std::size_t h = 0;
        for (const float x : v) h = h * 1000003u + std::hash<float>()(x);
        return h;
      }
    };
    std::unordered_map<std::array<float, 3>, std::uint32_t, Hash> known;
    known.reserve(triangles.size());
    for (const Triangle& t : triangles) {
      Face face;
      for (int i = 0; i < 3; ++i) {
        const Vec c = t.corner[i];
        const auto [at, added] =
            known.emplace(std::array<float, 3>{c.x, c.y, c.z}, static_cast<std::uint32_t>(points.size()));
        if (added) points.push_back(c);
        face[i] = at->second;
      }
      faces.push_back(face);
    }
  }
  Mesh() = default;
};

// A drawn shape of a link, in the link's frame. Balls are around each triangle and all of them.
struct Piece {
  Mesh mesh;
  std::vector<Triangle> normals;
  bool closed = false;  // its back cannot be seen
  std::vector<Vec> middles;
  std::vector<float> radii;
  Vec middle;
  float radius = 0;

  Piece(const std::vector<Triangle>& corners, std::vector<Triangle> own, bool is_closed)
      : mesh(corners), normals(std::move(own)), closed(is_closed) {
    for (const Triangle& t : corners) {
      const Vec m = (1.0f / 3.0f) * (t.corner[0] + t.corner[1] + t.corner[2]);
      float most = 0;
      for (const Vec& c : t.corner) most = std::max(most, dot(c - m, c - m));
      middles.push_back(m);
      radii.push_back(1.001f * std::sqrt(most));
    }
    Box box;
    for (const Vec& p : mesh.points) box.add(p);
    middle = 0.5f * (box.low + box.high);
    for (const Vec& p : mesh.points) radius = std::max(radius, dot(p - middle, p - middle));
    radius = 1.001f * std::sqrt(radius);
  }
};

// The pieces where they stand.
class Posed {
 public:
  Posed(const std::vector<Piece>& pieces, std::vector<Pose> poses)
      : pieces_(&pieces), poses_(std::move(poses)) {
    for (std::size_t p = 0; p < pieces.size(); ++p) {
      const Mesh& own = pieces[p].mesh;
      const auto first = static_cast<std::uint32_t>(mesh_.points.size());
      begins_.push_back(mesh_.faces.size());
      for (const Vec& point : own.points) {
        mesh_.points.push_back(poses_[p].moved(point));
        box_.add(mesh_.points.back());
      }
      for (const Face& f : own.faces) mesh_.faces.push_back({f[0] + first, f[1] + first, f[2] + first});
      part_.insert(part_.end(), own.faces.size(), static_cast<std::uint16_t>(p));
    }
    all_closed_ = std::all_of(pieces.begin(), pieces.end(), [](const Piece& p) { return p.closed; });
  }

  const Mesh& mesh() const { return mesh_; }
  std::size_t part(std::size_t triangle) const { return part_[triangle]; }
  bool closed(std::size_t triangle) const { return (*pieces_)[part_[triangle]].closed; }
  bool all_closed() const { return all_closed_; }
  const Box& box() const { return box_; }

  // A normal at a corner, in world.
  Vec normal(std::size_t triangle, int corner) const {
    const std::size_t p = part_[triangle];
    return poses_[p].turned((*pieces_)[p].normals[triangle - begins_[p]].corner[corner]);
  }

  // Whether rays from near a point, `off` before it, meet no triangle, after Moeller and
  // Trumbore (1997).
  std::vector<bool> sees(Vec point, const std::vector<Vec>& directions, float off) const {
    std::vector<bool> seen(directions.size(), true);
    for (std::size_t p = 0; p < pieces_->size(); ++p) {
      const Piece& piece = (*pieces_)[p];
      const Pose& pose = poses_[p];
      const Vec away = pose.moved(piece.middle) - point;
      for (std::size_t d = 0; d < directions.size(); ++d)
        if (seen[d] && near(away, piece.radius, directions[d]))
          seen[d] = !hit(piece, pose, point, directions[d], off, begins_[p]);
    }
    return seen;
  }

 private:
  static bool near(Vec away, float radius, Vec direction) {
    const float along = dot(away, direction);
    return along > -radius && along * along >= dot(away, away) - radius * radius;
  }

  bool hit(const Piece& piece, const Pose& pose, Vec point, Vec direction, float off,
           std::size_t begin) const {
    // In the piece's own frame, where the balls are.
    const Vec q = point - pose.origin;
    const Vec start = q.x * Vec{pose.rows[0].x, pose.rows[0].y, pose.rows[0].z} +
                      q.y * Vec{pose.rows[1].x, pose.rows[1].y, pose.rows[1].z} +
                      q.z * Vec{pose.rows[2].x, pose.rows[2].y, pose.rows[2].z};
    const Vec own = direction.x * pose.rows[0] + direction.y * pose.rows[1] +
                    direction.z * pose.rows[2];
    for (std::size_t t = 0; t < piece.middles.size(); ++t)
      if (near(piece.middles[t] - start, piece.radii[t], own) &&
          meets(mesh_.faces[begin + t], point + off * direction, direction))
        return true;
    return false;
  }

  bool meets(const Face& face, Vec from, Vec direction) const {
    struct Wide {
      double x, y, z;
    };
    const auto wide = [](Vec v) { return Wide{v.x, v.y, v.z}; };
    const auto minus = [](Wide a, Wide b) { return Wide{a.x - b.x, a.y - b.y, a.z - b.z}; };
    const auto times = [](Wide a, Wide b) {
      return Wide{a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
    };
    const auto inner = [](Wide a, Wide b) { return a.x * b.x + a.y * b.y + a.z * b.z; };
    const Wide a = wide(mesh_.points[face[0]]), u = minus(wide(mesh_.points[face[1]]), a),
               v = minus(wide(mesh_.points[face[2]]), a), d = wide(direction);
    const Wide p = times(d, v);
    const double scale = inner(u, p);
    if (std::abs(scale) < 1e-15) return false;
    const Wide s = minus(wide(from), a), q = times(s, u);
    const double x = inner(s, p) / scale, y = inner(d, q) / scale;
    return x >= 0 && y >= 0 && x + y <= 1 && inner(v, q) / scale > 0;
  }

  const std::vector<Piece>* pieces_;
  std::vector<Pose> poses_;
  Mesh mesh_;
  Box box_;
  std::vector<std::uint16_t> part_;
  std::vector<std::size_t> begins_;
  bool all_closed_ = false;
};

// A pinhole camera; axes are image right, image down, forward.
struct Camera {
  double eye[3];
  double axes[3][3];
  double focal;  // in heights of the image

  // From pixel to ray of unit depth, in world.
  Vec ray(double column, double row, int width, int height) const {
    const double scale = 1.0 / (focal * height);
    const double x = (column + 0.5 - 0.5 * width) * scale, y = (row + 0.5 - 0.5 * height) * scale;
    return {static_cast<float>(axes[0][0] * x + axes[1][0] * y + axes[2][0]),
            static_cast<float>(axes[0][1] * x + axes[1][1] * y + axes[2][1]),
            static_cast<float>(axes[0][2] * x + axes[1][2] * y + axes[2][2])};
  }
  Vec axis(int i) const {
    return {static_cast<float>(axes[i][0]), static_cast<float>(axes[i][1]),
            static_cast<float>(axes[i][2])};
  }
  Vec place() const {
    return {static_cast<float>(eye[0]), static_cast<float>(eye[1]), static_cast<float>(eye[2])};
  }
};

}  // namespace touchline::render
