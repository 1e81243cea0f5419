// SPDX-License-Identifier: Apache-2.0
// A robot as one self-contained file, as `touchline export` writes it.
//
//   8 bytes "TLROBOT\n", format (u32), length of what follows the header (u64), its checksum (u64,
//   FNV-1a), then the parts of `Robot` one after the other. Numbers are little endian, real ones
//   IEEE 754 doubles; lists begin with their length (u64). Meshes that a stand-in shares with the
//   whole robot stand once.
#pragma once

#include <cstdint>
#include <cstring>
#include <fstream>
#include <iterator>
#include <limits>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>
#include <vector>

#include "touchline/robot.hpp"

namespace touchline {

// Of the file; another one is refused. It changes with every part of `Robot`.
constexpr std::uint32_t kRobotFormat = 8;

// A file that cannot be read or written: it says which, and why.
struct RobotFileError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

namespace robot_file {

constexpr char kMagic[] = {'T', 'L', 'R', 'O', 'B', 'O', 'T', '\n'};
constexpr std::size_t kHeader = sizeof kMagic + 4 + 8 + 8;
static_assert(std::numeric_limits<double>::is_iec559 && sizeof(double) == 8, "IEEE 754 doubles");

// Appends what it is given.
class Writer {
 public:
  static constexpr bool kReads = false;

  void bytes(std::uint64_t value, std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) data.push_back(static_cast<char>(value >> (8 * i)));
  }
  void operator()(double& x) {
    std::uint64_t bits;
    std::memcpy(&bits, &x, sizeof bits);
    bytes(bits, 8);
  }
  void operator()(int& i) { bytes(static_cast<std::uint32_t>(i), 4); }
  void operator()(bool& b) { bytes(b ? 1 : 0, 1); }
  void operator()(std::string& s) {
    bytes(s.size(), 8);
    data += s;
  }
  std::size_t length(std::size_t size, std::size_t) {
    bytes(size, 8);
    return size;
  }

  std::string data;
};

// Takes from a text what a `Writer` has put there; throws where there is no more of it.
class Reader {
 public:
  static constexpr bool kReads = true;

  Reader(const char* begin, const char* end) : at_(begin), end_(end) {}

  std::uint64_t bytes(std::size_t count) {
    if (static_cast<std::size_t>(end_ - at_) < count) throw std::invalid_argument("it ends too soon");
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < count; ++i)
      value |= static_cast<std::uint64_t>(static_cast<unsigned char>(*at_++)) << (8 * i);
    return value;
  }
  void operator()(double& x) {
    const std::uint64_t bits = bytes(8);
    std::memcpy(&x, &bits, sizeof bits);
  }
  void operator()(int& i) {
    const std::uint32_t bits = static_cast<std::uint32_t>(bytes(4));
    std::memcpy(&i, &bits, sizeof i);
  }
  void operator()(bool& b) {
    const std::uint64_t value = bytes(1);
    if (value > 1) throw std::invalid_argument("a flag is neither yes nor no");
    b = value != 0;
  }
  void operator()(std::string& s) {
    const std::size_t size = length(0, 1);
    s.assign(at_, size);
    at_ += size;
  }
  // Of a list whose elements take `least` bytes or more: no more than there can be.
  std::size_t length(std::size_t, std::size_t least) {
    const std::uint64_t size = bytes(8);
    if (size > static_cast<std::uint64_t>(end_ - at_) / least)
      throw std::invalid_argument("a list is longer than the file");
    return static_cast<std::size_t>(size);
  }
  bool done() const { return at_ == end_; }

 private:
  const char *at_, *end_;
};

// --- the parts of a robot, in either direction ---
// Structured bindings name all members: one that is added does not compile until it is here too.

template <class A, class E>
void store_enum(A& file, E& value, E last) {
  int number = static_cast<int>(value);
  file(number);
  if (number < 0 || number > static_cast<int>(last))
    throw std::invalid_argument("a choice is not among those that there are");
  value = static_cast<E>(number);
}
template <class A> void store(A& file, double& x) { file(x); }
template <class A> void store(A& file, int& i) { file(i); }
template <class A> void store(A& file, bool& b) { file(b); }
template <class A> void store(A& file, std::string& s) { file(s); }
template <class A> void store(A& file, Torque& x) { store_enum(file, x, Torque::from); }
template <class A> void store(A& file, Compensated& x) { store_enum(file, x, Compensated::model); }
template <class A> void store(A& file, NodeKind& x) { store_enum(file, x, NodeKind::prismatic); }
template <class A> void store(A& file, Test& x) { store_enum(file, x, Test::cusum); }
template <class A> void store(A& file, Zone& x) { store_enum(file, x, Zone::open); }
template <class A> void store(A& file, Watch& x) { store_enum(file, x, Watch::blind); }
template <class A> void store(A& file, Vec3& v);
template <class A> void store(A& file, Mat3& m);
template <class A> void store(A& file, Pose& X);
template <class A> void store(A& file, Node& node);
template <class A> void store(A& file, LearnedRest& rest);
template <class A> void store(A& file, JointRow& joint);
template <class A> void store(A& file, SensorRow& sensor);
template <class A> void store(A& file, ModelError& error);
template <class A> void store(A& file, DetectionRow& row);
template <class A> void store(A& file, DetectionTimes& times);
template <class A> void store(A& file, TestSetting& test);
template <class A> void store(A& file, NoiseFigures& noise);
template <class A> void store(A& file, DetectionSettings& settings);
template <class A> void store(A& file, BlowLimits& limits);
template <class A> void store(A& file, LinkSurface& surface);
template <class A> void store(A& file, Link& link);
template <class A> void store(A& file, Robot& robot);
template <class A> void store(A& file, StandIn& stand_in);

template <class A, class T, std::size_t N>
void store(A& file, T (&values)[N]) {
  for (T& value : values) store(file, value);
}
template <class A, class T>
void store(A& file, std::vector<T>& values) {
  const std::size_t least = std::is_same_v<T, int> || std::is_enum_v<T> ? 4 : 8;
  const std::size_t size = file.length(values.size(), least);
  if constexpr (A::kReads) values.clear();
  for (std::size_t i = 0; i < size; ++i) {
    if constexpr (A::kReads) values.push_back(T{});
    store(file, values[i]);
  }
}
template <class A, class... Parts>
void store_all(A& file, Parts&... parts) {
  (store(file, parts), ...);
}

template <class A>
void store(A& file, Vec3& v) {
  auto& [x, y, z] = v;
  store_all(file, x, y, z);
}
template <class A>
void store(A& file, Mat3& m) {
  auto& [x, y, z] = m;
  store_all(file, x, y, z);
}
template <class A>
void store(A& file, Pose& X) {
  auto& [R, p] = X;
  store_all(file, R, p);
}
template <class A>
void store(A& file, Node& node) {
  auto& [parent, kind, placement, mass, com, inertia, coordinate, multiplier, offset] = node;
  store_all(file, parent, kind, placement, mass, com, inertia, coordinate, multiplier, offset);
}
template <class A>
void store(A& file, LearnedRest& rest) {
  auto& [q, qd, torque] = rest;
  store_all(file, q, qd, torque);
}
template <class A>
void store(A& file, JointRow& joint) {
  auto& [torque, compensated, sign, gain, bias, range, rotor_inertia, coulomb, viscous,
         coulomb_width, stribeck, stribeck_speed, rest, lower, upper, bandwidth, nodes,
         sources] = joint;
  store_all(file, torque, compensated, sign, gain, bias, range, rotor_inertia, coulomb, viscous,
            coulomb_width, stribeck, stribeck_speed, rest, lower, upper, bandwidth, nodes, sources);
}
template <class A>
void store(A& file, SensorRow& sensor) {
  auto& [node, axes, sign, turned, log_node, R_node_log, gravity_compensated, bias, range,
         bandwidth] = sensor;
  store_all(file, node, axes, sign, turned, log_node, R_node_log, gravity_compensated, bias, range,
            bandwidth);
}
template <class A>
void store(A& file, ModelError& error) {
  auto& [constant, speed, acceleration] = error;
  store_all(file, constant, speed, acceleration);
}
template <class A>
void store(A& file, DetectionRow& row) {
  auto& [segment, component, joint, contact, collision, baseline_limit, slow, quick, drift, seen] =
      row;
  store_all(file, segment, component, joint, contact, collision, baseline_limit, slow, quick, drift,
            seen);
}
template <class A>
void store(A& file, DetectionTimes& times) {
  auto& [min_duration, hold, baseline, release] = times;
  store_all(file, min_duration, hold, baseline, release);
}
template <class A>
void store(A& file, TestSetting& setting) {
  auto& [test, limits] = setting;
  store_all(file, test, limits);
}
template <class A>
void store(A& file, NoiseFigures& noise) {
  auto& [qd, tau, wrench, period, wrench_error, torque_error, wrench_error_off, force, moment] = noise;
  store_all(file, qd, tau, wrench, period, wrench_error, torque_error, wrench_error_off, force, moment);
}
template <class A>
void store(A& file, DetectionSettings& settings) {
  auto& [tests, sum_limits, times, noise, windows] = settings;
  store_all(file, tests, sum_limits, times, noise, windows);
}
template <class A>
void store(A& file, BlowLimits& limits) {
  auto& [onset, collision, joints] = limits;
  store_all(file, onset, collision, joints);
}
template <class A>
void store(A& file, Triangle& triangle) {
  auto& [a, ab, ac, normal, face] = triangle;
  store_all(file, a, ab, ac, normal, face);
}
// Without its mesh.
template <class A>
void store(A& file, LinkSurface& surface) {
  auto& [node, mesh, graspable, touchable] = surface;
  static_cast<void>(mesh);
  store_all(file, node, graspable, touchable);
}
template <class A>
void store(A& file, Link& link) {
  auto& [name, body, zone, placement] = link;
  store_all(file, name, body, zone, placement);
}
// Without meshes and stand-ins.
template <class A>
void store(A& file, Robot& robot) {
  auto& [name, nodes, gravity, joints, sensors, joint_names, sensor_names, segment_names, rows,
         detection, noise, blows, segment_zones, surfaces, links, pushes, stand_ins] = robot;
  static_cast<void>(stand_ins);
  store_all(file, name, nodes, gravity, joints, sensors, joint_names, sensor_names, segment_names,
            rows, detection, noise, blows, segment_zones, surfaces, links,
            pushes.friction, pushes.reach);
}
template <class A>
void store(A& file, StandIn& stand_in) {
  auto& [lost, robot, sensors, segments, rows, watch] = stand_in;
  store_all(file, lost, robot, sensors, segments, rows, watch);
}

inline std::string bytes_of(const Mesh& mesh) {
  Writer triangles;
  std::vector<Triangle> all = mesh.triangles();
  store(triangles, all);
  return triangles.data;
}
template <class A>
void store_mesh(A& file, Mesh& mesh) {
  std::vector<Triangle> triangles = mesh.triangles();
  store(file, triangles);
  if constexpr (A::kReads) mesh = Mesh(std::move(triangles));
}
// The meshes of the robot and of what stands in for it.
template <class A>
void store_meshes(A& file, Robot& robot) {
  for (LinkSurface& surface : robot.surfaces) store_mesh(file, surface.mesh);
  for (StandIn& stand_in : robot.stand_ins) {
    std::vector<LinkSurface>& surfaces = stand_in.robot.surfaces;
    for (std::size_t i = 0; i < surfaces.size(); ++i) {
      const bool paired = i < robot.surfaces.size();
      bool shared = false;
      if constexpr (!A::kReads)
        shared = paired && bytes_of(surfaces[i].mesh) == bytes_of(robot.surfaces[i].mesh);
      store(file, shared);
      if (shared && !paired) throw std::invalid_argument("a stand-in shares a mesh that is not there");
      if (!shared) store_mesh(file, surfaces[i].mesh);
      else if constexpr (A::kReads) surfaces[i].mesh = robot.surfaces[i].mesh;
    }
  }
}
template <class A>
void store_whole(A& file, Robot& robot) {
  store_all(file, robot, robot.stand_ins);
  store_meshes(file, robot);
}

inline std::uint64_t checksum(const char* begin, const char* end) {
  std::uint64_t sum = 14695981039346656037u;
  for (; begin != end; ++begin) sum = (sum ^ static_cast<unsigned char>(*begin)) * 1099511628211u;
  return sum;
}

inline Robot parse(const std::string& content) {
  const char *begin = content.data(), *end = begin + content.size();
  if (content.size() < sizeof kMagic || std::memcmp(begin, kMagic, sizeof kMagic) != 0)
    throw std::invalid_argument("it is no exported robot (see `touchline export`)");
  if (content.size() < kHeader) throw std::invalid_argument("it ends too soon");
  Reader header(begin + sizeof kMagic, begin + kHeader);
  const auto format = static_cast<std::uint32_t>(header.bytes(4));
  if (format != kRobotFormat)
    throw std::invalid_argument("it has format " + std::to_string(format) + ", this program reads " +
                                std::to_string(kRobotFormat) + ": export the robot again");
  const std::uint64_t length = header.bytes(8), sum = header.bytes(8);
  const std::uint64_t there = content.size() - kHeader;
  if (there < length)
    throw std::invalid_argument("it is truncated: " + std::to_string(there) + " of " +
                                std::to_string(length) + " bytes");
  if (there > length) throw std::invalid_argument("it goes on after its end");
  if (checksum(begin + kHeader, end) != sum)
    throw std::invalid_argument("it is damaged: its checksum differs");
  Robot robot;
  Reader body(begin + kHeader, end);
  store_whole(body, robot);
  if (!body.done()) throw std::invalid_argument("it goes on after its end");
  check(robot);
  return robot;
}

}  // namespace robot_file

// Reads an exported robot. Throws RobotFileError with the file's name and what is wrong.
inline Robot read_robot(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw RobotFileError(path + ": cannot be read");
  const std::string content{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
  if (file.bad()) throw RobotFileError(path + ": cannot be read");
  try {
    return robot_file::parse(content);
  } catch (const std::invalid_argument& error) {
    throw RobotFileError(path + ": " + error.what());
  }
}

// The content of such a file.
inline std::string robot_bytes(Robot robot) {
  robot_file::Writer body;
  robot_file::store_whole(body, robot);
  robot_file::Writer header;
  header.data.assign(robot_file::kMagic, sizeof robot_file::kMagic);
  header.bytes(kRobotFormat, 4);
  header.bytes(body.data.size(), 8);
  const char* begin = body.data.data();
  header.bytes(robot_file::checksum(begin, begin + body.data.size()), 8);
  return header.data + body.data;
}

}  // namespace touchline
