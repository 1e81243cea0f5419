// SPDX-License-Identifier: Apache-2.0
// The native core for Python: thin, no logic of its own. Compiled twice: as it is, for any
// processor, and by bindings_avx2.cpp.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "classifier_bindings.hpp"
#include "detector_bindings.hpp"
#include "estimates.hpp"
#include "guard.hpp"
#include "live_bindings.hpp"
#include "localizer_bindings.hpp"
#include "mesh_bindings.hpp"
#include "pipeline_bindings.hpp"
#include "ros_bindings.hpp"
#include "samples.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/version.hpp"

// Types for the stub; what is not an array of float64 of the right shape is a TypeError.
#define TOUCHLINE_ARRAY "numpy.typing.NDArray[numpy.float64]"
#define TOUCHLINE_SIGNALS "q: object, qd: object, tau: object, wrench: object"

namespace touchline::bindings {

namespace {

namespace nb = nanobind;
namespace tl = touchline;
using namespace nb::literals;

tl::Vec3 vec3(const std::vector<double>& v) {
  if (v.size() != 3) throw std::invalid_argument("three numbers are needed");
  return {v[0], v[1], v[2]};
}

// From nine numbers, row by row.
tl::Mat3 mat3(const std::vector<double>& m) {
  if (m.size() != 9) throw std::invalid_argument("nine numbers are needed");
  return {{m[0], m[3], m[6]}, {m[1], m[4], m[7]}, {m[2], m[5], m[8]}};
}

using Observer = guard::Shared<tl::Observer>;

void step(Observer& o, double time, nb::handle q, nb::handle qd, nb::handle tau,
          nb::handle wrench) {
  const tl::Sample in = samples::one(o.value.row_layout(), time, q, qd, tau, wrench);
  const guard::Turn turn(o.turn);
  o.value.step(in);
}

nb::object run(Observer& o, nb::handle time, nb::handle q, nb::handle qd, nb::handle tau,
               nb::handle wrench) {
  const samples::Many in = samples::many(o.value.row_layout(), time, q, qd, tau, wrench);
  arrays::Out out({in.rows, o.value.output().size()});
  {
    const guard::Turn turn(o.turn);
    nb::gil_scoped_release release;
    o.value.run(in.rows, in.time, in.first.q, in.first.qd, in.first.tau, in.first.wrench,
                out.data());
  }
  return out.release();
}

// Momentum and n-bar: joint rows, then six rows per sensor in its own frame.
nb::tuple terms(Observer& shared, nb::handle q, nb::handle qd) {
  tl::Observer& o = shared.value;
  const tl::RowLayout& layout = o.row_layout();
  const std::size_t joints = layout.joints, size = joints + 6 * layout.sensors;
  const double* speeds = arrays::numbers(qd, {joints});
  tl::Terms<double>& model = o.terms();
  const double* positions = arrays::numbers(q, {joints});
  arrays::Out p({size}), n({size});
  const guard::Turn turn(shared.turn);
  model.sweep(positions, speeds);
  for (std::size_t j = 0; j < joints; ++j)
    model.joint_row(j, speeds[j], p.data()[j], n.data()[j]);
  for (int s = 0; s < layout.sensors; ++s) {
    tl::Spatial momentum, bias;
    model.sensor_row(s, momentum, bias);
    tl::store(momentum, p.data() + joints + 6 * s);
    tl::store(bias, n.data() + joints + 6 * s);
  }
  return nb::make_tuple(p.release(), n.release());
}

// Poses (n_nodes, 4, 4) of all nodes in world.
nb::object poses(Observer& shared, nb::handle q) {
  tl::Observer& o = shared.value;
  const std::size_t n = o.row_layout().joints, count = o.tree().nodes().size();
  const std::vector<double> rest(n, 0.0);
  const double* positions = arrays::numbers(q, {n});
  arrays::Out out({count, 4, 4});
  const guard::Turn turn(shared.turn);
  o.terms().sweep(positions, rest.data());
  for (std::size_t i = 0; i < count; ++i) {
    const tl::NodeState<double>& state = o.terms().state().node(static_cast<int>(i));
    const tl::Pose X{tl::plain(state.R), tl::plain(state.p)};
    const double rows[16] = {X.R.x.x, X.R.y.x, X.R.z.x, X.p.x, X.R.x.y, X.R.y.y, X.R.z.y, X.p.y,
                             X.R.x.z, X.R.y.z, X.R.z.z, X.p.z, 0.0,     0.0,     0.0,     1.0};
    std::copy(rows, rows + 16, out.data() + 16 * i);
  }
  return out.release();
}

nb::dict row_slices(const Observer& o) {
  const tl::RowLayout& l = o.value.row_layout();
  nb::dict d;
  const auto add = [&d](const char* name, int start, int size) {
    d[name] = nb::make_tuple(start, start + size);
  };
  add("tau_ext", l.tau_ext(), l.joints);
  add("segment_torque", l.segment_torque(), l.joints);
  add("parity", l.parity(), l.joints);
  add("joint_innovation", l.joint_innovation(), l.joints);
  add("sensor_wrench", l.sensor_wrench(), 6 * l.sensors);
  add("segment_wrench", l.segment_wrench(), 6 * l.segments);
  add("segment_innovation", l.segment_innovation(), 6 * l.segments);
  add("joint_settled", l.joint_settled(), l.joints);
  add("segment_settled", l.segment_settled(), l.segments);
  add("joint_gap_std", l.joint_gap_std(), l.joints);
  add("segment_gap_std", l.segment_gap_std(), 2 * l.segments);
  add("health", l.health(), 1);
  return d;
}

tl::Node make_node(int parent, tl::NodeKind kind, const std::vector<double>& R,
                   const std::vector<double>& p, double mass, const std::vector<double>& com,
                   const std::vector<double>& inertia, int coordinate, double multiplier,
                   double offset) {
  return {parent,    kind,          {mat3(R), vec3(p)}, mass,  vec3(com),
          mat3(inertia), coordinate, multiplier,        offset};
}

template <std::size_t N, class T>
void copy_to(T (&target)[N], const std::vector<T>& source) {
  if (source.size() != N) throw std::invalid_argument("six values are needed");
  std::copy(source.begin(), source.end(), target);
}

void bind_rows(nb::module_& m) {
  nb::class_<tl::Node>(m, "Node").def_ro("parent", &tl::Node::parent);
  m.def("node", &make_node, "parent"_a, "kind"_a, "R"_a, "p"_a, "mass"_a, "com"_a, "inertia"_a,
        "coordinate"_a, "multiplier"_a, "offset"_a);
  nb::class_<tl::JointRow>(m, "JointRow")
      .def(nb::init<>())
      .def_rw("torque", &tl::JointRow::torque)
      .def_rw("compensated", &tl::JointRow::compensated)
      .def_rw("sign", &tl::JointRow::sign)
      .def_rw("gain", &tl::JointRow::gain)
      .def_rw("bias", &tl::JointRow::bias)
      .def_rw("range", &tl::JointRow::range)
      .def_rw("rotor_inertia", &tl::JointRow::rotor_inertia)
      .def_rw("coulomb", &tl::JointRow::coulomb)
      .def_rw("viscous", &tl::JointRow::viscous)
      .def_rw("coulomb_width", &tl::JointRow::coulomb_width)
      .def_rw("stribeck", &tl::JointRow::stribeck)
      .def_rw("stribeck_speed", &tl::JointRow::stribeck_speed)
      .def("set_rest",
           [](tl::JointRow& joint, const std::vector<double>& q, const std::vector<double>& qd,
              const std::vector<double>& torque) {
             const tl::LearnedRest rest{q, qd, torque};
             if (!rest.sound()) throw std::invalid_argument("a learned rest has no sound table");
             joint.rest = rest;
           },
           "q"_a, "qd"_a, "torque"_a)
      .def_rw("lower", &tl::JointRow::lower)
      .def_rw("upper", &tl::JointRow::upper)
      .def_rw("bandwidth", &tl::JointRow::bandwidth)
      .def_rw("nodes", &tl::JointRow::nodes)
      .def_rw("sources", &tl::JointRow::sources);
  nb::class_<tl::SensorRow>(m, "SensorRow")
      .def(nb::init<>())
      .def_rw("node", &tl::SensorRow::node)
      .def_rw("sign", &tl::SensorRow::sign)
      .def_rw("turned", &tl::SensorRow::turned)
      .def_rw("log_node", &tl::SensorRow::log_node)
      .def_rw("gravity_compensated", &tl::SensorRow::gravity_compensated)
      .def_rw("bandwidth", &tl::SensorRow::bandwidth)
      .def("set_log_rotation",
           [](tl::SensorRow& s, const std::vector<double>& R) { s.R_node_log = mat3(R); })
      .def("set_axes", [](tl::SensorRow& s, const std::vector<bool>& axes) {
        if (axes.size() != 6) throw std::invalid_argument("six values are needed");
        std::copy(axes.begin(), axes.end(), s.axes);
      })
      .def("set_bias", [](tl::SensorRow& s, const std::vector<double>& v) { copy_to(s.bias, v); })
      .def("set_range",
           [](tl::SensorRow& s, const std::vector<double>& v) { copy_to(s.range, v); });
}

void bind_enums(nb::module_& m) {
  nb::enum_<tl::NodeKind>(m, "NodeKind")
      .value("fixed", tl::NodeKind::fixed)
      .value("revolute", tl::NodeKind::revolute)
      .value("prismatic", tl::NodeKind::prismatic);
  nb::enum_<tl::Torque>(m, "Torque")
      .value("sensor", tl::Torque::sensor)
      .value("motor", tl::Torque::motor)
      .value("none", tl::Torque::none)
      .value("from_sensors", tl::Torque::from);
  nb::enum_<tl::Compensated>(m, "Compensated")
      .value("none", tl::Compensated::none)
      .value("gravity", tl::Compensated::gravity)
      .value("model", tl::Compensated::model);
  nb::enum_<tl::Method>(m, "Method")
      .value("segment", tl::Method::segment)
      .value("paper", tl::Method::paper);
  nb::enum_<tl::Discretization>(m, "Discretization")
      .value("automatic", tl::Discretization::automatic)
      .value("tustin", tl::Discretization::tustin)
      .value("exponential", tl::Discretization::exponential);
}

}  // namespace

void bind(nanobind::module_& m) {
  arrays::initialize();
  m.attr("VERSION") = tl::kVersion;
  bind_enums(m);
  bind_rows(m);
  classification::bind(m);
  meshes::bind(m);
  localization::bind(m);
  detection::bind(m);
  pipelines::bind(m);
  m.def("view", nb::overload_cast<nb::handle, nb::handle, std::size_t>(&arrays::view), "rows"_a,
        "part"_a, "columns"_a,
        nb::sig("def view(rows: " TOUCHLINE_ARRAY ", part: slice, columns: int) -> " TOUCHLINE_ARRAY));
  m.def("whole", nb::overload_cast<nb::handle, nb::handle>(&arrays::whole), "row"_a, "part"_a,
        nb::sig("def whole(row: " TOUCHLINE_ARRAY ", part: slice) -> int"));
  live::bind(m);
  live::bind_ros(m);
  nb::class_<Observer>(m, "Observer")
      .def("__init__",
           [](Observer* self, std::vector<tl::Node> nodes, const std::vector<double>& gravity,
              std::vector<tl::JointRow> joints, std::vector<tl::SensorRow> sensors,
              tl::Method method, tl::Discretization discretization) {
             new (self) Observer(tl::Tree(std::move(nodes), vec3(gravity)), std::move(joints),
                                     std::move(sensors), method, discretization);
           })
      .def("step", &step, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def step(self, time: float, " TOUCHLINE_SIGNALS ") -> None"))
      .def("run", &run, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def run(self, time: object, " TOUCHLINE_SIGNALS ") -> " TOUCHLINE_ARRAY))
      .def("terms", &terms, "q"_a, "qd"_a,
           nb::sig("def terms(self, q: object, qd: object) -> "
                   "tuple[" TOUCHLINE_ARRAY ", " TOUCHLINE_ARRAY "]"))
      .def("poses", &poses, "q"_a, nb::sig("def poses(self, q: object) -> " TOUCHLINE_ARRAY))
      .def("reset",
           [](Observer& o) {
             const guard::Turn turn(o.turn);
             o.value.reset();
           })
      .def_prop_ro("slices", &row_slices,
                   nb::sig("def slices(self, /) -> dict[str, tuple[int, int]]"))
      .def_prop_ro("segment_sensors", [](const Observer& o) {
        std::vector<int> sensors;
        for (const tl::Segment& s : o.value.layout().segments) sensors.push_back(s.sensor);
        return sensors;
      });
  estimates::bind(m);
}

}  // namespace touchline::bindings
