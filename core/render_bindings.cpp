// SPDX-License-Identifier: Apache-2.0
// The renderer of the report for Python, as the module `touchline._render`.

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/pair.h>
#include <nanobind/stl/tuple.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <stdexcept>
#include <tuple>
#include <utility>
#include <vector>

#include "render/picture.hpp"

namespace nb = nanobind;
namespace draw = touchline::render;
using namespace nb::literals;

namespace {

using Numbers = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;

void check(bool good, const char* text) {
  if (!good) throw std::invalid_argument(text);
}

draw::Vec vec(const double* v) {
  return {static_cast<float>(v[0]), static_cast<float>(v[1]), static_cast<float>(v[2])};
}

draw::Vec vec(const Numbers& v) {
  check(v.size() == 3, "three numbers are needed");
  return vec(v.data());
}

std::vector<draw::Triangle> triangles(const Numbers& numbers) {
  check(numbers.ndim() == 3 && numbers.shape(1) == 3 && numbers.shape(2) == 3,
        "triangles must be (T, 3, 3)");
  std::vector<draw::Triangle> found(numbers.shape(0));
  const double* at = numbers.data();
  for (draw::Triangle& t : found)
    for (draw::Vec& c : t.corner) {
      c = vec(at);
      at += 3;
    }
  return found;
}

template <class Number>
nb::object array(const Number* values, std::vector<std::size_t> shape) {
  std::size_t count = 1;
  for (const std::size_t size : shape) count *= size;
  Number* raw = new Number[std::max<std::size_t>(count, 1)];
  std::copy_n(values, count, raw);
  nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<Number*>(p); });
  return nb::cast(nb::ndarray<nb::numpy, Number>(raw, shape.size(), shape.data(), owner));
}

nb::object vectors(const std::vector<draw::Vec>& values) {
  std::vector<double> flat;
  for (const draw::Vec& v : values) flat.insert(flat.end(), {v.x, v.y, v.z});
  return array(flat.data(), {values.size(), 3});
}

struct Skin {
  std::vector<draw::Piece> pieces;

  explicit Skin(const std::vector<std::tuple<Numbers, Numbers, bool>>& given) {
    check(given.size() < 65536, "too many pieces");
    for (const auto& [corners, normals, closed] : given) {
      check(corners.size() == normals.size(), "as many normals as corners are needed");
      pieces.emplace_back(triangles(corners), triangles(normals), closed);
    }
  }

  draw::Posed posed(const Numbers& poses) const {
    check(poses.ndim() == 3 && poses.shape(0) == pieces.size() && poses.shape(1) == 4 &&
              poses.shape(2) == 4,
          "poses must be (P, 4, 4), one for each piece");
    std::vector<draw::Pose> found(pieces.size());
    for (std::size_t p = 0; p < found.size(); ++p) {
      const double* T = poses.data() + 16 * p;
      for (int i = 0; i < 3; ++i) found[p].rows[i] = vec(T + 4 * i);
      found[p].origin = {static_cast<float>(T[3]), static_cast<float>(T[7]),
                         static_cast<float>(T[11])};
    }
    nb::gil_scoped_release release;
    return draw::Posed(pieces, std::move(found));
  }
};

draw::Camera camera(const Numbers& eye, const Numbers& axes, double focal) {
  check(eye.size() == 3 && axes.size() == 9 && focal > 0.0, "eye (3,), axes (3, 3), focal > 0");
  draw::Camera found;
  std::copy_n(eye.data(), 3, found.eye);
  std::copy_n(axes.data(), 9, &found.axes[0][0]);
  found.focal = focal;
  return found;
}

constexpr int kMostPixels = 8192;

// A picture, and the image once it is finished.
class Canvas {
 public:
  Canvas(const draw::Posed& posed, const Numbers& eye, const Numbers& axes, double focal,
         std::pair<int, int> size)
      : width_(size.first), height_(size.second),
        picture_(made(posed, camera(eye, axes, focal), size)) {}

  nb::object part() const {
    std::vector<std::int64_t> parts;
    for (const draw::Seen& s : picture_.seen())
      parts.push_back(static_cast<std::int64_t>(picture_.posed().part(s.triangle)));
    return array(parts.data(), {parts.size()});
  }

  nb::object position() const {
    std::vector<draw::Vec> places;
    for (const draw::Seen& s : picture_.seen()) places.push_back(s.position);
    return vectors(places);
  }

  // `albedo` by piece, or by sample.
  nb::object image(const Numbers& albedo, int map, const Numbers& sky, nb::object floor,
                   const std::vector<std::tuple<Numbers, Numbers, Numbers, double>>& layers) {
    const bool by_sample = floor.is_none();
    check(albedo.ndim() == 2 && albedo.shape(1) == 3, "albedo must have three columns");
    check(map >= 16 && map <= 4096 && map % 2 == 0, "the map must be 16 to 4096 wide and even");
    const std::vector<draw::Seen>& seen = picture_.seen();
    std::size_t parts = 0;
    for (const draw::Seen& s : seen)
      parts = std::max(parts, picture_.posed().part(s.triangle) + 1);
    check(albedo.shape(0) >= (by_sample ? seen.size() : parts), "albedo has too few rows");
    const draw::Vec top = vec(sky);
    const draw::Vec bottom = by_sample ? top : vec(nb::cast<Numbers>(floor));
    std::vector<draw::Overlay> overlays;
    for (const auto& [corners, normals, colour, opacity] : layers) {
      check(corners.size() == normals.size(), "as many normals as corners are needed");
      overlays.push_back({draw::Mesh(triangles(corners)), triangles(normals), vec(colour),
                          static_cast<float>(opacity)});
    }
    std::vector<std::uint8_t> bytes(3 * static_cast<std::size_t>(width_) * height_);
    const double* colours = albedo.data();
    {
      nb::gil_scoped_release release;
      const auto own = [&](std::size_t i) {
        const std::size_t row = by_sample ? i : picture_.posed().part(seen[i].triangle);
        return vec(colours + 3 * row);
      };
      picture_.shade(own, map);
      if (by_sample)
        picture_.paper(top);
      else
        picture_.ground(top, bottom);
      picture_.put();
      for (const draw::Overlay& overlay : overlays) picture_.put_over(overlay);
      picture_.encode(bytes.data());
    }
    return array(bytes.data(),
                 {static_cast<std::size_t>(height_), static_cast<std::size_t>(width_), 3});
  }

 private:
  static draw::Picture made(const draw::Posed& posed, const draw::Camera& camera,
                            std::pair<int, int> size) {
    check(size.first > 0 && size.second > 0 && size.first <= kMostPixels &&
              size.second <= kMostPixels,
          "a side has 1 to 8192 pixels");
    nb::gil_scoped_release release;
    return draw::Picture(posed, camera, size.first, size.second);
  }

  int width_, height_;
  draw::Picture picture_;
};

nb::tuple rasterize(const Numbers& corners, const Numbers& nearness, std::pair<int, int> size) {
  check(corners.ndim() == 3 && corners.shape(1) == 3 && corners.shape(2) == 2 &&
            nearness.ndim() == 2 && nearness.shape(0) == corners.shape(0) &&
            nearness.shape(1) == 3,
        "corners must be (T, 3, 2), nearness (T, 3)");
  draw::Raster raster(size.first, size.second);
  for (std::size_t t = 0; t < corners.shape(0); ++t) {
    draw::Corner c[3];
    for (int i = 0; i < 3; ++i) {
      const double* at = corners.data() + 6 * t + 2 * i;
      c[i] = {at[0], at[1], nearness.data()[3 * t + i]};
    }
    raster.draw(static_cast<std::uint32_t>(t), c[0], c[1], c[2]);
  }
  std::vector<std::int64_t> pixels, numbers;
  std::vector<double> values;
  for (std::size_t i = 0; i < raster.near().size(); ++i) {
    if (raster.triangle()[i] == draw::Raster::kNone) continue;
    pixels.push_back(static_cast<std::int64_t>(i));
    numbers.push_back(raster.triangle()[i]);
    values.push_back(raster.near()[i]);
  }
  return nb::make_tuple(array(pixels.data(), {pixels.size()}),
                        array(numbers.data(), {numbers.size()}),
                        array(values.data(), {values.size()}));
}

#define TOUCHLINE_NUMBERS "numpy.typing.NDArray[numpy.float64]"
#define TOUCHLINE_ANY "numpy.typing.NDArray[typing.Any]"
#define TOUCHLINE_INTEGERS "numpy.typing.NDArray[numpy.int64]"

}  // namespace

NB_MODULE(_render, m) {
  m.doc() = "The native renderer of the report: no OpenGL, no window, no display needed.";
  nb::class_<draw::Posed>(m, "Posed", "The pieces of a skin where they stand.")
      .def_prop_ro(
          "box",
          [](const draw::Posed& p) { return nb::make_tuple(vectors({p.box().low}), vectors({p.box().high})); },
          nb::sig("def box(self, /) -> tuple[" TOUCHLINE_NUMBERS ", " TOUCHLINE_NUMBERS "]"),
          "Least and largest coordinates (1, 3) [m] in world.")
      .def(
          "sees",
          [](const draw::Posed& p, const Numbers& point, const Numbers& directions, double off) {
            check(directions.ndim() == 2 && directions.shape(1) == 3, "directions must be (D, 3)");
            std::vector<draw::Vec> rays;
            for (std::size_t i = 0; i < directions.shape(0); ++i)
              rays.push_back(vec(directions.data() + 3 * i));
            return p.sees(vec(point), rays, static_cast<float>(off));
          },
          "point"_a, "directions"_a, "off"_a,
          nb::sig("def sees(self, point: " TOUCHLINE_ANY ", directions: " TOUCHLINE_ANY
                  ", off: float) -> list[bool]"),
          "Whether rays from `off` [m] before a point (3,) along unit directions (D, 3) meet "
          "nothing.");
  nb::class_<Skin>(m, "Skin", "Pieces (corners (T, 3, 3) [m], unit normals (T, 3, 3), closed).")
      .def(nb::init<std::vector<std::tuple<Numbers, Numbers, bool>>>(), "pieces"_a,
           nb::sig("def __init__(self, pieces: collections.abc.Sequence[tuple[" TOUCHLINE_ANY
                   ", " TOUCHLINE_ANY ", bool]]) -> None"))
      .def("posed", &Skin::posed, "poses"_a, nb::keep_alive<0, 1>(),
           nb::sig("def posed(self, poses: " TOUCHLINE_ANY ") -> Posed"),
           "The pieces at poses (P, 4, 4) in world.");
  nb::class_<Canvas>(m, "Canvas", "What a camera sees of posed pieces, four samples a pixel.")
      .def(nb::init<const draw::Posed&, const Numbers&, const Numbers&, double,
                    std::pair<int, int>>(),
           "posed"_a, "eye"_a, "axes"_a, "focal"_a, "size"_a, nb::keep_alive<1, 2>(),
           nb::sig("def __init__(self, posed: Posed, eye: " TOUCHLINE_ANY
                   ", axes: " TOUCHLINE_ANY
                   ", focal: float, size: tuple[int, int]) -> None"))
      .def_prop_ro("part", &Canvas::part, nb::sig("def part(self, /) -> " TOUCHLINE_INTEGERS),
                   "Number (N,) of the piece that each sample shows.")
      .def_prop_ro("position", &Canvas::position,
                   nb::sig("def position(self, /) -> " TOUCHLINE_NUMBERS),
                   "Points (N, 3) [m] in world that the samples show.")
      .def("image", &Canvas::image, "albedo"_a, "map"_a, "sky"_a, "floor"_a.none(), "layers"_a,
           nb::sig("def image(self, albedo: " TOUCHLINE_ANY
                   ", map: int, sky: " TOUCHLINE_ANY ", floor: " TOUCHLINE_ANY
                   " | None, layers: collections.abc.Sequence[tuple[" TOUCHLINE_ANY ", " TOUCHLINE_ANY
                   ", " TOUCHLINE_ANY
                   ", float]]) -> numpy.typing.NDArray[numpy.uint8]"),
           "The picture (H, W, 3) in sRGB, once. Albedo by piece (P, 3); without a floor by "
           "sample (N, 3), on paper of the sky's colour. The shadow map is `map` pixels wide. "
           "Layers (corners, normals, linear colour, opacity) go over it, fainter where hidden.");
  m.def("rasterize", &rasterize, "corners"_a, "nearness"_a, "size"_a,
        nb::sig("def rasterize(corners: " TOUCHLINE_ANY ", nearness: " TOUCHLINE_ANY
                ", size: tuple[int, int]) -> tuple[" TOUCHLINE_INTEGERS ", " TOUCHLINE_INTEGERS
                ", " TOUCHLINE_NUMBERS "]"),
        "Pixels (N,) that show a triangle, which one, and how near it is there; corners "
        "(T, 3, 2) in pixels, nearness (T, 3) linear in the image.");
}
