// SPDX-License-Identifier: Apache-2.0
// Which triangle each pixel shows: a z-buffer.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

namespace touchline::render {

// A corner in the image: pixels, and how near it is: > 0 and linear in the image, so 1 / depth for
// a pinhole camera.
struct Corner {
  double x, y, near;
};

// A part of an image: pixels from (left, top) to before (right, bottom).
struct Window {
  int left = 0, top = 0, right = 0, bottom = 0;
};

class Raster {
 public:
  explicit Raster(const Window& window)
      : window_(window), width_(std::max(window.right - window.left, 0)),
        near_(static_cast<std::size_t>(width_) * std::max(window.bottom - window.top, 0), 0.0f),
        triangle_(near_.size(), kNone) {}

  Raster(int width, int height) : Raster(Window{0, 0, width, height}) {}

  static constexpr std::uint32_t kNone = std::numeric_limits<std::uint32_t>::max();

  const Window& window() const { return window_; }
  // Row by row of the window: 0 and `kNone` where nothing was drawn.
  const std::vector<float>& near() const { return near_; }
  const std::vector<std::uint32_t>& triangle() const { return triangle_; }

  // Draws a triangle, either way round, where it is the nearest at the middle of a pixel. A row
  // begins and ends where the edge's own line says, the same from both of its triangles, so that
  // a surface has neither cracks nor pixels drawn twice.
  void draw(std::uint32_t number, const Corner& a, const Corner& b, const Corner& c) {
    const double top = std::min({a.y, b.y, c.y}), bottom = std::max({a.y, b.y, c.y});
    const int first = after(top, window_.top, window_.bottom),
              last = after(bottom, window_.top, window_.bottom);
    if (first >= last) return;
    const double left = std::min({a.x, b.x, c.x}), right = std::max({a.x, b.x, c.x});
    if (after(left, window_.left, window_.right) >= after(right, window_.left, window_.right))
      return;
    const double area = (b.x - a.x) * (c.y - a.y) - (b.y - a.y) * (c.x - a.x);
    if (area == 0.0 || !std::isfinite(area)) return;
    const Corner* corners[3] = {&a, &b, &c};
    double slope[3], offset[3];
    int side[3];
    for (int i = 0; i < 3; ++i) {
      const Corner &p = *corners[i], &q = *corners[(i + 1) % 3];
      const double rise = p.y - q.y;
      side[i] = rise == 0.0 ? 0 : ((rise > 0.0) == (area > 0.0) ? 1 : -1);
      if (side[i] == 0) continue;
      slope[i] = -(q.x - p.x) / rise;
      offset[i] = -(p.x * q.y - q.x * p.y) / rise;
    }
    double along = 0.0, down = 0.0;
    if (std::abs(area) > 1e-12) {
      const double vb = b.near - a.near, vc = c.near - a.near;
      along = (vb * (c.y - a.y) - vc * (b.y - a.y)) / area;
      down = ((b.x - a.x) * vc - (c.x - a.x) * vb) / area;
    }
    for (int row = first; row < last; ++row) {
      const double y = row + 0.5;
      double low = -std::numeric_limits<double>::infinity(), high = -low;
      for (int i = 0; i < 3; ++i) {
        if (side[i] == 0) continue;
        const double at = slope[i] * y + offset[i];
        if (side[i] > 0)
          low = std::max(low, at);
        else
          high = std::min(high, at);
      }
      const int begin = after(low, window_.left, window_.right),
                end = after(high, window_.left, window_.right);
      const double start = a.near + along * (begin + 0.5 - a.x) + down * (y - a.y);
      const std::size_t base = static_cast<std::size_t>(row - window_.top) * width_;
      for (int column = begin; column < end; ++column) {
        const float near = static_cast<float>(std::max(start + along * (column - begin), 1e-30));
        const std::size_t pixel = base + (column - window_.left);
        if (near > near_[pixel]) {
          near_[pixel] = near;
          triangle_[pixel] = number;
        }
      }
    }
  }

 private:
  // The first pixel of some whose middle lies at or behind a place.
  static int after(double place, int least, int most) {
    if (!(place > least)) return least;
    if (!(place - 0.5 < most)) return most;
    const int below = static_cast<int>(place - 0.5);  // towards zero; `std::ceil` is a call
    return below + (below < place - 0.5);
  }

  Window window_;
  int width_;
  std::vector<float> near_;
  std::vector<std::uint32_t> triangle_;
};

}  // namespace touchline::render
