// SPDX-License-Identifier: Apache-2.0
// Samples as Python gives them: arrays of the shapes that the observer's joints and sensors want.
#pragma once

#include <nanobind/nanobind.h>

#include "arrays.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline::samples {

namespace nb = nanobind;
namespace tl = touchline;

// One sample, checked.
inline tl::Sample one(const tl::RowLayout& layout, double time, nb::handle q, nb::handle qd, nb::handle tau,
                      nb::handle wrench) {
  const std::size_t n = layout.joints, k = layout.sensors;
  return {time, arrays::numbers(q, {n}), arrays::numbers(qd, {n}), arrays::numbers(tau, {n}),
          arrays::numbers(wrench, {k, 6})};
}

// N samples: how many, and where the signals of the first stand.
struct Many {
  std::size_t rows;
  const double* time;
  tl::Sample first;
};

inline Many many(const tl::RowLayout& layout, nb::handle time, nb::handle q, nb::handle qd,
                 nb::handle tau, nb::handle wrench) {
  const std::size_t n = layout.joints, k = layout.sensors;
  const std::size_t rows = arrays::length(time);
  return {rows, arrays::numbers(time, {rows}),
          {0.0, arrays::numbers(q, {rows, n}), arrays::numbers(qd, {rows, n}),
           arrays::numbers(tau, {rows, n}), arrays::numbers(wrench, {rows, k, 6})}};
}

}  // namespace touchline::samples
