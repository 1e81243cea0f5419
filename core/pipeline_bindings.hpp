// SPDX-License-Identifier: Apache-2.0
// The pipeline for Python: one native call per sample, or one for many.
#pragma once

#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <cstdint>
#include <functional>
#include <iterator>
#include <limits>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "at_once.hpp"
#include "fields.hpp"
#include "guard.hpp"
#include "localizer_bindings.hpp"
#include "samples.hpp"
#include "touchline/redundant.hpp"
#include "touchline/touchline.hpp"

namespace touchline::pipelines {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

// Each number of a tuning: its name with the module, its unit, and its value.
inline nb::list numbers(const tl::Tuning& tuning) {
  nb::list all;
  tl::Tuning::visit(tuning, [&](const char* module, const char* name, const char* unit,
      auto value) {
    all.append(nb::make_tuple(std::string(module) + "." + name, unit, value));
  });
  return all;
}

// Sets one of them; false if there is none of that name.
inline bool set_number(tl::Tuning& tuning, const std::string& wanted, double to) {
  bool found = false;
  tl::Tuning::visit(tuning, [&](const char* module, const char* name, const char*, auto& value) {
    if (std::string(module) + "." + name != wanted) return;
    value = static_cast<std::decay_t<decltype(value)>>(to);
    found = true;
  });
  return found;
}

// Transitions between the states of the segments' contacts so far: from, to, how often.
inline nb::list transitions(const tl::RedundantPipeline& p) {
  nb::list all;
  for (std::size_t g = 0; g < p.robot().segment_names.size(); ++g) {
    const tl::TrackingState& state = p.tracking(static_cast<int>(g));
    for (int i = 0; i < tl::kTrackings; ++i) {
      for (int j = 0; j < tl::kTrackings; ++j) {
        const auto from = static_cast<tl::Tracking>(i), to = static_cast<tl::Tracking>(j);
        if (const std::uint32_t times = state.count(from, to); times > 0)
          all.append(nb::make_tuple(tl::name_of(from), tl::name_of(to), times));
      }
    }
  }
  return all;
}

// The pipeline, and what a user of Python may ask for later: the events that have ended.
struct Pipeline {
  Pipeline(tl::Robot robot, const tl::Tuning& tuning)
      : value(std::make_unique<tl::RedundantPipeline>(std::move(robot), tuning)),
        unmeasured(value->robot().joints.size() + 6 * value->robot().sensors.size(), tl::kUnknown) {}

  std::unique_ptr<tl::RedundantPipeline> value;
  std::mutex turn;
  std::vector<double> ended;       // numbers of events, one after the other
  std::size_t most = std::numeric_limits<std::size_t>::max();  // of them that are kept at least
  std::size_t forgotten = 0;       // events before those in `ended`
  std::vector<double> closed;      // of changes that a restart made, for the next sample to tell
  std::vector<double> unmeasured;  // NaN for each torque and wrench
  std::vector<double> snapshot;    // of the last sample, on its way to Python
  // Told of each sample that is felt one at a time, before Python sees it; empty: nobody is.
  std::function<void(const tl::Sample&, const tl::Result&)> told;
};

// Where the parts of a snapshot stand: the observer's row with the health of the pipeline, what the
// detector says, the faults of channels, and the resets of estimates. Then the sample's time and
// joint positions, and how many contacts and changes of events follow.
struct Snapshot {
  explicit Snapshot(const tl::RedundantPipeline& p)
      : width(p.row_layout().width()),
        segments(p.row_layout().segments),
        rows(p.rows()),
        levels(width),
        normalized(levels + segments),
        drift(normalized + rows),
        quiet(drift + rows),
        watch(quiet + segments),
        faults(watch + segments),
        ratios(faults + p.channels().count()),
        resets(ratios + p.channels().count()),
        time(resets + kOfReset * p.resets().size()),
        q(time + 1),
        contacts(q + p.row_layout().joints),
        changes(contacts + 1),
        end(changes + 1) {}
  std::size_t width, segments, rows;
  static constexpr std::size_t kOfReset = 7;  // its count, its jump

  std::size_t levels, normalized, drift, quiet, watch, faults, ratios, resets, time, q, contacts,
      changes, end;
};

inline void write_row(const tl::Result& result, const tl::RowLayout& layout, double* out) {
  const tl::Span<double> row = result.estimate.row();
  std::copy(row.begin(), row.end(), out);
  out[layout.health()] = static_cast<double>(result.health);
}

inline double* write_watch(const tl::Result& result, double* out) {
  for (const tl::Watch watch : result.watch) *out++ = static_cast<double>(watch);
  return out;
}

inline double* write_reset(const tl::Reset& reset, double* out) {
  *out++ = static_cast<double>(reset.count);
  return std::copy(std::begin(reset.jump), std::end(reset.jump), out);
}

// Keeps the events that a sample has ended.
inline void keep_ended(Pipeline& p, const tl::Result& result) {
  for (const tl::EventChange& change : result.events) {
    if (change.happened != tl::Happened::ended) continue;
    p.ended.resize(p.ended.size() + fields::width<tl::Event>());
    tl::write_numbers(change.event, &*p.ended.end() - fields::width<tl::Event>());
  }
  const std::size_t width = fields::width<tl::Event>(), kept = p.ended.size() / width;
  if (kept / 2 <= p.most) return;
  p.ended.erase(p.ended.begin(), p.ended.end() - static_cast<std::ptrdiff_t>(p.most * width));
  p.forgotten += kept - p.most;
}

// How many numbers the snapshot of a sample has.
inline std::size_t size_of_snapshot(const Pipeline& of, const tl::Result& result) {
  return Snapshot(*of.value).end + result.contacts.size() * fields::width<tl::Contact>() +
         result.events.size() * (fields::width<tl::Event>() + 1) + of.closed.size();
}

inline void take_snapshot(Pipeline& of, const tl::Sample& sample, const tl::Result& result, double* out) {
  const tl::RedundantPipeline& p = *of.value;
  const Snapshot at(p);
  const std::size_t event = fields::width<tl::Event>() + 1;
  write_row(result, p.row_layout(), out);
  std::copy(result.levels.begin(), result.levels.end(), out + at.levels);
  std::copy(result.normalized.begin(), result.normalized.end(), out + at.normalized);
  std::copy(result.drift.begin(), result.drift.end(), out + at.drift);
  std::copy(result.quiet.begin(), result.quiet.end(), out + at.quiet);
  write_watch(result, out + at.watch);
  for (std::size_t c = 0; c < result.faults.size(); ++c)
    out[at.faults + c] = static_cast<double>(result.faults[c]);
  std::copy(result.ratios.begin(), result.ratios.end(), out + at.ratios);
  double* reset = out + at.resets;
  for (const tl::Reset& r : result.resets) reset = write_reset(r, reset);
  out[at.time] = sample.time;
  std::copy_n(sample.q, at.contacts - at.q, out + at.q);
  out[at.contacts] = static_cast<double>(result.contacts.size());
  out[at.changes] = static_cast<double>(result.events.size() + of.closed.size() / event);
  double* to = out + at.end;
  for (const tl::Contact& c : result.contacts) to = tl::write_numbers(c, to);
  to = std::copy(of.closed.begin(), of.closed.end(), to);
  of.closed.clear();
  for (const tl::EventChange& change : result.events) {
    *to++ = static_cast<double>(change.happened);
    to = tl::write_numbers(change.event, to);
  }
}

inline nb::object update(Pipeline& p, double time, nb::handle q, nb::handle qd, nb::handle tau,
                         nb::handle wrench) {
  const tl::RowLayout& layout = p.value->row_layout();
  const std::size_t n = layout.joints, k = layout.sensors;
  const double* missing = p.unmeasured.data();
  const tl::Sample sample{time, arrays::numbers(q, {n}), arrays::numbers(qd, {n}),
                          arrays::numbers_or(tau, {n}, missing),
                          arrays::numbers_or(wrench, {k, 6}, missing)};
  // A new array may run any code of Python, so none is made within a turn: one for a sample without
  // contacts before it, and one for all else after it.
  const std::size_t room = Snapshot(*p.value).end;
  arrays::Out plain({room});
  std::vector<double> numbers;
  {
    const guard::Turn turn(p.turn);
    const tl::Result result = p.value->update(sample);
    if (p.told) p.told(sample, result);
    keep_ended(p, result);
    const std::size_t size = size_of_snapshot(p, result);
    if (size == room) {
      take_snapshot(p, sample, result, plain.data());
      return plain.release();
    }
    numbers.swap(p.snapshot);
    numbers.resize(size);
    take_snapshot(p, sample, result, numbers.data());
  }
  const nb::object out = arrays::line(numbers);
  numbers.swap(p.snapshot);
  return out;
}

// A pipeline each of whose updates makes an instance of a class. It works out its fields when they are
// asked for, from the numbers of the sample and `layout`, where they stand.
struct Resulting {
  Pipeline& pipeline;
  nb::object type, layout;
  nb::object source = at_once::interned("_source");

  nb::object update(double time, nb::handle q, nb::handle qd, nb::handle tau, nb::handle wrench) {
    const nb::object numbers = pipelines::update(pipeline, time, q, qd, tau, wrench);
    const nb::object result =
        nb::steal(PyType_GenericAlloc(reinterpret_cast<PyTypeObject*>(type.ptr()), 0));
    const nb::object from = nb::steal(PyTuple_Pack(2, numbers.ptr(), layout.ptr()));
    if (!result.is_valid() || !from.is_valid() ||
        PyObject_GenericSetAttr(result.ptr(), source.ptr(), from.ptr()) < 0)
      throw nb::python_error();
    return result;
  }
};

// N samples: rows of the observer, what the detector says of each, and contacts: the sample, then
// the numbers of the contact.
inline nb::tuple run(Pipeline& p, nb::handle time, nb::handle q, nb::handle qd, nb::handle tau,
                     nb::handle wrench) {
  const samples::Many in = samples::many(p.value->row_layout(), time, q, qd, tau, wrench);
  const Snapshot at(*p.value);
  arrays::Out rows({in.rows, at.width}), levels({in.rows, at.segments}),
      normalized({in.rows, at.rows}), drift({in.rows, at.rows}), quiet({in.rows, at.segments}),
      watch({in.rows, at.segments});
  std::vector<double> contacts, faults, resets;
  std::vector<tl::Fault> before(p.value->channels().count(), tl::Fault::none);
  const std::size_t contact = fields::width<tl::Contact>() + 1;
  double *level = levels.data(), *x = normalized.data(), *y = drift.data(), *since = quiet.data(),
         *watched = watch.data();
  {
    const guard::Turn turn(p.turn);
    const tl::Span<tl::Reset> so_far = p.value->resets();
    std::vector<std::uint32_t> counts(so_far.size());
    for (std::size_t k = 0; k < counts.size(); ++k) counts[k] = so_far[k].count;
    nb::gil_scoped_release release;
    std::size_t i = 0;
    const auto each = [&](const tl::Result& result) {
      level = std::copy(result.levels.begin(), result.levels.end(), level);
      x = std::copy(result.normalized.begin(), result.normalized.end(), x);
      y = std::copy(result.drift.begin(), result.drift.end(), y);
      since = std::copy(result.quiet.begin(), result.quiet.end(), since);
      watched = write_watch(result, watched);
      for (const tl::Contact& c : result.contacts) {
        contacts.resize(contacts.size() + contact);
        double* to = &*contacts.end() - contact;
        *to = static_cast<double>(i);
        tl::write_numbers(c, to + 1);
      }
      for (std::size_t c = 0; c < before.size(); ++c) {
        if (result.faults[c] == before[c]) continue;
        before[c] = result.faults[c];
        faults.insert(faults.end(), {static_cast<double>(i), static_cast<double>(c),
                                     static_cast<double>(before[c]), result.ratios[c]});
      }
      for (std::size_t k = 0; k < counts.size(); ++k) {
        if (result.resets[k].count == counts[k]) continue;
        counts[k] = result.resets[k].count;
        resets.insert(resets.end(), {static_cast<double>(i), static_cast<double>(k)});
        resets.resize(resets.size() + Snapshot::kOfReset);
        write_reset(result.resets[k], &*resets.end() - Snapshot::kOfReset);
      }
      keep_ended(p, result);
      const std::size_t health = i * at.width + p.value->row_layout().health();
      rows.data()[health] = static_cast<double>(result.health);
      ++i;
    };
    p.value->run(in.rows, in.time, in.first, rows.data(), each);
  }
  return nb::make_tuple(rows.release(), levels.release(), normalized.release(), drift.release(),
                        quiet.release(), watch.release(), arrays::table(contacts, contact),
                        arrays::table(faults, 4), arrays::table(resets, Snapshot::kOfReset + 2));
}

// The events that have ended, from number `from` of them on as far as they are kept, and those that
// last; and how many have ended so far.
inline nb::tuple events(Pipeline& p, std::size_t from) {
  const std::size_t width = fields::width<tl::Event>();
  std::vector<double> ended, lasting;
  std::size_t count = 0;
  {
    const guard::Turn turn(p.turn);
    const std::size_t skipped = std::max(from, p.forgotten) - p.forgotten;
    ended.assign(p.ended.begin() + std::min(skipped * width, p.ended.size()), p.ended.end());
    count = p.forgotten + p.ended.size() / width;
    p.value->visit_lasting([&](const tl::Event& event) {
      lasting.resize(lasting.size() + width);
      tl::write_numbers(event, &*lasting.end() - width);
    });
  }
  return nb::make_tuple(arrays::table(ended, width), arrays::table(lasting, width), count);
}

// Begins anew with the same robot but other figures, of its biases or loads. Events that last end
// with the last sample; the numbers of events go on. `same`: the robot is that of before.
inline void restart(Pipeline& p, tl::Robot robot, bool same) {
  std::vector<tl::StandIn> kept;
  if (same) kept.swap(robot.stand_ins);
  auto fresh = std::make_unique<tl::RedundantPipeline>(std::move(robot), p.value->tuning());
  const tl::Robot &before = p.value->robot(), &now = fresh->robot();
  if (now.joint_names != before.joint_names || now.sensor_names != before.sensor_names ||
      now.links.size() != before.links.size() || now.rows.size() != before.rows.size())
    throw std::invalid_argument("a pipeline goes on with the same joints, sensors and links");
  const guard::Turn turn(p.turn);
  p.value->visit_lasting([&p](tl::Event event) {
    event.cleared = p.value->time();
    const std::size_t width = fields::width<tl::Event>();
    p.ended.resize(p.ended.size() + width);
    tl::write_numbers(event, &*p.ended.end() - width);
    p.closed.push_back(static_cast<double>(tl::Happened::ended));
    p.closed.resize(p.closed.size() + width);
    tl::write_numbers(event, &*p.closed.end() - width);
  });
  fresh->number_events_from(p.value->next_event());
  fresh->count_resets_from(*p.value);
  if (same) fresh->take_stand_ins(*p.value, std::move(kept));
  p.value.swap(fresh);
}

// For how long the arm has been at rest, untouched [s]; the mean torques (n) and wrenches (6 k) felt
// since.
inline nb::tuple rest(Pipeline& p) {
  const guard::Turn turn(p.turn);
  const tl::RestMeter& meter = p.value->rest();
  return nb::make_tuple(meter.seconds(), meter.torque(), meter.wrench());
}

// Per row of the detector: what stood there at the start, stands there now and has drifted; seen
// noise, its ratio.
inline nb::object standing(Pipeline& p) {
  std::vector<double> numbers;
  {
    const guard::Turn turn(p.turn);
    for (std::size_t i = 0; i < p.value->rows(); ++i) {
      const tl::Standing s = p.value->standing(static_cast<int>(i));
      numbers.insert(numbers.end(), {s.start, s.now, s.drift, s.seen, s.ratio});
    }
  }
  return arrays::table(numbers, 5);
}

inline nb::dict slices(const Pipeline& p) {
  const Snapshot at(*p.value);
  nb::dict d;
  const auto add = [&d](const char* name, std::size_t begin, std::size_t end) {
    d[name] = nb::make_tuple(begin, end);
  };
  add("row", 0, at.width);
  add("levels", at.levels, at.normalized);
  add("normalized", at.normalized, at.drift);
  add("drift", at.drift, at.quiet);
  add("quiet", at.quiet, at.watch);
  add("watch", at.watch, at.faults);
  add("faults", at.faults, at.ratios);
  add("ratios", at.ratios, at.resets);
  add("resets", at.resets, at.time);
  add("time", at.time, at.q);
  add("q", at.q, at.contacts);
  add("counts", at.contacts, at.end);
  add("contact", 0, fields::width<tl::Contact>());
  add("event", 0, fields::width<tl::Event>());
  return d;
}

inline tl::Link link(std::string name, std::string body, tl::Zone zone,
                     const std::vector<double>& R, const std::vector<double>& p) {
  if (R.size() != 9 || p.size() != 3) throw std::invalid_argument("nine and three numbers are needed");
  return {std::move(name), std::move(body), zone,
          {{{R[0], R[3], R[6]}, {R[1], R[4], R[7]}, {R[2], R[5], R[8]}}, {p[0], p[1], p[2]}}};
}

inline void bind(nb::module_& m) {
  fields::bind(m);
  nb::enum_<tl::Zone>(m, "Zone")
      .value("structure", tl::Zone::structure)
      .value("end_effector", tl::Zone::end_effector)
      .value("handle", tl::Zone::handle)
      .value("open", tl::Zone::open);
  nb::class_<tl::Link>(m, "Link");
  m.def("link", &link, "name"_a, "body"_a, "zone"_a, "R"_a, "p"_a);
  nb::class_<tl::Tuning>(m, "Tuning")
      .def(nb::init<>())
      .def_rw("method", &tl::Tuning::method)
      .def_rw("discretization", &tl::Tuning::discretization)
      .def_rw("first_entry", &tl::Tuning::first_entry)
      .def("numbers", &numbers, nb::sig("def numbers(self) -> list[tuple[str, str, float]]"))
      .def("set_number", &set_number, "name"_a, "value"_a);
  nb::class_<tl::Pushes>(m, "Pushes")
      .def(nb::init<>())
      .def("__init__",
           [](tl::Pushes* self, double friction, double reach) {
             new (self) tl::Pushes{friction, reach};
           },
           "friction"_a, "reach"_a)
      .def_ro("friction", &tl::Pushes::friction)
      .def_ro("reach", &tl::Pushes::reach);
  nb::class_<tl::Robot>(m, "Robot")
      .def(nb::init<>())
      .def_rw("name", &tl::Robot::name)
      .def_rw("nodes", &tl::Robot::nodes)
      .def_rw("joints", &tl::Robot::joints)
      .def_rw("sensors", &tl::Robot::sensors)
      .def_rw("joint_names", &tl::Robot::joint_names)
      .def_rw("sensor_names", &tl::Robot::sensor_names)
      .def_rw("segment_names", &tl::Robot::segment_names)
      .def_rw("rows", &tl::Robot::rows)
      .def_rw("detection", &tl::Robot::detection)
      .def_rw("noise", &tl::Robot::noise)
      .def_rw("blows", &tl::Robot::blows)
      .def_rw("segment_zones", &tl::Robot::segment_zones)
      .def_rw("surfaces", &tl::Robot::surfaces)
      .def_rw("links", &tl::Robot::links)
      .def_rw("pushes", &tl::Robot::pushes)
      .def_rw("stand_ins", &tl::Robot::stand_ins)
      .def("set_gravity",
           [](tl::Robot& robot, double x, double y, double z) { robot.gravity = {x, y, z}; })
      .def("check", [](const tl::Robot& robot) { tl::check(robot); })
      .def("to_bytes", [](const tl::Robot& robot) {
        const std::string content = tl::robot_bytes(robot);
        return nb::bytes(content.data(), content.size());
      });
  nb::list turns;
  for (const tl::Turn& turn : tl::kTurns)
    turns.append(nb::make_tuple(tl::name_of(turn.from), tl::name_of(turn.to), turn.why));
  m.attr("TURNS") = nb::tuple(turns);
  nb::enum_<tl::Watch>(m, "Watch")
      .value("watched", tl::Watch::watched)
      .value("degraded", tl::Watch::degraded)
      .value("blind", tl::Watch::blind);
  nb::class_<tl::StandIn>(m, "StandIn")
      .def(
          "__init__",
          [](tl::StandIn* self, std::vector<int> lost, const tl::Robot& robot,
             std::vector<int> sensors, std::vector<int> segments, std::vector<int> rows,
             std::vector<tl::Watch> watch) {
            new (self) tl::StandIn{std::move(lost),     robot,           std::move(sensors),
                                   std::move(segments), std::move(rows), std::move(watch)};
          },
          "lost"_a, "robot"_a, "sensors"_a, "segments"_a, "rows"_a, "watch"_a);
  m.attr("FAULTS") = nb::make_tuple("none", "spike", "step", "wild", "stuck", "disagrees", "suspect",
                                   "absent");
  nb::exception<tl::RobotFileError>(m, "RobotFileError", PyExc_ValueError);
  m.def("read_robot", &tl::read_robot, "path"_a);
  nb::class_<Pipeline>(m, "Pipeline")
      .def(
          "__init__",
          [](Pipeline* self, const tl::Robot& robot, const tl::Tuning& tuning) {
            new (self) Pipeline(robot, tuning);
          },
          "robot"_a, "tuning"_a)
      .def("run", &run, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a)
      .def("events", &events, "since"_a)
      .def("restart", &restart, "robot"_a, "same"_a = false)
      .def("keep", [](Pipeline& p, std::size_t most) {
             const guard::Turn turn(p.turn);
             p.most = most;
           }, "most"_a)
      .def_prop_ro("lost", [](const Pipeline& p) { return p.value->lost(); })
      .def("rest", &rest)
      .def("transitions", [](const Pipeline& p) { return transitions(*p.value); },
           nb::sig("def transitions(self) -> list[tuple[str, str, int]]"))
      .def("standing", &standing, nb::sig("def standing(self) -> numpy.typing.NDArray[numpy.float64]"))
      .def_prop_ro("time", [](const Pipeline& p) { return p.value->time(); })
      .def("region",
           [](Pipeline& p) {
             const guard::Turn turn(p.turn);
             return localization::region(p.value->region());
           })
      .def_prop_ro("slices", &slices);
  nb::class_<Resulting>(m, "Resulting")
      .def("__init__",
           [](Resulting* self, Pipeline& pipeline, nb::object type, nb::object layout) {
             new (self) Resulting{pipeline, type, layout};
           },
           nb::keep_alive<1, 2>(), "pipeline"_a, "type"_a, "layout"_a)
      .def("update", &Resulting::update, "time"_a, "q"_a, "qd"_a, "tau"_a.none(), "wrench"_a.none())
      .def_static("take_over", &at_once::take_over<Resulting>, "type"_a,
                  nb::sig("def take_over(type: type) -> None"));

}

}  // namespace touchline::pipelines
