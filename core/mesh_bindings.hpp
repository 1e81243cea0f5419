// SPDX-License-Identifier: Apache-2.0
// Meshes for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>

#include <algorithm>
#include <array>
#include <cstdint>
#include <stdexcept>
#include <vector>

#include "touchline/detail/model/mesh.hpp"

namespace touchline::meshes {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

using In = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;
using Faces = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

// Numbers row by row.
inline Out array(const std::vector<double>& values, std::size_t rows, std::size_t columns) {
  double* raw = new double[values.size()];
  std::copy(values.begin(), values.end(), raw);
  nb::capsule owner(raw, [](void* p) noexcept { delete[] static_cast<double*>(p); });
  return Out(raw, {rows, columns}, owner);
}

inline tl::Vec3 vec3(const In& v) {
  if (v.size() != 3) throw std::invalid_argument("three numbers are needed");
  return {v.data()[0], v.data()[1], v.data()[2]};
}

inline tl::ForceLine line(const In& origin, const In& direction) {
  const tl::Vec3 d = vec3(direction);
  const double length = tl::norm(d);
  if (!(length > 0.0)) throw std::invalid_argument("a line needs a direction");
  return {vec3(origin), (1.0 / length) * d};
}

inline tl::Mesh mesh(const In& vertices, const Faces& faces) {
  if (vertices.size() % 3 != 0 || faces.shape(1) != 3)
    throw std::invalid_argument("vertices and faces have three columns");
  const std::size_t count = vertices.size() / 3;
  std::vector<tl::Vec3> points(count);
  for (std::size_t i = 0; i < count; ++i)
    points[i] = {vertices.data()[3 * i], vertices.data()[3 * i + 1], vertices.data()[3 * i + 2]};
  std::vector<std::array<int, 3>> triangles(faces.shape(0));
  for (std::size_t i = 0; i < triangles.size(); ++i) {
    for (int k = 0; k < 3; ++k) {
      const std::int64_t v = faces.data()[3 * i + k];
      if (v < 0 || static_cast<std::size_t>(v) >= count)
        throw std::invalid_argument("a face names a vertex that is not there");
      triangles[i][k] = static_cast<int>(v);
    }
  }
  return tl::Mesh(points, triangles);
}

inline void push(std::vector<double>& out, const tl::Vec3& v) {
  out.insert(out.end(), {v.x, v.y, v.z});
}

// Rows: t, face, normal.
inline Out crossings(const tl::Mesh& m, const In& origin, const In& direction) {
  std::vector<double> out;
  m.crossings(line(origin, direction), [&](const tl::Crossing& c) {
    out.insert(out.end(), {c.t, static_cast<double>(c.face)});
    push(out, c.normal);
  });
  return array(out, out.size() / 5, 5);
}

// One row: distance, face, point, normal.
inline Out surface_point(const tl::SurfacePoint& p) {
  std::vector<double> out{p.distance, static_cast<double>(p.face)};
  push(out, p.point);
  push(out, p.normal);
  return array(out, 1, 8);
}

inline void bind(nb::module_& m) {
  nb::class_<tl::Mesh>(m, "Mesh")
      .def("crossings", &crossings, "origin"_a, "direction"_a)
      .def("nearest_to_line",
           [](const tl::Mesh& mesh, const In& origin, const In& direction) {
             return surface_point(mesh.nearest_to_line(line(origin, direction)));
           },
           "origin"_a, "direction"_a)
      .def("nearest_to_point", [](const tl::Mesh& mesh, const In& point) {
        return surface_point(mesh.nearest_to_point(vec3(point)));
      });
  m.def("mesh", &mesh, "vertices"_a, "faces"_a);
}

}  // namespace touchline::meshes
