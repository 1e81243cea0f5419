// SPDX-License-Identifier: Apache-2.0
// The ros2_control broadcaster on an exported robot and a log, with the interfaces' signatures and no
// ROS. Prints what it gives after each sample; then "FAILED what" for each claim that does not hold.
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>

// Both files as one: the core is compiled once.
#include "../../ros/touchline_broadcaster/src/touch_broadcaster.cpp"

extern long allocations;  // counting.cpp

namespace {

using controller_interface::CallbackReturn;
using controller_interface::return_type;
using touchline_broadcaster::TouchBroadcast;
using touchline_broadcaster::TouchBroadcaster;
using Interface = hardware_interface::StateInterface;

const rclcpp_lifecycle::State kState;
const rclcpp::Duration kPeriod(1000000);

void claim(bool holds, const char* what) {
  if (!holds) std::printf("FAILED %s\n", what);
}

// The hardware's side: a value for each interface.
struct Hardware {
  std::vector<std::string> names;
  std::vector<double> values;

  explicit Hardware(std::vector<std::string> given) : names(std::move(given)), values(names.size()) {}
  std::vector<hardware_interface::LoanedStateInterface> lend() {
    std::vector<hardware_interface::LoanedStateInterface> lent;
    for (std::size_t i = 0; i < names.size(); ++i) {
      const std::size_t cut = names[i].rfind('/');
      lent.emplace_back(std::make_shared<Interface>(names[i].substr(0, cut),
                                                    names[i].substr(cut + 1), &values[i]));
    }
    return lent;
  }
};

bool all_nan(const std::vector<Interface>& given) {
  for (const Interface& interface : given)
    if (!std::isnan(interface.get_value())) return false;
  return !given.empty();
}

template <class Message>
auto& published(TouchBroadcaster& controller, const std::string& topic) {
  using Pointer = typename rclcpp::Publisher<Message>::SharedPtr;
  return std::any_cast<Pointer&>(controller.get_node()->topics.at(topic))->published;
}

// The rows of a log: time, then q, qd, tau and wrenches as they stand in the columns.
std::vector<std::vector<double>> read_log(const char* path) {
  std::vector<std::vector<double>> rows;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    rows.emplace_back();
    for (char *at = line.data(), *end = at; *at != '\0'; at = end + (*end == ',')) {
      rows.back().push_back(std::strtod(at, &end));
      if (end == at) break;
    }
  }
  return rows;
}

// Column of the log in which an interface stands.
std::size_t column(const touchline::Robot& robot, const std::string& name) {
  const char* signals[] = {"position", "velocity", "effort"};
  const char* axes[] = {"force.x", "force.y", "force.z", "torque.x", "torque.y", "torque.z"};
  const std::size_t n = robot.joints.size();
  for (std::size_t s = 0; s < 3; ++s)
    for (std::size_t j = 0; j < n; ++j)
      if (name == robot.joint_names[j] + "/" + signals[s]) return 1 + s * n + j;
  for (std::size_t k = 0; k < robot.sensors.size(); ++k)
    for (std::size_t a = 0; a < 6; ++a)
      if (name == robot.sensor_names[k] + "/" + axes[a]) return 1 + 3 * n + 6 * k + a;
  std::printf("FAILED what is %s?\n", name.c_str());
  return 0;
}

}  // namespace

int main(int, char** arguments) {
  TouchBroadcaster controller;
  claim(controller.on_init() == CallbackReturn::SUCCESS, "on_init");
  auto& values = controller.get_node()->values;
  const auto lines = controller.get_node()->get_logger().lines;

  values["robot_file"] = std::string("nowhere");
  claim(controller.on_configure(kState) == CallbackReturn::ERROR, "no robot is no error");
  claim(lines->size() == 1 && lines->back().find("nowhere") != std::string::npos, "not told");
  values["robot_file"] = std::string(arguments[1]);
  values["joints"] = std::vector<std::string>{"one"};
  claim(controller.on_configure(kState) == CallbackReturn::ERROR, "one joint is no error");
  values["joints"] = std::vector<std::string>{};
  claim(controller.on_configure(kState) == CallbackReturn::SUCCESS, "on_configure");

  using controller_interface::interface_configuration_type;
  claim(controller.command_interface_configuration().type == interface_configuration_type::NONE,
        "it claims commands");
  const auto wanted = controller.state_interface_configuration();
  claim(wanted.type == interface_configuration_type::INDIVIDUAL, "not each by its name");
  const std::vector<Interface> given = controller.export_state_interfaces();
  claim(all_nan(given), "numbers before it is active");
  for (const Interface& interface : given)
    claim(interface.get_prefix_name().rfind("touch/", 0) == 0, "a prefix without its name");

  const touchline::Robot robot = touchline::read_robot(arguments[1]);
  Hardware lacking({wanted.names.begin() + 1, wanted.names.end()});
  controller.assign(lacking.lend());
  claim(controller.on_activate(kState) == CallbackReturn::ERROR, "a missing interface is no error");
  claim(lines->back().find(wanted.names[0]) != std::string::npos, "which one is not told");

  // In another order than asked for, and with one that is not its own.
  std::vector<std::string> offered(wanted.names.rbegin(), wanted.names.rend());
  offered.insert(offered.begin() + 3, "battery/voltage");
  Hardware hardware(offered);
  std::vector<std::size_t> columns;
  for (const std::string& name : offered)
    columns.push_back(name == "battery/voltage" ? 0 : column(robot, name));
  controller.assign(hardware.lend());
  claim(controller.on_activate(kState) == CallbackReturn::SUCCESS, "on_activate");

  const auto rows = read_log(arguments[2]);
  using Torques = sensor_msgs::msg::JointState;
  using Wrench = geometry_msgs::msg::WrenchStamped;
  using Turn = realtime_tools::RealtimePublisher<Torques>;
  auto& torques = published<Torques>(controller, "~/external_joint_torques");
  const std::string topic = touchline_broadcaster::wrench_topic(robot.segment_names[0]);
  auto& wrenches = published<Wrench>(controller, topic);
  auto& collisions = published<std_msgs::msg::Bool>(controller, "~/collision");
  torques.reserve(rows.size()), wrenches.reserve(rows.size()), collisions.reserve(rows.size());
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t c = 0; c < columns.size(); ++c) hardware.values[c] = rows[i][columns[c]];
    Turn::held = i % 10 == 3;  // somebody else has the message
    const rclcpp::Time now(static_cast<std::int64_t>(std::llround(1e9 * rows[i][0])));
    if (controller.update(now, kPeriod) != return_type::OK) claim(false, "the loop was failed");
    std::printf("%.17g", now.seconds());
    for (const Interface& interface : given) std::printf(" %.17g", interface.get_value());
    std::printf("\n");
  }
  claim(torques.size() == rows.size() - (rows.size() + 6) / 10, "what was held was published");
  claim(wrenches.size() == rows.size() && collisions.size() == rows.size(), "others were not");
  claim(wrenches.back().header.frame_id == "world" && torques.back().name == robot.joint_names,
        "frame or names");
  claim(torques.back().effort[2] == given[2].get_value(), "another torque");
  claim(wrenches.back().wrench.torque.y == given[robot.joints.size() + 4].get_value(), "another wrench");
  claim(wrenches.back().header.stamp.nanosec > 0, "no stamp");

  claim(controller.on_deactivate(kState) == CallbackReturn::SUCCESS, "on_deactivate");
  claim(all_nan(given), "numbers after it was active");
  claim(controller.on_activate(kState) == CallbackReturn::SUCCESS, "again");
  claim(all_nan(given), "numbers before the first sample");

  TouchBroadcast bare(robot);
  bare.assign(bare.reads());
  const long before = allocations;
  claim(before > 0, "nothing is counted");
  for (const std::vector<double>& row : rows) {
    for (std::size_t i = 0; i < bare.reads().size(); ++i) bare.set(i, row[1 + i % (row.size() - 1)]);
    bare.step(row[0]);
  }
  bare.silence();
  claim(allocations == before, "it allocates");
  claim(touchline_broadcaster::wrench_topic("2nd arm") == "~/_2nd_arm/wrench", "topic");
  return 0;
}
