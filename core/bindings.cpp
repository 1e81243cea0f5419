// SPDX-License-Identifier: Apache-2.0
// The native core for Python: thin, no logic of its own.
#include <nanobind/nanobind.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>

#include <algorithm>
#include <stdexcept>
#include <utility>
#include <vector>

#include "arrays.hpp"
#include "contact_bindings.hpp"
#include "touchline/detector.hpp"
#include "touchline/observer.hpp"

// Types for the stub; what is not an array of float64 of the right shape is a TypeError.
#define TOUCHLINE_ARRAY "numpy.typing.NDArray[numpy.float64]"
#define TOUCHLINE_SIGNALS "q: object, qd: object, tau: object, wrench: object"

namespace nb = nanobind;
using namespace nb::literals;
namespace tl = touchline;

namespace {

tl::Vec3 vec3(const std::vector<double>& v) {
  if (v.size() != 3) throw std::invalid_argument("three numbers are needed");
  return {v[0], v[1], v[2]};
}

// From nine numbers, row by row.
tl::Mat3 mat3(const std::vector<double>& m) {
  if (m.size() != 9) throw std::invalid_argument("nine numbers are needed");
  return {{m[0], m[3], m[6]}, {m[1], m[4], m[7]}, {m[2], m[5], m[8]}};
}

// One sample, checked.
tl::Sample sample(const tl::Observer& o, double time, nb::handle q, nb::handle qd, nb::handle tau,
                  nb::handle wrench) {
  const std::size_t n = o.row_layout().joints, k = o.row_layout().sensors;
  return {time, arrays::numbers(q, {n}), arrays::numbers(qd, {n}), arrays::numbers(tau, {n}),
          arrays::numbers(wrench, {k, 6})};
}

void step(tl::Observer& o, double time, nb::handle q, nb::handle qd, nb::handle tau,
          nb::handle wrench) {
  o.step(sample(o, time, q, qd, tau, wrench));
}

nb::object update(tl::Observer& o, double time, nb::handle q, nb::handle qd, nb::handle tau,
                  nb::handle wrench) {
  const double* row = o.step(sample(o, time, q, qd, tau, wrench));
  arrays::Out out({o.output().size()});
  std::copy_n(row, o.output().size(), out.data());
  return out.release();
}

// N samples: how many, and where the signals of the first stand.
struct Recording {
  std::size_t rows;
  const double* time;
  tl::Sample first;
};

Recording recording(const tl::Observer& o, nb::handle time, nb::handle q, nb::handle qd,
                    nb::handle tau, nb::handle wrench) {
  const std::size_t n = o.row_layout().joints, k = o.row_layout().sensors;
  const std::size_t rows = arrays::length(time);
  return {rows, arrays::numbers(time, {rows}),
          {0.0, arrays::numbers(q, {rows, n}), arrays::numbers(qd, {rows, n}),
           arrays::numbers(tau, {rows, n}), arrays::numbers(wrench, {rows, k, 6})}};
}

nb::object run(tl::Observer& o, nb::handle time, nb::handle q, nb::handle qd, nb::handle tau,
               nb::handle wrench) {
  const Recording in = recording(o, time, q, qd, tau, wrench);
  arrays::Out out({in.rows, o.output().size()});
  {
    nb::gil_scoped_release release;
    o.run(in.rows, in.time, in.first.q, in.first.qd, in.first.tau, in.first.wrench, out.data());
  }
  return out.release();
}

// One sample through observer and detector: the observer's row, the level of each segment, the
// normalized rows, for how long each segment's baseline has been averaged.
nb::tuple detect(tl::Observer& o, tl::Detector& d, double time, nb::handle q, nb::handle qd,
                 nb::handle tau, nb::handle wrench) {
  const tl::Sample in = sample(o, time, q, qd, tau, wrench);
  const double* row = o.step(in);
  d.step(row, in.q, in.qd);
  arrays::Out out({o.output().size()}), levels({d.levels().size()}), tests({d.rows().size()}),
      quiet({d.quiet().size()});
  std::copy_n(row, o.output().size(), out.data());
  std::copy(d.levels().begin(), d.levels().end(), levels.data());
  std::copy(d.normalized().begin(), d.normalized().end(), tests.data());
  std::copy(d.quiet().begin(), d.quiet().end(), quiet.data());
  return nb::make_tuple(out.release(), levels.release(), tests.release(), quiet.release());
}

// Runs samples `from` to `to` through observer and detector; calls `each(i)` after every one.
template <class Each>
void detect_all(tl::Observer& o, tl::Detector& d, const Recording& in, std::size_t from,
                std::size_t to, double* rows, Each each) {
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
nb::tuple detect_run(tl::Observer& o, tl::Detector& d, nb::handle time, nb::handle q,
                     nb::handle qd, nb::handle tau, nb::handle wrench) {
  const Recording in = recording(o, time, q, qd, tau, wrench);
  arrays::Out out({in.rows, o.output().size()}), levels({in.rows, d.levels().size()}),
      tests({in.rows, d.rows().size()}), quiet({in.rows, d.quiet().size()});
  double *level = levels.data(), *x = tests.data(), *since = quiet.data();
  detect_all(o, d, in, 0, in.rows, out.data(), [&](std::size_t) {
    level = std::copy(d.levels().begin(), d.levels().end(), level);
    x = std::copy(d.normalized().begin(), d.normalized().end(), x);
    since = std::copy(d.quiet().begin(), d.quiet().end(), since);
  });
  return nb::make_tuple(out.release(), levels.release(), tests.release(), quiet.release());
}

// N samples, for those who set thresholds: levels (N, m), statistics (N, m, tests), and of every
// `every`-th sample the residuals (r) less baseline, less reference, their variance (r) by noise, and the
// activity (2).
nb::tuple detect_details(tl::Observer& o, tl::Detector& d, nb::handle time, nb::handle q,
                         nb::handle qd, nb::handle tau, nb::handle wrench, std::size_t every) {
  const Recording in = recording(o, time, q, qd, tau, wrench);
  if (every == 0) throw std::invalid_argument("every must be at least 1");
  const std::size_t segments = d.levels().size(), rows = d.rows().size();
  const std::size_t kept = (in.rows + every - 1) / every;
  arrays::Out levels({in.rows, segments}),
      statistics({in.rows, segments, d.statistics().size() / std::max<std::size_t>(segments, 1)}),
      slow({kept, rows}), quick({kept, rows}), noise({kept, rows}), activity({kept, 2});
  constexpr std::size_t kBlock = 256;  // samples whose rows are held at a time
  std::vector<double> scratch(kBlock * o.output().size());
  double *level = levels.data(), *value = statistics.data(), *a = slow.data(), *b = quick.data(),
         *v = noise.data(), *c = activity.data();
  const auto each = [&](std::size_t i) {
    level = std::copy(d.levels().begin(), d.levels().end(), level);
    value = std::copy(d.statistics().begin(), d.statistics().end(), value);
    if (i % every != 0) return;
    for (std::size_t r = 0; r < rows; ++r) {
      *a++ = d.sample(r).known ? d.sample(r).residual - d.sample(r).offset : tl::kNaN;
      *b++ = d.sample(r).known ? d.sample(r).residual - d.sample(r).reference : tl::kNaN;
      *v++ = d.noise_variance(r);
    }
    *c++ = d.activity().speed2;
    *c++ = d.activity().acceleration;
  };
  for (std::size_t from = 0; from < in.rows; from += kBlock)
    detect_all(o, d, in, from, std::min(from + kBlock, in.rows), scratch.data(), each);
  return nb::make_tuple(levels.release(), statistics.release(), slow.release(), quick.release(),
                        noise.release(), activity.release());
}

// Momentum and n-bar: joint rows, then six rows per sensor in its own frame.
nb::tuple terms(tl::Observer& o, nb::handle q, nb::handle qd) {
  const tl::RowLayout& layout = o.row_layout();
  const std::size_t joints = layout.joints, size = joints + 6 * layout.sensors;
  const double* speeds = arrays::numbers(qd, {joints});
  tl::Terms<double>& model = o.terms();
  model.sweep(arrays::numbers(q, {joints}), speeds);
  arrays::Out p({size}), n({size});
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
nb::object poses(tl::Observer& o, nb::handle q) {
  const std::size_t n = o.row_layout().joints, count = o.tree().nodes().size();
  const std::vector<double> rest(n, 0.0);
  o.terms().sweep(arrays::numbers(q, {n}), rest.data());
  arrays::Out out({count, 4, 4});
  for (std::size_t i = 0; i < count; ++i) {
    const tl::NodeState<double>& X = o.terms().state().node(static_cast<int>(i));
    const double rows[16] = {X.R.x.x, X.R.y.x, X.R.z.x, X.p.x, X.R.x.y, X.R.y.y, X.R.z.y, X.p.y,
                             X.R.x.z, X.R.y.z, X.R.z.z, X.p.z, 0.0,     0.0,     0.0,     1.0};
    std::copy(rows, rows + 16, out.data() + 16 * i);
  }
  return out.release();
}

nb::dict row_slices(const tl::Observer& o) {
  const tl::RowLayout& l = o.row_layout();
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

void check_detector(const tl::Observer& o, const std::vector<tl::DetectionRow>& rows,
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

tl::ModelError model_error(const std::vector<double>& v) {
  if (v.size() != 3) throw std::invalid_argument("three numbers are needed");
  return {v[0], v[1], v[2]};
}

void bind_detector(nb::module_& m) {
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
             const std::vector<double>& quick) {
            new (self) tl::DetectionRow{segment, component, joint, contact, collision,
                                        baseline_limit, model_error(slow), model_error(quick)};
          },
          "segment"_a, "component"_a, "joint"_a, "contact"_a, "collision"_a, "baseline_limit"_a,
          "slow"_a, "quick"_a);
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
          [](tl::Detector* self, const tl::Observer& observer, std::vector<tl::DetectionRow> rows,
             tl::DetectionSettings settings) {
            check_detector(observer, rows, settings);
            new (self) tl::Detector(observer, std::move(rows), std::move(settings));
          },
          "observer"_a, "rows"_a, "settings"_a, nb::keep_alive<1, 2>())
      .def("baseline", &tl::Detector::baseline, "row"_a);
  m.def("detect", &detect);
  m.def("detect_run", &detect_run);
  m.def("detect_details", &detect_details, "observer"_a, "detector"_a, "time"_a, "q"_a, "qd"_a,
        "tau"_a, "wrench"_a, "every"_a = 1);
}

// The module is built twice from this source: for any processor, and as `_core_avx2` for those
// with AVX2. The numbers are the same.
#ifndef TOUCHLINE_MODULE
#define TOUCHLINE_MODULE _core
#endif

NB_MODULE(TOUCHLINE_MODULE, m) {
#if defined(__AVX2__)
  if (!__builtin_cpu_supports("avx2")) throw nb::import_error("this processor has no AVX2");
#endif
  arrays::initialize();
  bind_enums(m);
  bind_rows(m);
  bind_contact(m);
  bind_detector(m);
  nb::class_<tl::Observer>(m, "Observer")
      .def("__init__",
           [](tl::Observer* self, std::vector<tl::Node> nodes, const std::vector<double>& gravity,
              std::vector<tl::JointRow> joints, std::vector<tl::SensorRow> sensors,
              tl::Method method, tl::Discretization discretization) {
             new (self) tl::Observer(tl::Tree(std::move(nodes), vec3(gravity)), std::move(joints),
                                     std::move(sensors), method, discretization);
           })
      .def("step", &step, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def step(self, time: float, " TOUCHLINE_SIGNALS ") -> None"))
      .def("update", &update, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def update(self, time: float, " TOUCHLINE_SIGNALS ") -> " TOUCHLINE_ARRAY))
      .def("run", &run, "time"_a, "q"_a, "qd"_a, "tau"_a, "wrench"_a,
           nb::sig("def run(self, time: object, " TOUCHLINE_SIGNALS ") -> " TOUCHLINE_ARRAY))
      .def("terms", &terms, "q"_a, "qd"_a,
           nb::sig("def terms(self, q: object, qd: object) -> "
                   "tuple[" TOUCHLINE_ARRAY ", " TOUCHLINE_ARRAY "]"))
      .def("poses", &poses, "q"_a, nb::sig("def poses(self, q: object) -> " TOUCHLINE_ARRAY))
      .def("reset", &tl::Observer::reset)
      .def_prop_ro("slices", &row_slices,
                   nb::sig("def slices(self, /) -> dict[str, tuple[int, int]]"))
      .def_prop_ro("segment_sensors", [](const tl::Observer& o) {
        std::vector<int> sensors;
        for (const tl::Segment& s : o.layout().segments) sensors.push_back(s.sensor);
        return sensors;
      });
}
