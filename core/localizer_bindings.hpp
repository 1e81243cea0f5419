// SPDX-License-Identifier: Apache-2.0
// The localizer for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <optional>
#include <stdexcept>
#include <utility>
#include <vector>

#include "answer_rows.hpp"
#include "arrays.hpp"
#include "mesh_bindings.hpp"

namespace localization {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;
using answer_rows::event_width;
using answer_rows::kClass;
using answer_rows::kWidth;
using answer_rows::push_event;
using meshes::array;
using meshes::In;
using meshes::Out;
using meshes::push;

inline const double* data_or_null(const std::optional<In>& a) {
  return a ? a->data() : nullptr;
}

inline Out locate(tl::Localizer& l, int segment, const In& row, const std::optional<In>& normalized,
                  const In& q, const std::optional<In>& qd,
                  const std::optional<In>& drift, const std::optional<In>& quiet) {
  l.expect(segment, row.size(), normalized ? normalized->size() : l.tests(), q.size(),
           qd ? qd->size() : q.size());
  if (quiet && quiet->size() != l.segments()) throw std::invalid_argument("one number per segment");
  if (drift && drift->size() != l.tests()) throw std::invalid_argument("one drift per row");
  l.set_state(q.data(), data_or_null(qd), data_or_null(drift), data_or_null(quiet));
  std::vector<double> out(kWidth);
  answer_rows::write(l, l.locate(segment, row.data(), data_or_null(normalized)), out.data());
  return array(out, 1, kWidth);
}

// The events that last: sample (0), segment, number, event.
inline Out events(tl::Localizer& l) {
  std::vector<double> out;
  for (std::size_t g = 0; g < l.segments(); ++g) {
    for (tl::Localizer::Memory& memory : l.memories(g)) {
      if (memory.serial >= 0) push_event(l, 0, g, memory, out);
    }
  }
  return array(out, out.size() / event_width(l), event_width(l));
}

// One sample on its way through the localizer.
struct FollowedSample {
  double time;
  const double *row, *normalized, *drift, *levels, *quiet, *q, *qd;
};

// For each contact on a segment that is touched: its class and its answer; and for each event that
// ends: sample, segment, number, event.
inline void follow(tl::Localizer& l, tl::Classifier& c, std::size_t i, const FollowedSample& x,
                   std::vector<double>& answers, std::vector<double>& ended) {
  c.step(x.time, x.row, x.levels);
  bool ready = false;
  for (std::size_t g = 0; g < l.segments(); ++g) {
    const bool touched = x.levels[g] > 0.0;
    if (touched && !ready) l.set_state(x.q, x.qd, x.drift, x.quiet);
    ready = ready || touched;
    l.follow(static_cast<int>(g), touched, x.row, x.normalized, x.time, x.q);
    for (tl::Localizer::Memory* memory : l.ended()) {
      push_event(l, i, g, *memory, ended);
      memory->serial = -1;
    }
    if (!touched) continue;
    c.consider(static_cast<int>(g), l.reports());
    for (int k = 0; k < l.reports().count(); ++k) {
      answers.resize(answers.size() + kClass + kWidth);
      answer_rows::write(l, c, i, static_cast<int>(g), k, &*answers.end() - kClass - kWidth);
    }
  }
}

// N samples.
inline nb::tuple follow_run(tl::Localizer& l, tl::Classifier& c, nb::handle time,
                            nb::handle rows, nb::handle normalized, nb::handle drift,
                            nb::handle levels, nb::handle quiet, nb::handle q, nb::handle qd) {
  const std::size_t n = l.joints(), m = l.segments(), r = l.tests(), width = l.width();
  const std::size_t count = arrays::length(time);
  const double* stamps = arrays::numbers(time, {count});
  FollowedSample x{0.0, arrays::numbers(rows, {count, width}),
                   arrays::numbers(normalized, {count, r}), arrays::numbers(drift, {count, r}),
                   arrays::numbers(levels, {count, m}),
                   arrays::numbers(quiet, {count, m}), arrays::numbers(q, {count, n}),
                   arrays::numbers(qd, {count, n})};
  std::vector<double> answers, ended;
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < count; ++i) {
      x.time = stamps[i];
      follow(l, c, i, x, answers, ended);
      x = {0.0,         x.row + width, x.normalized + r, x.drift + r, x.levels + m,
           x.quiet + m, x.q + n,       x.qd + n};
    }
  }
  return nb::make_tuple(arrays::table(answers, kClass + kWidth),
                        arrays::table(ended, event_width(l)));
}

// One sample.
inline nb::tuple follow_sample(tl::Localizer& l, tl::Classifier& c, double time, nb::handle row,
                               nb::handle normalized, nb::handle drift, nb::handle levels,
                               nb::handle quiet, nb::handle q, nb::handle qd) {
  const std::size_t n = l.joints(), m = l.segments();
  const FollowedSample x{time, arrays::numbers(row, {l.width()}),
                         arrays::numbers(normalized, {l.tests()}),
                         arrays::numbers(drift, {l.tests()}), arrays::numbers(levels, {m}),
                         arrays::numbers(quiet, {m}), arrays::numbers(q, {n}),
                         arrays::numbers(qd, {n})};
  std::vector<double> answers, ended;
  answers.reserve(4 * (kClass + kWidth));
  follow(l, c, 0, x, answers, ended);
  return nb::make_tuple(arrays::table(answers, kClass + kWidth),
                        arrays::table(ended, event_width(l)));
}

// Rows: surface, centre, probability, log of the density.
inline Out region(const tl::Localizer& l) {
  std::vector<double> out;
  const std::vector<tl::SurfaceCell> cells = l.region();
  for (const tl::SurfaceCell& c : cells) {
    out.push_back(static_cast<double>(c.surface));
    push(out, c.centre);
    out.insert(out.end(), {c.probability, c.log_density});
  }
  return array(out, cells.size(), 6);
}

inline tl::NoiseFigures noise(std::vector<double> qd, std::vector<double> tau,
                              std::vector<double> wrench, double period, double wrench_error,
                              double torque_error) {
  tl::NoiseFigures figures;
  figures.qd = std::move(qd);
  figures.tau = std::move(tau);
  figures.wrench = std::move(wrench);
  figures.period = period;
  figures.wrench_error = wrench_error;
  figures.torque_error = torque_error;
  return figures;
}

inline void bind(nb::module_& m) {
  nb::class_<tl::NoiseFigures>(m, "NoiseFigures");
  m.def("noise_figures", &noise, "qd"_a, "tau"_a, "wrench"_a, "period"_a,
        "wrench_error"_a, "torque_error"_a);
  nb::class_<tl::LocalizerSettings>(m, "LocalizerSettings")
      .def(nb::init<>())
      .def_rw("friction", &tl::LocalizerSettings::friction)
      .def_rw("cone_softness", &tl::LocalizerSettings::cone_softness)
      .def_rw("force_scale", &tl::LocalizerSettings::force_scale)
      .def_rw("place_scale", &tl::LocalizerSettings::place_scale)
      .def_rw("pitch_limit", &tl::LocalizerSettings::pitch_limit)
      .def_rw("least_force", &tl::LocalizerSettings::least_force)
      .def_rw("certain", &tl::LocalizerSettings::certain)
      .def_rw("place_radius", &tl::LocalizerSettings::place_radius)
      .def_rw("finger", &tl::LocalizerSettings::finger)
      .def_rw("first_entry", &tl::LocalizerSettings::first_entry);
  nb::class_<tl::LinkSurface>(m, "LinkSurface")
      .def("__init__",
           [](tl::LinkSurface* self, int node, const tl::Mesh& mesh, bool graspable) {
             new (self) tl::LinkSurface{node, mesh, graspable};
           },
           "node"_a, "mesh"_a, "graspable"_a)
      .def_ro("node", &tl::LinkSurface::node);
  nb::class_<tl::Localizer>(m, "Localizer")
      .def("__init__",
           [](tl::Localizer* self, const tl::Observer& observer,
              std::vector<tl::DetectionRow> tests, const tl::NoiseFigures& figures,
              std::vector<tl::LinkSurface> surfaces, const tl::LocalizerSettings& settings) {
             new (self) tl::Localizer(observer, std::move(tests), figures, std::move(surfaces),
                                      settings);
           },
           "observer"_a, "tests"_a, "noise"_a, "surfaces"_a, "settings"_a,
           nb::keep_alive<1, 2>())
      .def("wrench_covariance",
           [](tl::Localizer& l, const In& q, const In& row, int segment,
              const std::optional<In>& drift) {
             l.expect(segment, row.size(), drift ? drift->size() : l.tests(), q.size(), q.size());
             l.set_state(q.data(), nullptr, data_or_null(drift), nullptr);
             std::vector<double> out(36);
             if (!l.wrench_covariance(segment, row.data(), out.data()))
               throw std::invalid_argument("the segment has no wrench");
             return array(out, 6, 6);
           },
           "q"_a, "row"_a, "segment"_a, "drift"_a.none())
      .def("locate", &locate, "segment"_a, "row"_a, "normalized"_a.none(), "q"_a, "qd"_a.none(),
           "drift"_a.none(), "quiet"_a.none())
      .def("region", &region)
      .def("events", &events)
      .def("follow", &follow_run, "classifier"_a, "time"_a, "rows"_a, "normalized"_a, "drift"_a,
           "levels"_a, "quiet"_a, "q"_a, "qd"_a)
      .def("follow_sample", &follow_sample);
}

}  // namespace localization
