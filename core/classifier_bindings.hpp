// SPDX-License-Identifier: Apache-2.0
// The classifier for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <utility>
#include <vector>

#include "arrays.hpp"
#include "guard.hpp"
#include "touchline/detail/classifier/classifier.hpp"

namespace touchline::classification {

namespace nb = nanobind;
namespace tl = touchline;

using namespace nb::literals;
using Classifier = guard::Shared<tl::Classifier>;

// N samples: kinds (N, m), and rates (N, m) of the segments' forces.
inline nb::tuple follow(Classifier& shared, nb::handle time, nb::handle rows, nb::handle levels) {
  tl::Classifier& c = shared.value;
  const std::size_t count = arrays::length(time), m = c.segments();
  const double* stamps = arrays::numbers(time, {count});
  const double* row = arrays::numbers(rows, {count, c.width()});
  const double* level = arrays::numbers(levels, {count, m});
  arrays::Out kinds({count, m}), rates({count, m});
  const guard::Turn turn(shared.turn);
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
  nb::class_<Classifier>(m, "Classifier")
      .def(
          "__init__",
          [](Classifier* self, const guard::Shared<tl::Observer>& observer,
             std::vector<tl::BlowLimits> limits) {
            new (self) Classifier(observer.value, std::move(limits));
          },
          "observer"_a, "limits"_a)
      .def("follow", &follow, "time"_a, "rows"_a, "levels"_a);
}

}  // namespace touchline::classification
