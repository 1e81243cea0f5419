// SPDX-License-Identifier: Apache-2.0
#include "touchline_broadcaster/touch_broadcaster.hpp"

#include <exception>
#include <utility>

#include "pluginlib/class_list_macros.hpp"

namespace touchline_broadcaster {

using controller_interface::CallbackReturn;
using controller_interface::InterfaceConfiguration;
using controller_interface::interface_configuration_type;
using controller_interface::return_type;

InterfaceConfiguration TouchBroadcaster::command_interface_configuration() const {
  return {interface_configuration_type::NONE, {}};
}

InterfaceConfiguration TouchBroadcaster::state_interface_configuration() const {
  if (!broadcast_) return {interface_configuration_type::NONE, {}};
  return {interface_configuration_type::INDIVIDUAL, broadcast_->reads()};
}

CallbackReturn TouchBroadcaster::on_init() {
  auto_declare<std::string>("robot_file", "");
  auto_declare<std::vector<std::string>>("joints", {});
  auto_declare<std::vector<std::string>>("sensors", {});
  auto_declare<std::string>("frame_id", "world");
  return CallbackReturn::SUCCESS;
}

CallbackReturn TouchBroadcaster::on_configure(const rclcpp_lifecycle::State&) {
  const auto node = get_node();
  try {
    broadcast_ = std::make_unique<TouchBroadcast>(
        touchline::read_robot(node->get_parameter("robot_file").as_string()),
        node->get_parameter("joints").as_string_array(),
        node->get_parameter("sensors").as_string_array());
  } catch (const std::exception& error) {
    RCLCPP_ERROR(node->get_logger(), "%s", error.what());
    return CallbackReturn::ERROR;
  }
  const std::string frame = node->get_parameter("frame_id").as_string();
  const touchline::Robot& robot = broadcast_->robot();
  torques_ = output<sensor_msgs::msg::JointState>("~/external_joint_torques");
  torques_->lock();
  for (std::size_t j = 0; j < robot.joints.size(); ++j)
    torques_->msg_.name.push_back(broadcast_->exports()[j].prefix);
  torques_->msg_.effort.assign(robot.joints.size(), touchline::kUnknown);
  torques_->unlock();
  wrenches_.clear();
  for (const std::string& segment : robot.segment_names) {
    wrenches_.push_back(output<geometry_msgs::msg::WrenchStamped>(wrench_topic(segment)));
    wrenches_.back()->lock();
    wrenches_.back()->msg_.header.frame_id = frame;
    wrenches_.back()->unlock();
  }
  collision_ = output<std_msgs::msg::Bool>("~/collision");
  return CallbackReturn::SUCCESS;
}

template <class Message>
TouchBroadcaster::Output<Message> TouchBroadcaster::output(const std::string& topic) {
  return std::make_unique<realtime_tools::RealtimePublisher<Message>>(
      get_node()->create_publisher<Message>(topic, rclcpp::SystemDefaultsQoS()));
}

std::vector<hardware_interface::StateInterface> TouchBroadcaster::on_export_state_interfaces() {
  std::vector<hardware_interface::StateInterface> exported;
  if (!broadcast_) return exported;
  const std::vector<Channel>& given = broadcast_->exports();
  for (std::size_t i = 0; i < given.size(); ++i) {  // ros2_control wants the controller's name first
    exported.emplace_back(std::string(get_node()->get_name()) + "/" + given[i].prefix,
                          given[i].name, broadcast_->value(i));
  }
  return exported;
}

CallbackReturn TouchBroadcaster::on_activate(const rclcpp_lifecycle::State&) {
  std::vector<std::string> offered;
  for (const auto& interface : state_interfaces_) offered.push_back(interface.get_name());
  const std::vector<std::string> missing = broadcast_->assign(offered);
  if (!missing.empty()) {
    RCLCPP_ERROR(get_node()->get_logger(), "there is no state interface %s", missing[0].c_str());
    return CallbackReturn::ERROR;
  }
  broadcast_->begin();
  return CallbackReturn::SUCCESS;
}

CallbackReturn TouchBroadcaster::on_deactivate(const rclcpp_lifecycle::State&) {
  broadcast_->silence();
  return CallbackReturn::SUCCESS;
}

return_type TouchBroadcaster::update_reference_from_subscribers(const rclcpp::Time&,
                                                                const rclcpp::Duration&) {
  return return_type::OK;  // it has no reference
}

return_type TouchBroadcaster::update_and_write_commands(const rclcpp::Time& time,
                                                        const rclcpp::Duration&) {
  for (std::size_t i = 0; i < state_interfaces_.size(); ++i)
    broadcast_->set(i, state_interfaces_[i].get_value());
  broadcast_->step(time.seconds());
  publish(time);
  return return_type::OK;
}

void TouchBroadcaster::publish(const rclcpp::Time& time) {
  const std::size_t n = broadcast_->robot().joints.size();
  if (torques_->trylock()) {
    torques_->msg_.header.stamp = time;
    for (std::size_t j = 0; j < n; ++j) torques_->msg_.effort[j] = *broadcast_->value(j);
    torques_->unlockAndPublish();
  }
  for (std::size_t g = 0; g < wrenches_.size(); ++g) {
    if (!wrenches_[g]->trylock()) continue;
    const double* wrench = broadcast_->value(n + 6 * g);
    auto& message = wrenches_[g]->msg_;
    message.header.stamp = time;
    message.wrench.force.x = wrench[0];
    message.wrench.force.y = wrench[1];
    message.wrench.force.z = wrench[2];
    message.wrench.torque.x = wrench[3];
    message.wrench.torque.y = wrench[4];
    message.wrench.torque.z = wrench[5];
    wrenches_[g]->unlockAndPublish();
  }
  if (collision_->trylock()) {
    collision_->msg_.data = broadcast_->collided();
    collision_->unlockAndPublish();
  }
}

}  // namespace touchline_broadcaster

PLUGINLIB_EXPORT_CLASS(touchline_broadcaster::TouchBroadcaster,
                       controller_interface::ChainableControllerInterface)
