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

#include "arrays.hpp"
#include "fields.hpp"
#include "guard.hpp"
#include "mesh_bindings.hpp"
#include "touchline/detail/events/describe.hpp"

namespace touchline::localization {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;
using meshes::array;
using meshes::In;
using meshes::Out;
using meshes::push;

inline const double* data_or_null(const std::optional<In>& a) {
  return a ? a->data() : nullptr;
}

// An observer and its localizer take turns.
using Localizer = guard::Attached<tl::Localizer>;

// The contact on a segment as numbers, see `fields::table`.
inline nb::object locate(Localizer& shared, int segment, const In& row,
                         const std::optional<In>& normalized, const In& q,
                         const std::optional<In>& qd, const std::optional<In>& drift,
                         const std::optional<In>& quiet) {
  tl::Localizer& l = shared.value;
  l.expect(segment, row.size(), normalized ? normalized->size() : l.tests(), q.size(),
           qd ? qd->size() : q.size());
  if (quiet && quiet->size() != l.segments()) throw std::invalid_argument("one number per segment");
  if (drift && drift->size() != l.tests()) throw std::invalid_argument("one drift per row");
  tl::Contact contact;
  {
    const guard::Turn turn(shared.turn);
    l.set_state(q.data(), data_or_null(qd), data_or_null(drift), data_or_null(quiet));
    tl::describe(l.locate(segment, row.data(), data_or_null(normalized)), segment, contact);
  }
  std::vector<double> out(fields::width<tl::Contact>());
  tl::write_numbers(contact, out.data());
  return arrays::line(out);
}

// Rows: surface, centre, probability, log of the density.
inline Out region(const std::vector<tl::SurfaceCell>& cells) {
  std::vector<double> out;
  for (const tl::SurfaceCell& c : cells) {
    out.push_back(static_cast<double>(c.surface));
    push(out, c.centre);
    out.insert(out.end(), {c.probability, c.log_density});
  }
  return array(out, cells.size(), 6);
}

inline tl::NoiseFigures noise(std::vector<double> qd, std::vector<double> tau,
                              std::vector<double> wrench, double period, double wrench_error,
                              double torque_error, double wrench_error_off) {
  tl::NoiseFigures figures;
  figures.qd = std::move(qd);
  figures.tau = std::move(tau);
  figures.wrench = std::move(wrench);
  figures.period = period;
  figures.wrench_error = wrench_error;
  figures.torque_error = torque_error;
  figures.wrench_error_off = wrench_error_off;
  return figures;
}

inline void bind(nb::module_& m) {
  nb::class_<tl::NoiseFigures>(m, "NoiseFigures");
  m.def("noise_figures", &noise, "qd"_a, "tau"_a, "wrench"_a, "period"_a,
        "wrench_error"_a, "torque_error"_a, "wrench_error_off"_a);
  nb::class_<tl::LocalizerSettings>(m, "LocalizerSettings")
      .def(nb::init<>())
      .def_rw("friction", &tl::LocalizerSettings::friction)
      .def_rw("finger", &tl::LocalizerSettings::finger)
      .def_rw("first_entry", &tl::LocalizerSettings::first_entry);
  nb::class_<tl::LinkSurface>(m, "LinkSurface")
      .def("__init__",
           [](tl::LinkSurface* self, int node, const tl::Mesh& mesh, bool graspable,
              bool touchable) {
             new (self) tl::LinkSurface{node, mesh, graspable, touchable};
           },
           "node"_a, "mesh"_a, "graspable"_a, "touchable"_a = true)
      .def_ro("node", &tl::LinkSurface::node)
      .def_ro("touchable", &tl::LinkSurface::touchable);
  nb::class_<Localizer>(m, "Localizer")
      .def("__init__",
           [](Localizer* self, guard::Shared<tl::Observer>& observer,
              std::vector<tl::DetectionRow> tests, const tl::NoiseFigures& figures,
              std::vector<tl::LinkSurface> surfaces, const tl::LocalizerSettings& settings) {
             new (self) Localizer(observer.turn, observer.value, std::move(tests), figures,
                                  std::move(surfaces), settings);
           },
           "observer"_a, "tests"_a, "noise"_a, "surfaces"_a, "settings"_a,
           nb::keep_alive<1, 2>())
      .def("wrench_covariance",
           [](Localizer& shared, const In& q, const In& row, int segment,
              const std::optional<In>& drift) {
             tl::Localizer& l = shared.value;
             l.expect(segment, row.size(), drift ? drift->size() : l.tests(), q.size(), q.size());
             std::vector<double> out(36);
             const guard::Turn turn(shared.turn);
             l.set_state(q.data(), nullptr, data_or_null(drift), nullptr);
             if (!l.wrench_covariance(segment, row.data(), out.data()))
               throw std::invalid_argument("the segment has no wrench");
             return array(out, 6, 6);
           },
           "q"_a, "row"_a, "segment"_a, "drift"_a.none())
      .def("locate", &locate, "segment"_a, "row"_a, "normalized"_a.none(), "q"_a, "qd"_a.none(),
           "drift"_a.none(), "quiet"_a.none())
      .def("region", [](Localizer& l) {
        const guard::Turn turn(l.turn);
        return region(l.value.region());
      });
}

}  // namespace touchline::localization
