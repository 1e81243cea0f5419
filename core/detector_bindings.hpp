// SPDX-License-Identifier: Apache-2.0
// The detector for Python: samples through observer and detector, one or many.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "guard.hpp"
#include "samples.hpp"
#include "touchline/detail/detector/detector.hpp"

namespace touchline::detection {

namespace nb = nanobind;
using namespace nb::literals;
namespace tl = touchline;
using Observer = guard::Shared<tl::Observer>;

// The observer that a detector belongs to.
inline tl::Observer& own(Observer& shared, const tl::Detector& d) {
  if (&shared.value != &d.observer())
    throw std::invalid_argument("the detector belongs to another observer");
  return shared.value;
}

// One sample through observer and detector: the observer's row, the level of each segment, the
// normalized rows, their drifts, for how long each segment's baseline has been averaged.
inline nb::tuple detect(Observer& shared, tl::Detector& d, double time, nb::handle q, nb::handle qd,
                        nb::handle tau, nb::handle wrench) {
  tl::Observer& o = own(shared, d);
  const tl::Sample in = samples::one(o.row_layout(), time, q, qd, tau, wrench);
  arrays::Out out({o.output().size()}), levels({d.levels().size()}), tests({d.rows().size()}),
      drift({d.rows().size()}), quiet({d.quiet().size()});
  const guard::Turn turn(shared.turn);
  const double* row = o.step(in);
  d.step(row, in.q, in.qd);
  std::copy_n(row, o.output().size(), out.data());
  std::copy(d.levels().begin(), d.levels().end(), levels.data());
  std::copy(d.normalized().begin(), d.normalized().end(), tests.data());
  std::copy(d.drift().begin(), d.drift().end(), drift.data());
  std::copy(d.quiet().begin(), d.quiet().end(), quiet.data());
  return nb::make_tuple(out.release(), levels.release(), tests.release(), drift.release(),
                        quiet.release());
}

// Runs samples `from` to `to` through observer and detector; calls `each(i)` after every one.
template <class Each>
void detect_all(Observer& shared, tl::Detector& d, const samples::Many& in, std::size_t from,
                std::size_t to, double* rows, Each each) {
  tl::Observer& o = shared.value;
  nb::gil_scoped_release release;
  const std::size_t n = o.row_layout().joints, w = 6 * o.row_layout().sensors;
  std::size_t i = from;
  o.run(to - from, in.time + from, in.first.q + from * n, in.first.qd + from * n,
        in.first.tau + from * n, in.first.wrench + from * w, rows, [&](const double* row) {
          d.step(row, in.first.q + i * n, in.first.qd + i * n);
          each(i++);
        });
}

// The same for N samples.
inline nb::tuple detect_run(Observer& shared, tl::Detector& d, nb::handle time, nb::handle q,
                     nb::handle qd, nb::handle tau, nb::handle wrench) {
  tl::Observer& o = own(shared, d);
  const samples::Many in = samples::many(o.row_layout(), time, q, qd, tau, wrench);
  arrays::Out out({in.rows, o.output().size()}), levels({in.rows, d.levels().size()}),
      tests({in.rows, d.rows().size()}), drift({in.rows, d.rows().size()}),
      quiet({in.rows, d.quiet().size()});
  const guard::Turn turn(shared.turn);
  double *level = levels.data(), *x = tests.data(), *y = drift.data(), *since = quiet.data();
  detect_all(shared, d, in, 0, in.rows, out.data(), [&](std::size_t) {
    level = std::copy(d.levels().begin(), d.levels().end(), level);
    x = std::copy(d.normalized().begin(), d.normalized().end(), x);
    y = std::copy(d.drift().begin(), d.drift().end(), y);
    since = std::copy(d.quiet().begin(), d.quiet().end(), since);
  });
  return nb::make_tuple(out.release(), levels.release(), tests.release(), drift.release(),
                        quiet.release());
}

// N samples, for those who set thresholds: levels (N, m), statistics (N, m, tests). Of every
// `every`-th sample also the residuals (r) less baseline, the same low-passed once more, less reference
// and low-passed, the variance (r) of the latter by noise, and the activity (2).
inline nb::tuple detect_details(Observer& shared, tl::Detector& d, nb::handle time, nb::handle q,
                         nb::handle qd, nb::handle tau, nb::handle wrench, std::size_t every) {
  tl::Observer& o = own(shared, d);
  const samples::Many in = samples::many(o.row_layout(), time, q, qd, tau, wrench);
  if (every == 0) throw std::invalid_argument("every must be at least 1");
  const std::size_t segments = d.levels().size(), rows = d.rows().size();
  const std::size_t kept = (in.rows + every - 1) / every;
  arrays::Out levels({in.rows, segments}),
      statistics({in.rows, segments, d.statistics().size() / std::max<std::size_t>(segments, 1)}),
      residual({kept, rows}), slow({kept, rows}), quick({kept, rows}), noise({kept, rows}),
      activity({kept, 2});
  constexpr std::size_t kBlock = 256;  // samples whose rows are held at a time
  std::vector<double> scratch(kBlock * o.output().size());
  const guard::Turn turn(shared.turn);
  double *level = levels.data(), *value = statistics.data(), *x = residual.data(), *a = slow.data(),
         *b = quick.data(), *v = noise.data(), *c = activity.data();
  const auto each = [&](std::size_t i) {
    level = std::copy(d.levels().begin(), d.levels().end(), level);
    value = std::copy(d.statistics().begin(), d.statistics().end(), value);
    if (i % every != 0) return;
    for (std::size_t r = 0; r < rows; ++r) {
      const int segment = d.rows()[r].segment;
      const tl::SegmentTests& tests = d.tests(segment);
      const std::size_t own = r - d.first_row(segment);
      const bool known = d.sample(r).known;
      *x++ = known ? d.sample(r).residual - d.sample(r).offset : tl::kNaN;
      *a++ = known ? tests.slow(own) : tl::kNaN;
      *b++ = known ? tests.quick(own) : tl::kNaN;
      *v++ = tests.noise_variance(own);
    }
    *c++ = d.activity().speed2;
    *c++ = d.activity().acceleration;
  };
  for (std::size_t from = 0; from < in.rows; from += kBlock)
    detect_all(shared, d, in, from, std::min(from + kBlock, in.rows), scratch.data(), each);
  return nb::make_tuple(levels.release(), statistics.release(), residual.release(),
                        slow.release(), quick.release(), noise.release(), activity.release());
}

inline void check_detector(const tl::Observer& o, const std::vector<tl::DetectionRow>& rows,
                           const tl::DetectionSettings& settings) {
  const std::size_t joints = o.row_layout().joints, sensors = o.row_layout().sensors;
  const tl::NoiseFigures& noise = settings.noise;
  bool good = settings.sum_limits.size() == o.layout().segments.size() &&
              noise.qd.size() == joints && noise.tau.size() == joints &&
              noise.wrench.size() == 6 * sensors && !settings.windows.empty();
  for (const tl::TestSetting& test : settings.tests)
    good = good && test.limits.size() == settings.sum_limits.size();
  for (std::size_t i = 1; i < rows.size(); ++i) good = good && rows[i - 1].segment <= rows[i].segment;
  if (!good) throw std::invalid_argument("the detector's settings do not fit the observer");
}

// What noise leaves in rows at joint positions q, per sample: variances of their loads by the
// readings, and of their momenta by the velocities.
inline nb::tuple row_variances(const Observer& shared, const std::vector<tl::DetectionRow>& rows,
                               const tl::NoiseFigures& noise, nb::handle q) {
  const tl::Observer& o = shared.value;  // only what never changes
  const std::size_t size = rows.size();
  tl::Posture posture(o.tree(), o.row_layout().joints);
  tl::RowCovariance covariance(o, rows, noise);
  posture.set(arrays::numbers(q, {static_cast<std::size_t>(o.row_layout().joints)}), nullptr);
  covariance.evaluate(posture);
  arrays::Out reading({size}), momentum({size});
  for (std::size_t i = 0; i < size; ++i) {
    reading.data()[i] = covariance.reading()[i * (size + 1)];
    momentum.data()[i] = covariance.momentum()[i * (size + 1)];
  }
  return nb::make_tuple(reading.release(), momentum.release());
}

inline tl::ModelError model_error(const std::vector<double>& v) {
  if (v.size() != 3) throw std::invalid_argument("three numbers are needed");
  return {v[0], v[1], v[2]};
}

inline void bind(nb::module_& m) {
  nb::enum_<tl::Test>(m, "Test")
      .value("rows", tl::Test::rows)
      .value("scaled", tl::Test::scaled)
      .value("chi2", tl::Test::chi2)
      .value("glrt", tl::Test::glrt)
      .value("cusum", tl::Test::cusum);
  nb::class_<tl::DetectionRow>(m, "DetectionRow")
      .def(
          "__init__",
          [](tl::DetectionRow* self, int segment, int component, int joint, double contact,
             double collision, double baseline_limit, const std::vector<double>& slow,
             const std::vector<double>& quick, const std::vector<double>& drift,
             double seen) {
            new (self) tl::DetectionRow{segment, component, joint, contact, collision,
                                        baseline_limit, model_error(slow), model_error(quick),
                                        model_error(drift), seen};
          },
          "segment"_a, "component"_a, "joint"_a, "contact"_a, "collision"_a, "baseline_limit"_a,
          "slow"_a, "quick"_a, "drift"_a, "seen"_a = 0.0);
  nb::class_<tl::DetectionTimes>(m, "DetectionTimes")
      .def(
          "__init__",
          [](tl::DetectionTimes* self, double min_duration, double hold, double baseline,
             double release) {
            new (self) tl::DetectionTimes{min_duration, hold, baseline, release};
          },
          "min_duration"_a, "hold"_a, "baseline"_a, "release"_a);
  nb::class_<tl::TestSetting>(m, "TestSetting")
      .def(
          "__init__",
          [](tl::TestSetting* self, tl::Test test, std::vector<double> limits) {
            new (self) tl::TestSetting{test, std::move(limits)};
          },
          "test"_a, "limits"_a);
  nb::class_<tl::DetectionSettings>(m, "DetectionSettings")
      .def(
          "__init__",
          [](tl::DetectionSettings* self, std::vector<tl::TestSetting> tests,
             std::vector<double> sum_limits, const tl::DetectionTimes& times,
             const tl::NoiseFigures& noise, std::vector<double> windows) {
            new (self) tl::DetectionSettings{std::move(tests), std::move(sum_limits), times, noise,
                                             std::move(windows)};
          },
          "tests"_a, "sum_limits"_a, "times"_a, "noise"_a, "windows"_a);
  nb::class_<tl::Detector>(m, "Detector")
      .def(
          "__init__",
          [](tl::Detector* self, const Observer& observer, std::vector<tl::DetectionRow> rows,
             tl::DetectionSettings settings) {
            check_detector(observer.value, rows, settings);
            new (self) tl::Detector(observer.value, std::move(rows), std::move(settings));
          },
          "observer"_a, "rows"_a, "settings"_a, nb::keep_alive<1, 2>())
      .def("baseline", &tl::Detector::baseline, "row"_a);
  m.def("row_variances", &row_variances, "observer"_a, "rows"_a, "noise"_a, "q"_a);
  m.def("detect", &detect);
  m.def("detect_run", &detect_run);
  m.def("detect_details", &detect_details, "observer"_a, "detector"_a, "time"_a, "q"_a, "qd"_a,
        "tau"_a, "wrench"_a, "every"_a = 1);
}

}  // namespace touchline::detection
