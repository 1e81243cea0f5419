// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

#include <any>

#include "rclcpp/rclcpp.hpp"

namespace rclcpp_lifecycle {

class State {};

class LifecycleNode {
 public:
  explicit LifecycleNode(std::string name) : name_(std::move(name)) {}
  const char* get_name() const { return name_.c_str(); }
  rclcpp::Logger get_logger() const { return logger_; }
  bool has_parameter(const std::string& name) const { return values.count(name) > 0; }
  rclcpp::Parameter get_parameter(const std::string& name) const {
    return rclcpp::Parameter(values.at(name));
  }

  template <class Message>
  typename rclcpp::Publisher<Message>::SharedPtr create_publisher(const std::string& topic,
                                                                  const rclcpp::QoS&) {
    auto made = std::make_shared<rclcpp::Publisher<Message>>();
    topics[topic] = made;
    return made;
  }

  // For the test.
  std::map<std::string, rclcpp::Parameter::Value> values;
  std::map<std::string, std::any> topics;

 private:
  std::string name_;
  rclcpp::Logger logger_;
};

namespace node_interfaces {
class LifecycleNodeInterface {
 public:
  enum class CallbackReturn : std::uint8_t { SUCCESS, FAILURE, ERROR };
  virtual ~LifecycleNodeInterface() = default;
  virtual CallbackReturn on_configure(const State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_activate(const State&) { return CallbackReturn::SUCCESS; }
  virtual CallbackReturn on_deactivate(const State&) { return CallbackReturn::SUCCESS; }
};
}  // namespace node_interfaces

}  // namespace rclcpp_lifecycle
