// SPDX-License-Identifier: Apache-2.0
// The classifier for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <utility>
#include <vector>

#include "arrays.hpp"
#include "touchline/detail/classifier/classifier.hpp"

namespace classification {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

// One sample: the observer's row and the detector's levels.
inline void step(tl::Classifier& c, double time, nb::handle row, nb::handle levels) {
  c.step(time, arrays::numbers(row, {c.width()}), arrays::numbers(levels, {c.segments()}));
}

// N samples: kinds (N, m), and rates (N, m) of the segments' forces.
inline nb::tuple follow(tl::Classifier& c, nb::handle time, nb::handle rows, nb::handle levels) {
  const std::size_t count = arrays::length(time), m = c.segments();
  const double* stamps = arrays::numbers(time, {count});
  const double* row = arrays::numbers(rows, {count, c.width()});
  const double* level = arrays::numbers(levels, {count, m});
  arrays::Out kinds({count, m}), rates({count, m});
  for (std::size_t i = 0; i < count; ++i) {
    c.step(stamps[i], row + i * c.width(), level + i * m);
    for (std::size_t g = 0; g < m; ++g) {
      kinds.data()[i * m + g] = static_cast<double>(c.kind(static_cast<int>(g)));
      rates.data()[i * m + g] = c.rate(static_cast<int>(g));
    }
  }
  return nb::make_tuple(kinds.release(), rates.release());
}

inline void bind(nb::module_& m) {
  nb::class_<tl::BlowLimits>(m, "BlowLimits")
      .def(
          "__init__",
          [](tl::BlowLimits* self, double onset, double collision,
             std::vector<int> joints) {
            new (self) tl::BlowLimits{onset, collision, std::move(joints)};
          },
          "onset"_a, "collision"_a, "joints"_a);
  nb::class_<tl::Classifier> classifier(m, "Classifier");
  classifier
      .def(
          "__init__",
          [](tl::Classifier* self, const tl::Observer& observer,
             std::vector<tl::BlowLimits> limits) {
            new (self) tl::Classifier(observer, std::move(limits));
          },
          "observer"_a, "limits"_a)
      .def("step", &step, "time"_a, "row"_a, "levels"_a)
      .def("follow", &follow, "time"_a, "rows"_a, "levels"_a);
  classifier.attr("WINDOW") = tl::ForceHistory::kWindow;
  classifier.attr("LEVER") = tl::Classifier::kLever;
}

}  // namespace classification
