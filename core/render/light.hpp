// SPDX-License-Identifier: Apache-2.0
// How surfaces and floor are lit: a key light that casts shadows, a fill and a head light.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "render/raster.hpp"
#include "render/scene.hpp"

namespace touchline::render {

// An image of one number per pixel.
struct Field {
  int width = 0, height = 0;
  std::vector<float> values;

  Field(int w, int h) : width(w), height(h), values(static_cast<std::size_t>(w) * h, 0.0f) {}
  float& at(int row, int column) { return values[static_cast<std::size_t>(row) * width + column]; }
  float at(int row, int column) const {
    return values[static_cast<std::size_t>(row) * width + column];
  }

  // Between pixels, whose middles are at halves; beyond the border its own value.
  float between(float x, float y) const {
    x = std::clamp(x - 0.5f, 0.0f, width - 1.001f);
    y = std::clamp(y - 0.5f, 0.0f, height - 1.001f);
    const int j = static_cast<int>(x), i = static_cast<int>(y);
    const float u = x - j, v = y - i;
    const float top = at(i, j) * (1 - u) + at(i, j + 1) * u;
    return top * (1 - v) + (at(i + 1, j) * (1 - u) + at(i + 1, j + 1) * u) * v;
  }

  // Three passes of a box of this radius, which is nearly a Gaussian.
  void blur(int radius) {
    const float share = 1.0f / (2 * radius + 1);
    std::vector<float> line;
    const auto smooth = [&](std::size_t start, std::size_t step, int count) {
      line.resize(count);
      double total = 0;
      for (int i = 0; i < count; ++i) line[i] = values[start + i * step];
      for (int i = 0; i < std::min(radius, count); ++i) total += line[i];
      for (int i = 0; i < count; ++i) {
        if (i + radius < count) total += line[i + radius];
        if (i - radius - 1 >= 0) total -= line[i - radius - 1];
        values[start + i * step] = static_cast<float>(total) * share;
      }
    };
    for (int pass = 0; pass < 3; ++pass) {
      for (int j = 0; j < width; ++j) smooth(j, width, height);
      for (int i = 0; i < height; ++i) smooth(static_cast<std::size_t>(i) * width, 1, width);
    }
  }
};

// Directions towards the lights and the viewer.
struct Lights {
  Vec key, fill, eye, half;

  // The key light from above and the left of the camera, the fill from its right.
  explicit Lights(const Camera& camera) {
    const Vec right = camera.axis(0), up{0, 0, 1};
    const Vec near = cross(right, up);  // level, towards the camera
    key = unit(-0.75f * right + 0.55f * near + up);
    fill = unit(0.9f * right + 0.3f * near + 0.1f * up);
    eye = -1.0f * camera.axis(2);
    half = unit(key + eye);
  }

  // Linear colour of a point: the part `lit` of the key light arrives.
  Vec shaded(Vec normal, Vec albedo, float lit) const {
    const float up = 0.5f + 0.5f * normal.z;
    const float front = std::max(dot(normal, eye), 0.0f);
    const float main = std::max(dot(normal, key), 0.0f) * lit;
    const float side = std::max(0.5f + 0.5f * dot(normal, fill), 0.0f);
    const float grazing = 0.55f + 0.45f * front;  // grazing surfaces are darker: tells the form
    float gloss = std::max(dot(normal, half), 0.0f);  // to the 48th
    gloss *= gloss;
    gloss *= gloss;
    gloss *= gloss;
    gloss *= gloss;
    gloss = gloss * gloss * gloss * lit * 0.22f;
    const auto channel = [&](float sky, float ground, float k, float f, float h, float own) {
      const float light = (sky * up + ground * (1 - up)) * grazing + main * k + side * f +
                          front * h;
      return light * own * 0.77f + gloss;
    };
    return {channel(0.56f, 0.40f, 0.86f, 0.16f, 0.16f, albedo.x),
            channel(0.60f, 0.38f, 0.83f, 0.18f, 0.16f, albedo.y),
            channel(0.66f, 0.36f, 0.78f, 0.22f, 0.16f, albedo.z)};
  }
};

// What a far light sees of triangles: where its light ends.
class ShadowMap {
 public:
  ShadowMap(const Posed& posed, Vec light, int width)
      : width_(width), height_(width, width), shade_(width / 2, width / 2) {
    const Vec helper = std::abs(light.z) < 0.9f ? Vec{0, 0, 1} : Vec{1, 0, 0};
    axes_[0] = unit(cross(helper, light));
    axes_[1] = cross(light, axes_[0]);
    axes_[2] = light;
    const Mesh& mesh = posed.mesh();
    std::vector<Vec> seen;
    seen.reserve(mesh.points.size());
    Box box;
    for (const Vec& point : mesh.points) {
      seen.push_back(turned(point));
      box.add(seen.back());
    }
    const float span = std::max(box.high.x - box.low.x, box.high.y - box.low.y);
    const float room = 0.08f * span;
    low_ = {box.low.x - room, box.low.y - room, box.low.z - 1.0f};  // heights begin at 1
    scale_ = width / (span + 2 * room);
    std::vector<Corner> corners;
    corners.reserve(seen.size());
    for (const Vec& point : seen) {
      const Vec c = point - low_;
      corners.push_back({c.x * scale_, c.y * scale_, c.z});
    }
    Raster raster(width, width);
    for (std::size_t t = 0; t < mesh.faces.size(); ++t) {
      const Face& f = mesh.faces[t];
      raster.draw(static_cast<std::uint32_t>(t), corners[f[0]], corners[f[1]], corners[f[2]]);
    }
    height_.values = raster.near();
    for (int i = 0; i < width / 2; ++i)
      for (int j = 0; j < width / 2; ++j) {
        int covered = 0;
        for (int k = 0; k < 4; ++k) covered += height_.at(2 * i + k / 2, 2 * j + k % 2) > 0.0f;
        shade_.at(i, j) = 0.25f * covered;
      }
    shade_.blur(2);
  }

  // Part of the key light that reaches a point of the surface, soft at the borders.
  float lit(Vec point, Vec normal) const {
    if (!(dot(normal, axes_[2]) > 0.0f)) return 0.0f;
    const float step = 1.5f / scale_;
    const Vec seen = turned(point + step * normal) - low_;
    const int column = static_cast<int>(std::clamp(seen.x * scale_, 4.0f, width_ - 5.0f));
    const int row = static_cast<int>(std::clamp(seen.y * scale_, 4.0f, width_ - 5.0f));
    const float height = seen.z + step;
    int total = 0;
    for (int i = -3; i <= 3; i += 2)
      for (int j = -3; j <= 3; j += 2) total += height_.at(row + i, column + j) < height;
    return total / 16.0f;
  }

  // How much of the light the triangles keep from a point below all of them.
  float shade_on_floor(Vec point) const {
    const Vec seen = turned(point) - low_;
    return shade_.between(seen.x * scale_ * 0.5f, seen.y * scale_ * 0.5f);
  }

 private:
  Vec turned(Vec v) const { return {dot(axes_[0], v), dot(axes_[1], v), dot(axes_[2], v)}; }

  int width_;
  Vec axes_[3], low_;
  float scale_ = 1;
  Field height_, shade_;
};

// How near to the floor triangles are, as a soft darkness around where they stand.
class FloorContact {
 public:
  FloorContact(const Posed& posed, float floor) : dark_(kWidth, kWidth) {
    const Mesh& mesh = posed.mesh();
    Box box;
    std::vector<std::size_t> near;
    for (std::size_t t = 0; t < mesh.faces.size(); ++t) {
      const Face& f = mesh.faces[t];
      const float lowest =
          std::min({mesh.points[f[0]].z, mesh.points[f[1]].z, mesh.points[f[2]].z});
      if (!(lowest < floor + 4 * kReach)) continue;
      near.push_back(t);
      for (const std::uint32_t corner : f) box.add(mesh.points[corner]);
    }
    if (near.empty()) return;
    const float span = std::max(box.high.x - box.low.x, box.high.y - box.low.y);
    const float room = 0.25f * span + 0.1f;
    x_ = box.low.x - room, y_ = box.low.y - room;
    scale_ = kWidth / (span + 2 * room);
    Raster raster(kWidth, kWidth);
    for (const std::size_t t : near) {
      Corner corners[3];
      for (int i = 0; i < 3; ++i) {
        const Vec c = mesh.points[mesh.faces[t][i]];
        corners[i] = {(c.x - x_) * scale_, (c.y - y_) * scale_,
                      1.0 / (1.0 + std::max(c.z - floor, 0.0f))};
      }
      raster.draw(static_cast<std::uint32_t>(t), corners[0], corners[1], corners[2]);
    }
    for (std::size_t i = 0; i < dark_.values.size(); ++i)
      if (raster.near()[i] > 0.0f)
        dark_.values[i] = std::exp(-(1.0f / raster.near()[i] - 1.0f) / kReach);
    dark_.blur(6);
  }

  // Darkness, 0 to 1, of a point of the floor.
  float at(Vec point) const {
    return dark_.between((point.x - x_) * scale_, (point.y - y_) * scale_);
  }

 private:
  static constexpr int kWidth = 192;
  static constexpr float kReach = 0.12f;  // m; what is higher above the floor darkens it little
  float x_ = 0, y_ = 0, scale_ = 1;
  Field dark_;
};

}  // namespace touchline::render
