// SPDX-License-Identifier: Apache-2.0
// The triangles of a mesh that a line passes nearby: `Mesh::around` against a look at each triangle.
#include "touchline/detail/model/mesh.hpp"

#include <cstdio>
#include <map>
#include <random>

using namespace touchline;

// How far a line passes a triangle: 0 where it goes through, else beside one of its edges.
static double distance(const Triangle& t, const ForceLine& line) {
  const Vec3 n = cross(t.ab, t.ac);
  const double steep = dot(n, line.direction);
  if (steep != 0.0) {
    const Vec3 p = line.at(dot(n, t.a - line.origin) / steep) - t.a;
    const double d00 = dot(t.ab, t.ab), d01 = dot(t.ab, t.ac), d11 = dot(t.ac, t.ac);
    const double d20 = dot(p, t.ab), d21 = dot(p, t.ac), all = d00 * d11 - d01 * d01;
    const double v = (d11 * d20 - d01 * d21) / all, w = (d00 * d21 - d01 * d20) / all;
    if (v >= 0.0 && w >= 0.0 && v + w <= 1.0) return 0.0;
  }
  double least = 1e300;
  const Vec3 corners[3] = {t.a, t.a + t.ab, t.a + t.ac};
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k <= 2000; ++k) {
      const Vec3 x = corners[i] + (k / 2000.0) * (corners[(i + 1) % 3] - corners[i]) - line.origin;
      least = std::min(least, norm(x - dot(x, line.direction) * line.direction));
    }
  }
  return least;
}

int main() {
  std::mt19937 chance(1);
  const auto draw = [&] { return 2e-9 * static_cast<double>(chance() % 1000000000) - 1.0; };
  int wrong = 0, found = 0, looked = 0, kept = 0;
  for (int round = 0; round < 12; ++round) {
    std::vector<Vec3> vertices;
    std::vector<std::array<int, 3>> faces;
    for (int i = 0; i < 150; ++i) {  // small faces on a bent sheet; in every third round in all directions
      const double u = 3.0 * draw(), v = draw();
      const Vec3 middle{std::cos(u), std::sin(u), v};
      for (int c = 0; c < 3; ++c) {
        const double a = u + 0.1 * draw(), z = v + 0.1 * draw();
        const Vec3 beside{0.2 * draw(), 0.2 * draw(), 0.2 * draw()};
        vertices.push_back(round % 3 ? Vec3{std::cos(a), std::sin(a), z} : middle + beside);
      }
      faces.push_back({3 * i, 3 * i + 1, 3 * i + 2});
    }
    const Mesh mesh(vertices, faces);
    for (int i = 0; i < 15; ++i) {
      const Vec3 way{draw(), draw(), draw()};
      const ForceLine line{{draw(), draw(), draw()}, (1.0 / norm(way)) * way};
      const double limit = 0.2 + 0.2 * draw(), steep = 0.5 * draw();
      std::map<int, double> seen, weighed;
      const Vec3 one = cross(line.direction, Vec3{0.3, -0.5, 0.8});
      Beside beside{{(1.0 / norm(one)) * one, {}}, {0.0, 0.0}};
      beside.axis[1] = cross(line.direction, beside.axis[0]);
      const auto all = [](double) { return 1.0; };
      // In parts of a few boxes at a time.
      Mesh::Walk parts;
      for (int left = 0; !parts.done(); left = 1 + static_cast<int>(chance() % 9))
        mesh.around(line, beside, limit, steep, parts, left, all, [&](const SurfacePoint& p) {
          const Vec3 off = p.point - line.origin;
          const double way = norm(off - dot(off, line.direction) * line.direction);
          const double a = dot(beside.axis[0], off), b = dot(beside.axis[1], off);
          if (std::fabs(way - p.distance) > 1e-12 || seen.count(p.face)) ++wrong;
          seen[p.face] = p.distance;
          weighed[p.face] = 4.0 * a * a + 90.0 * b * b;
        });
      Mesh::Walk walk;
      int boxes = 1 << 30;
      // Weighed, none is left out whose nearest point is less far; the bound shrinks as it may.
      beside.weight[0] = 4.0, beside.weight[1] = 90.0;
      double most = 0.5, least = 1e300;
      const auto within = [&](double) { return most; };
      mesh.around(line, beside, limit, steep, walk, boxes, within, [&](const SurfacePoint& p) {
        if (seen[p.face] != p.distance) ++wrong;
        least = std::min(least, weighed[p.face]);
        weighed.erase(p.face);
        most = std::min(most, least);
        ++kept;
      });
      for (const auto& [face, square] : weighed) wrong += square < std::min(0.5, least) ? 1 : 0;
      for (const Triangle& t : mesh.triangles()) {
        const double true_one = distance(t, line), cosine = -dot(t.normal, line.direction);
        if (std::fabs(true_one - limit) < 1e-3 || std::fabs(cosine - steep) < 1e-9) continue;
        const bool wanted = true_one < limit && cosine > steep;
        ++looked;
        found += wanted ? 1 : 0;
        if (wanted != (seen.count(t.face) > 0)) ++wrong;
        else if (wanted && std::fabs(seen[t.face] - true_one) > 1e-4) ++wrong;
      }
    }
  }
  std::printf("%d %d %d %d\n", wrong, found, looked, kept);
  return 0;
}
