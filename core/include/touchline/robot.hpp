// SPDX-License-Identifier: Apache-2.0
// All that the pipeline has to know of a robot. That is the tree of its bodies, what its channels
// report and how noisy they are, when a residual counts, and its surfaces. Part of them may be meant
// to be touched. Where it may lose sensors it has stand-ins: what it is without them.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <stdexcept>
#include <string>
#include <utility>
#include <vector>

#include "touchline/detail/classifier/classifier.hpp"
#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/model/tree.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/signals.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/settings.hpp"

namespace touchline {

// Which part of a robot is meant to be touched.
enum class Zone { structure, end_effector, handle, open };  // open: of several, or of none

// A link that can be felt: `placement` is its frame in that of the node which carries its surface.
struct Link {
  std::string name, body;  // the rigid body that it belongs to
  Zone zone = Zone::structure;
  Pose placement;
};

// Can a touch of a segment be felt? `degraded`: with fewer signals than the robot has.
enum class Watch { watched, degraded, blind };

struct StandIn;

// Arrays follow `joints` (n), `sensors` (k) and the segments (m): one per six-axis sensor in their
// order, then the root's if the robot's root is not on such a sensor.
struct Robot {
  std::string name;
  std::vector<Node> nodes;  // a parent comes before its children
  Vec3 gravity{0.0, 0.0, -9.81};
  std::vector<JointRow> joints;
  std::vector<SensorRow> sensors;
  std::vector<std::string> joint_names, sensor_names, segment_names;
  std::vector<DetectionRow> rows;  // what is tested, segment by segment
  DetectionSettings detection;
  NoiseFigures noise;  // for the localizer's weights
  std::vector<BlowLimits> blows;    // per segment
  std::vector<Zone> segment_zones;  // per segment; open where it has several
  std::vector<LinkSurface> surfaces;
  std::vector<Link> links;  // one per surface
  Pushes pushes;
  std::vector<StandIn> stand_ins;  // for losses of sensors that `RedundantPipeline` carries on after
};

// A robot without some of its sensors, and where its parts stand in the whole robot. It has no
// stand-ins of its own.
struct StandIn {
  std::vector<int> lost;      // sensors of the whole robot that it does without
  Robot robot;
  std::vector<int> sensors;   // of the whole robot, for each of its own
  std::vector<int> segments;  // of the whole robot, for each of its own
  std::vector<int> rows;      // of the whole robot's detector, for each of its own; -1: none
  std::vector<Watch> watch;   // of each segment of the whole robot
};

// Does a stand-in fit the whole robot? Throws std::invalid_argument where not.
inline void check(const StandIn& s, const Robot& whole) {
  const auto within = [](const std::vector<int>& values, int least, std::size_t end) {
    return std::all_of(values.begin(), values.end(),
                       [&](int i) { return i >= least && i < static_cast<int>(end); });
  };
  const bool fits = s.robot.joints.size() == whole.joints.size() &&
                    s.robot.links.size() == whole.links.size() &&
                    s.sensors.size() == s.robot.sensors.size() &&
                    s.segments.size() == s.robot.segment_names.size() &&
                    s.rows.size() == s.robot.rows.size() &&
                    s.watch.size() == whole.segment_names.size() &&
                    s.sensors.size() + s.lost.size() == whole.sensors.size() &&
                    within(s.lost, 0, whole.sensors.size()) &&
                    within(s.sensors, 0, whole.sensors.size()) &&
                    within(s.segments, 0, whole.segment_names.size()) &&
                    within(s.rows, -1, whole.rows.size()) && s.robot.stand_ins.empty();
  if (!fits) throw std::invalid_argument("robot: a stand-in does not fit it");
}

// Do the parts of a robot fit together? Throws std::invalid_argument that names what does not.
inline void check(const Robot& robot) {
  const auto require = [](bool holds, const char* what) {
    if (!holds) throw std::invalid_argument(std::string("robot: ") + what);
  };
  const auto finite = [](const Vec3& v) { return std::isfinite(v.x + v.y + v.z); };
  const auto sound = [&finite](const Mat3& m) { return finite(m.x) && finite(m.y) && finite(m.z); };
  const auto within = [](int i, int begin, std::size_t end) {
    return i >= begin && i < static_cast<int>(end);
  };
  const std::size_t n = robot.joints.size(), k = robot.sensors.size(), nodes = robot.nodes.size();
  require(robot.joint_names.size() == n, "needs one name for each joint");
  require(robot.sensor_names.size() == k, "needs one name for each sensor");
  for (std::size_t i = 0; i < nodes; ++i) {
    const Node& node = robot.nodes[i];
    require(within(node.parent, -1, i), "a node's parent must come before it");
    const bool moves = node.kind != NodeKind::fixed;
    require(within(node.coordinate, moves ? 0 : -1, n), "a node moves with a joint that is not there");
    require(sound(node.placement.R) && finite(node.placement.p) && finite(node.com) &&
                sound(node.inertia) && std::isfinite(node.mass + node.multiplier + node.offset),
            "a node has a number that is not finite");
  }
  require(finite(robot.gravity), "gravity is not finite");
  for (const JointRow& joint : robot.joints) {
    require(!joint.nodes.empty(), "a joint moves no node");
    for (const int node : joint.nodes) require(within(node, 0, nodes), "a joint moves no such node");
    for (const int source : joint.sources)
      require(within(source, 0, k), "a joint is read from a sensor that is not there");
    require(joint.bandwidth > 0.0 && std::isfinite(joint.bandwidth), "a bandwidth is not positive");
    require(std::isfinite(joint.stribeck) && (joint.stribeck == 0.0 || joint.stribeck_speed > 0.0),
            "friction that falls with speed needs a speed");
    require(joint.rest.sound(), "a learned rest has no sound table");
  }
  for (const SensorRow& sensor : robot.sensors) {
    require(within(sensor.node, 0, nodes), "a sensor stands on a node that is not there");
    require(within(sensor.log_node, -1, nodes), "a sensor's axes are of a node that is not there");
    require(sensor.bandwidth > 0.0 && std::isfinite(sensor.bandwidth), "a bandwidth is not positive");
  }
  const Tree tree(robot.nodes, robot.gravity);
  const std::size_t segments = Layout(tree, robot.joints, robot.sensors).segments.size();
  require(robot.segment_names.size() == segments, "needs one name for each segment");
  require(robot.segment_zones.size() == segments, "needs one zone for each segment");
  require(robot.blows.size() == segments, "needs limits of a blow for each segment");
  for (const BlowLimits& blow : robot.blows) {
    for (const int joint : blow.joints)
      require(within(joint, 0, n), "limits of a blow name a joint that is not there");
  }
  const DetectionSettings& detection = robot.detection;
  require(detection.sum_limits.size() == segments, "needs a limit of the sum for each segment");
  for (const TestSetting& test : detection.tests)
    require(test.limits.size() == segments, "needs a limit of each test for each segment");
  int last = 0;
  for (const DetectionRow& row : robot.rows) {
    require(within(row.segment, last, segments), "the detector's rows must stand segment by segment");
    require(within(row.component, -1, 6) && within(row.joint, -1, n) &&
                (row.component < 0) == (row.joint >= 0),
            "a row of the detector is neither a component nor a joint");
    require(row.contact > 0.0 && row.collision > 0.0, "a threshold is not positive");
    last = row.segment;
  }
  for (const NoiseFigures* noise : {&robot.noise, &detection.noise}) {
    require(noise->qd.size() == n && noise->tau.size() == n && noise->wrench.size() == 6 * k,
            "needs a noise figure for each channel");
    require(noise->period > 0.0 && std::isfinite(noise->period), "the sample period is not positive");
  }
  require(!detection.windows.empty(), "the detector needs a window");
  for (const double window : detection.windows)
    require(window > 0.0 && window <= 1e5 * detection.noise.period, "a window is out of range");
  require(robot.links.size() == robot.surfaces.size(), "needs a name for each surface");
  for (const double x : {robot.pushes.friction, robot.pushes.reach})
    require(x > 0.0 && std::isfinite(x), "friction and reach of pushes must be positive");
  for (const LinkSurface& surface : robot.surfaces) {
    require(within(surface.node, 0, nodes), "a surface is carried by a node that is not there");
    for (const Triangle& t : surface.mesh.triangles())
      require(finite(t.a) && finite(t.ab) && finite(t.ac) && finite(t.normal),
              "a surface has a number that is not finite");
  }
  for (const StandIn& stand_in : robot.stand_ins) {
    check(stand_in, robot);
    check(stand_in.robot);
  }
}

}  // namespace touchline
