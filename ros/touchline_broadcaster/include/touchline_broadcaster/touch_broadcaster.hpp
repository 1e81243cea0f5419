// SPDX-License-Identifier: Apache-2.0
// A ros2_control broadcaster: reads a robot's state interfaces and gives what is felt as state
// interfaces of its own and as topics. It claims no command interface.
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "controller_interface/chainable_controller_interface.hpp"
#include "geometry_msgs/msg/wrench_stamped.hpp"
#include "rclcpp/rclcpp.hpp"
#include "realtime_tools/realtime_publisher.hpp"
#include "sensor_msgs/msg/joint_state.hpp"
#include "std_msgs/msg/bool.hpp"
#include "touchline_broadcaster/touch_broadcast.hpp"

namespace touchline_broadcaster {

// Parameters, read when it is configured: `robot_file` (of `touchline export`), `joints` and
// `sensors` (names in ros2_control, in the robot's order; empty: the robot's own), `frame_id`.
class TouchBroadcaster : public controller_interface::ChainableControllerInterface {
 public:
  controller_interface::InterfaceConfiguration command_interface_configuration() const override;
  controller_interface::InterfaceConfiguration state_interface_configuration() const override;
  controller_interface::CallbackReturn on_init() override;
  controller_interface::CallbackReturn on_configure(const rclcpp_lifecycle::State& from) override;
  controller_interface::CallbackReturn on_activate(const rclcpp_lifecycle::State& from) override;
  controller_interface::CallbackReturn on_deactivate(const rclcpp_lifecycle::State& from) override;

 protected:
  std::vector<hardware_interface::StateInterface> on_export_state_interfaces() override;
  controller_interface::return_type update_reference_from_subscribers(
      const rclcpp::Time& time, const rclcpp::Duration& period) override;
  // Never fails the loop: what cannot be felt is NaN, what cannot be published at once is left out.
  controller_interface::return_type update_and_write_commands(
      const rclcpp::Time& time, const rclcpp::Duration& period) override;

 private:
  template <class Message>
  using Output = std::unique_ptr<realtime_tools::RealtimePublisher<Message>>;

  template <class Message>
  Output<Message> output(const std::string& topic);
  void publish(const rclcpp::Time& time);

  std::unique_ptr<TouchBroadcast> broadcast_;
  Output<sensor_msgs::msg::JointState> torques_;
  std::vector<Output<geometry_msgs::msg::WrenchStamped>> wrenches_;  // one per segment
  Output<std_msgs::msg::Bool> collision_;
};

}  // namespace touchline_broadcaster
