// SPDX-License-Identifier: Apache-2.0
// Meshes and the localizer for Python.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/optional.h>
#include <nanobind/stl/vector.h>

#include <cstdint>
#include <optional>
#include <stdexcept>
#include <vector>

#include "arrays.hpp"
#include "touchline/classifier/classifier.hpp"
#include "touchline/localizer/localizer.hpp"

namespace contact {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

using In = nb::ndarray<const double, nb::c_contig, nb::device::cpu>;
using Out = nb::ndarray<nb::numpy, double>;
using Faces = nb::ndarray<const std::int64_t, nb::ndim<2>, nb::c_contig, nb::device::cpu>;

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

// An answer as numbers: status, surface, node, body probability, point, force, covariance, pitch,
// chi2, degrees of freedom, rank, unknowns, number of candidates, then per candidate surface, node,
// probability, point, radius.
constexpr int kHead = 25, kOfCandidate = 7;
constexpr int kWidth = kHead + kOfCandidate * tl::Answer::kCandidates;
constexpr int kPerCandidate = 6;  // of an event: without the radius

inline void write(const tl::Localizer& l, const tl::Answer& a, double* out) {
  std::fill(out, out + kWidth, std::nan(""));
  out[0] = static_cast<double>(a.status);
  out[22] = a.rank;
  out[23] = a.unknowns;
  out[24] = a.count;
  out[1] = out[2] = -1.0;
  const double force[3] = {a.force.x, a.force.y, a.force.z};
  std::copy(force, force + 3, out + 7);
  if (a.count == 0) return;
  const tl::Candidate& best = a.candidates[0];
  out[1] = best.surface;
  out[2] = l.surfaces()[best.surface].node;
  out[3] = a.body_probability;
  const double point[3] = {best.point.x, best.point.y, best.point.z};
  std::copy(point, point + 3, out + 4);
  std::copy(a.covariance, a.covariance + 9, out + 10);
  out[19] = a.pitch;
  out[20] = a.chi2;
  out[21] = a.degrees;
  for (int i = 0; i < a.count; ++i) {
    const tl::Candidate& c = a.candidates[i];
    double* to = out + kHead + kOfCandidate * i;
    const double values[kOfCandidate] = {static_cast<double>(c.surface),
                                         static_cast<double>(l.surfaces()[c.surface].node),
                                         c.weight, c.point.x, c.point.y, c.point.z, c.radius};
    std::copy(values, values + kOfCandidate, to);
  }
}

inline const double* data_or_null(const std::optional<In>& a) {
  return a ? a->data() : nullptr;
}

inline Out locate(tl::Localizer& l, int segment, const In& row, const std::optional<In>& normalized,
                  const In& q, const std::optional<In>& qd,
                  const std::optional<In>& quiet) {
  l.expect(segment, row.size(), normalized ? normalized->size() : l.tests(), q.size(),
           qd ? qd->size() : q.size());
  if (quiet && quiet->size() != l.segments()) throw std::invalid_argument("one number per segment");
  l.set_state(q.data(), data_or_null(qd), data_or_null(quiet));
  std::vector<double> out(kWidth);
  write(l, l.locate(segment, row.data(), data_or_null(normalized)), out.data());
  return array(out, 1, kWidth);
}

// An event as numbers: status, time of the position, variance of the position, number of places,
// the joint positions at that time, then per place surface, node, probability, point in the
// frame of the node; the most probable body's best first.
inline void push_event(tl::Localizer& l, tl::Localizer::Memory& memory, std::vector<double>& out) {
  l.conclude(memory);
  const tl::EventPlace& event = memory.event;
  const std::size_t end = out.size() + 4 + l.joints() + kPerCandidate * tl::EventPlace::kPlaces;
  out.insert(out.end(), {static_cast<double>(l.status(memory)), event.time(), event.variance(),
                         static_cast<double>(event.count())});
  out.insert(out.end(), memory.q.begin(), memory.q.end());
  for (int i = 0; i < event.count(); ++i) {
    const tl::Place& p = event.place(i);
    const tl::LinkSurface& surface = l.surfaces()[p.surface];
    const tl::Vec3 point = surface.mesh.nearest_to_point(p.point).point;
    out.insert(out.end(), {static_cast<double>(p.surface), static_cast<double>(surface.node),
                           p.share, point.x, point.y, point.z});
  }
  out.resize(end, std::nan(""));
}

inline std::size_t event_width(const tl::Localizer& l) {
  return 7 + l.joints() + kPerCandidate * tl::EventPlace::kPlaces;
}

inline void push_event(tl::Localizer& l, std::size_t sample, std::size_t g,
                       tl::Localizer::Memory& memory, std::vector<double>& out) {
  out.insert(out.end(), {static_cast<double>(sample), static_cast<double>(g),
                         static_cast<double>(memory.serial)});
  push_event(l, memory, out);
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
  const double *row, *normalized, *levels, *quiet, *q, *qd;
};

// What comes before the answer of a contact that is followed: sample, segment, number, its share of
// the segment's load, its kind, whether it is clamped (NaN where that is not known), the rate of the
// segment's force.
constexpr int kClass = 7;

inline void write(const tl::Localizer& l, const tl::Classifier& c, std::size_t i, int g, int k,
                  double* out) {
  const tl::Answer& answer = l.reports()[k].answer;
  const double share = l.reports().share(k);
  const bool open = answer.status == tl::Status::not_separable;
  const double head[kClass] = {static_cast<double>(i),
                               static_cast<double>(g),
                               static_cast<double>(l.reports()[k].serial),
                               share,
                               static_cast<double>(c.kind(g, share)),
                               c.clamped(g, k) ? 1.0 : open ? std::nan("") : 0.0,
                               c.rate(g)};
  std::copy(head, head + kClass, out);
  write(l, answer, out + kClass);
}

// For each contact on a segment that is touched: its class and its answer; and for each event that
// ends: sample, segment, number, event.
inline void follow(tl::Localizer& l, tl::Classifier& c, std::size_t i, const FollowedSample& x,
                   std::vector<double>& answers, std::vector<double>& ended) {
  c.step(x.time, x.row, x.levels);
  bool ready = false;
  for (std::size_t g = 0; g < l.segments(); ++g) {
    const bool touched = x.levels[g] > 0.0;
    if (touched && !ready) l.set_state(x.q, x.qd, x.quiet);
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
      write(l, c, i, static_cast<int>(g), k, &*answers.end() - kClass - kWidth);
    }
  }
}

inline nb::object table(const std::vector<double>& values, std::size_t columns) {
  arrays::Out out({values.size() / columns, columns});
  std::copy(values.begin(), values.end(), out.data());
  return out.release();
}

// N samples.
inline nb::tuple follow_run(tl::Localizer& l, tl::Classifier& c, nb::handle time,
                            nb::handle rows, nb::handle normalized, nb::handle levels,
                            nb::handle quiet, nb::handle q, nb::handle qd) {
  const std::size_t n = l.joints(), m = l.segments(), r = l.tests(), width = l.width();
  const std::size_t count = arrays::length(time);
  const double* stamps = arrays::numbers(time, {count});
  FollowedSample x{0.0, arrays::numbers(rows, {count, width}),
                   arrays::numbers(normalized, {count, r}), arrays::numbers(levels, {count, m}),
                   arrays::numbers(quiet, {count, m}), arrays::numbers(q, {count, n}),
                   arrays::numbers(qd, {count, n})};
  std::vector<double> answers, ended;
  {
    nb::gil_scoped_release release;
    for (std::size_t i = 0; i < count; ++i) {
      x.time = stamps[i];
      follow(l, c, i, x, answers, ended);
      x = {0.0, x.row + width, x.normalized + r, x.levels + m, x.quiet + m, x.q + n, x.qd + n};
    }
  }
  return nb::make_tuple(table(answers, kClass + kWidth), table(ended, event_width(l)));
}

// One sample.
inline nb::tuple follow_sample(tl::Localizer& l, tl::Classifier& c, double time, nb::handle row,
                               nb::handle normalized, nb::handle levels, nb::handle quiet,
                               nb::handle q, nb::handle qd) {
  const std::size_t n = l.joints(), m = l.segments();
  const FollowedSample x{time, arrays::numbers(row, {l.width()}),
                         arrays::numbers(normalized, {l.tests()}), arrays::numbers(levels, {m}),
                         arrays::numbers(quiet, {m}), arrays::numbers(q, {n}),
                         arrays::numbers(qd, {n})};
  std::vector<double> answers, ended;
  answers.reserve(4 * (kClass + kWidth));
  follow(l, c, 0, x, answers, ended);
  return nb::make_tuple(table(answers, kClass + kWidth), table(ended, event_width(l)));
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
      .def("wrench_covariance", [](tl::Localizer& l, const In& q, const In& row, int segment) {
        l.expect(segment, row.size(), l.tests(), q.size(), q.size());
        l.set_state(q.data(), nullptr, nullptr);
        std::vector<double> out(36);
        if (!l.wrench_covariance(segment, row.data(), out.data()))
          throw std::invalid_argument("the segment has no wrench");
        return array(out, 6, 6);
      })
      .def("locate", &locate, "segment"_a, "row"_a, "normalized"_a.none(), "q"_a, "qd"_a.none(),
           "quiet"_a.none())
      .def("region", &region)
      .def("events", &events)
      .def("follow", &follow_run, "classifier"_a, "time"_a, "rows"_a, "normalized"_a, "levels"_a, "quiet"_a,
           "q"_a, "qd"_a)
      .def("follow_sample", &follow_sample);
}

}  // namespace contact
