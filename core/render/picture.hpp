// SPDX-License-Identifier: Apache-2.0
// A picture being drawn: what its samples show, and one layer over the other.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "render/light.hpp"
#include "render/raster.hpp"
#include "render/scene.hpp"

namespace touchline::render {

// What a sample shows.
struct Seen {
  std::uint32_t sample;
  std::uint32_t triangle;
  float depth;
  Vec normal, position;
};

// Triangles drawn over the robot, fainter where it hides them.
struct Overlay {
  Mesh mesh;
  std::vector<Triangle> normals;
  Vec colour;  // linear
  float opacity = 1;
};

class Picture {
 public:
  static constexpr int kFine = 2;           // samples per pixel, along each side
  static constexpr double kNearest = 0.02;  // m; what comes nearer to the camera is not drawn
  static constexpr float kHidden = 0.30f;   // opacity of what the arm hides, by that of the rest

  Picture(const Posed& posed, const Camera& camera, int width, int height)
      : posed_(&posed), camera_(camera), width_(width), height_(height) {
    const auto normal = [&](std::size_t t, int i) { return posed.normal(t, i); };
    seen_ = see(posed.mesh(), normal, [&](std::size_t t) { return posed.closed(t); },
                !posed.all_closed());
  }

  const std::vector<Seen>& seen() const { return seen_; }
  const Posed& posed() const { return *posed_; }

  // The samples' colours: albedo by sample, linear.
  template <class Albedo>
  void shade(const Albedo& albedo, int map) {
    const Lights lights(camera_);
    shadow_.clear();
    shadow_.emplace_back(*posed_, lights.key, map);
    colours_.resize(seen_.size());
    for (std::size_t i = 0; i < seen_.size(); ++i) {
      const Seen& s = seen_[i];
      colours_[i] = lights.shaded(s.normal, albedo(i), shadow_[0].lit(s.position, s.normal));
    }
  }

  // Begins with one colour all over.
  void paper(Vec colour) { light_.assign(pixels(), colour); }

  // Begins with a calm gradient and the robot's shadow on the floor.
  void ground(Vec sky, Vec ground) {
    light_.resize(pixels());
    const float floor = posed_->box().low.z;
    const FloorContact foot(*posed_, floor);
    const int wide = (width_ + 1) / 2, high = (height_ + 1) / 2;  // shadows are soft
    Field dark(wide, high);
    for (int i = 0; i < high; ++i)
      for (int j = 0; j < wide; ++j) {
        const Vec ray = camera_.ray(j, i, wide, high);
        if (!(ray.z < -1e-3f)) continue;
        const Vec point = camera_.place() + ((floor - camera_.place().z) / ray.z) * ray;
        dark.at(i, j) = 1 - (1 - 0.34f * shadow_[0].shade_on_floor(point)) *
                                (1 - 0.45f * foot.at(point));
      }
    for (int i = 0; i < height_; ++i) {
      const float fade = std::pow(height_ > 1 ? i / (height_ - 1.0f) : 0.0f, 1.2f);
      const Vec row = (1 - fade) * sky + fade * ground;
      for (int j = 0; j < width_; ++j) {
        const float d = doubled(dark, i, j);
        light_[static_cast<std::size_t>(i) * width_ + j] = {
            row.x * (1 - d), row.y * (1 - 0.97f * d), row.z * (1 - 0.92f * d)};
      }
    }
  }

  // Puts what was seen and shaded before the background.
  void put() {
    blend(seen_, [&](std::size_t i) { return colours_[i]; }, [](std::size_t) { return 1.0f; });
  }

  void put_over(const Overlay& overlay) {
    if (hidden_.empty()) {
      hidden_.assign(pixels() * kFine * kFine, std::numeric_limits<float>::infinity());
      for (const Seen& s : seen_) hidden_[s.sample] = s.depth;
    }
    const auto normal = [&](std::size_t t, int i) { return overlay.normals[t].corner[i]; };
    const std::vector<Seen> over =
        see(overlay.mesh, normal, [](std::size_t) { return false; }, true);
    const Lights lights(camera_);
    const auto colour = [&](std::size_t i) {
      return 0.5f * lights.shaded(over[i].normal, overlay.colour, 0.6f) + 0.6f * overlay.colour;
    };
    const auto share = [&](std::size_t i) {
      const bool behind = hidden_[over[i].sample] < over[i].depth - 1e-4f;
      return overlay.opacity * (behind ? kHidden : 1.0f);
    };
    blend(over, colour, share);
  }

  // Rows of red, green and blue in sRGB.
  void encode(std::uint8_t* out) const {
    static const std::vector<std::uint8_t> table = encoding();
    for (const Vec& v : light_)
      for (const float value : {v.x, v.y, v.z})
        *out++ = table[static_cast<std::size_t>(
            std::clamp(value, 0.0f, 1.0f) * (kSteps - 1) + 0.5f)];
  }

 private:
  static constexpr int kSteps = 1 << 14;

  std::size_t pixels() const { return static_cast<std::size_t>(width_) * height_; }

  static std::vector<std::uint8_t> encoding() {
    std::vector<std::uint8_t> table(kSteps);
    for (int i = 0; i < kSteps; ++i)
      table[i] = static_cast<std::uint8_t>(
          std::pow(i / (kSteps - 1.0), 1 / 2.2) * 255 + 0.5);
    return table;
  }

  // A field of half the size at a pixel, straight between its pixels.
  static float doubled(const Field& field, int row, int column) {
    const int i = row / 2, j = column / 2;
    const int k = std::clamp(row % 2 ? i + 1 : i - 1, 0, field.height - 1);
    const int l = std::clamp(column % 2 ? j + 1 : j - 1, 0, field.width - 1);
    return 0.75f * (0.75f * field.at(i, j) + 0.25f * field.at(i, l)) +
           0.25f * (0.75f * field.at(k, j) + 0.25f * field.at(k, l));
  }

  // Which samples show triangles; backs of closed ones are left out, other backs turned.
  template <class Normal, class Closed>
  std::vector<Seen> see(const Mesh& mesh, const Normal& normal,
                        const Closed& closed, bool turn) const {
    const int wide = width_ * kFine, high = height_ * kFine;
    const double scale = camera_.focal * high, cx = 0.5 * wide, cy = 0.5 * high;
    const auto project = [&](const Vec& v) {
      const double d[3] = {v.x - camera_.eye[0], v.y - camera_.eye[1], v.z - camera_.eye[2]};
      double s[3];
      for (int i = 0; i < 3; ++i)
        s[i] = camera_.axes[i][0] * d[0] + camera_.axes[i][1] * d[1] + camera_.axes[i][2] * d[2];
      const double near = 1.0 / s[2];
      return Corner{s[0] * scale * near + cx, s[1] * scale * near + cy, near};
    };
    std::vector<Corner> points(mesh.points.size());
    for (std::size_t i = 0; i < points.size(); ++i) points[i] = project(mesh.points[i]);
    const auto corners = [&](std::uint32_t t) {
      const Face& f = mesh.faces[t];
      return std::array<Corner, 3>{points[f[0]], points[f[1]], points[f[2]]};
    };
    std::vector<std::uint32_t> shown;
    double low[2] = {1e30, 1e30}, most[2] = {-1e30, -1e30};
    for (std::uint32_t t = 0; t < mesh.faces.size(); ++t) {
      const std::array<Corner, 3> c = corners(t);
      // Behind the eye nearness is below zero, closer than allowed it is too large.
      const bool far = std::all_of(c.begin(), c.end(), [](const Corner& p) {
        return p.near > 0.0 && p.near < 1.0 / kNearest;
      });
      if (!far || (closed(t) && area(c) >= 0.0)) continue;
      shown.push_back(t);
      for (const Corner& corner : c) {
        low[0] = std::min(low[0], corner.x), most[0] = std::max(most[0], corner.x);
        low[1] = std::min(low[1], corner.y), most[1] = std::max(most[1], corner.y);
      }
    }
    const auto clipped = [](double value, int end) {
      return static_cast<int>(std::clamp(value, 0.0, static_cast<double>(end)));
    };
    const Window window{clipped(std::floor(low[0]), wide), clipped(std::floor(low[1]), high),
                        clipped(std::ceil(most[0]), wide), clipped(std::ceil(most[1]), high)};
    Raster raster(window);
    for (const std::uint32_t t : shown) {
      const std::array<Corner, 3> c = corners(t);
      raster.draw(t, c[0], c[1], c[2]);
    }
    std::vector<Seen> found;
    std::uint32_t last = Raster::kNone;
    Vec n[3];
    std::size_t pixel = 0;
    for (int row = window.top; row < window.bottom; ++row)
      for (int column = window.left; column < window.right; ++column, ++pixel) {
        const std::uint32_t t = raster.triangle()[pixel];
        if (t == Raster::kNone) continue;
        if (t != last) {
          for (int i = 0; i < 3; ++i) n[i] = normal(t, i);
          last = t;
        }
        const std::array<Corner, 3> c = corners(t);
        // Perspective-correct weights of the corners.
        const double x = column + 0.5, y = row + 0.5;
        Vec mean;
        for (int i = 0; i < 3; ++i) {
          const Corner &p = c[(i + 1) % 3], &q = c[(i + 2) % 3];
          const double weight =
              ((q.x - p.x) * (y - p.y) - (q.y - p.y) * (x - p.x)) * c[i].near;
          mean = mean + static_cast<float>(weight) * n[i];
        }
        if (area(c) < 0.0) mean = -1.0f * mean;
        const Vec ray = camera_.ray(column, row, wide, high);
        if (turn && dot(mean, ray) > 0.0f) mean = -1.0f * mean;
        const float depth = 1.0f / raster.near()[pixel];
        const auto sample = static_cast<std::uint32_t>(row * wide + column);
        found.push_back({sample, t, depth, unit(mean),
                         camera_.place() + depth * ray});
      }
    return found;
  }

  // Twice the signed area of a triangle in the image.
  static double area(const std::array<Corner, 3>& c) {
    return (c[1].x - c[0].x) * (c[2].y - c[0].y) - (c[1].y - c[0].y) * (c[2].x - c[0].x);
  }

  template <class Colour, class Share>
  void blend(const std::vector<Seen>& seen, const Colour& colour, const Share& share) {
    constexpr float part = 1.0f / (kFine * kFine);
    if (seen.empty()) return;
    // Per pixel first, then over what is there: the samples of one pixel do not follow each other.
    std::vector<std::array<float, 4>> sums;
    const std::size_t wide = static_cast<std::size_t>(width_) * kFine;
    const std::size_t low = seen.front().sample / wide / kFine,
                      high = seen.back().sample / wide / kFine + 1;
    sums.assign((high - low) * width_, {0, 0, 0, 0});
    for (std::size_t i = 0; i < seen.size(); ++i) {
      const std::size_t row = seen[i].sample / wide / kFine,
                        column = seen[i].sample % wide / kFine;
      const float s = share(i) * part;
      const Vec c = colour(i);
      std::array<float, 4>& sum = sums[(row - low) * width_ + column];
      sum[0] += s * std::clamp(c.x, 0.0f, 1.0f);
      sum[1] += s * std::clamp(c.y, 0.0f, 1.0f);
      sum[2] += s * std::clamp(c.z, 0.0f, 1.0f);
      sum[3] += s;
    }
    for (std::size_t i = 0; i < sums.size(); ++i) {
      if (sums[i][3] == 0.0f) continue;
      Vec& pixel = light_[low * width_ + i];
      pixel = (1 - sums[i][3]) * pixel + Vec{sums[i][0], sums[i][1], sums[i][2]};
    }
  }

  const Posed* posed_;
  Camera camera_;
  int width_, height_;
  std::vector<Seen> seen_;
  std::vector<Vec> colours_, light_;
  std::vector<ShadowMap> shadow_;  // one, once it is shaded
  std::vector<float> hidden_;      // depth of the robot at each sample
};

}  // namespace touchline::render
