// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

#include "hardware_interface/handle.hpp"
#include "rclcpp_lifecycle/lifecycle_node.hpp"

namespace controller_interface {

using CallbackReturn = rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface::CallbackReturn;
enum class return_type : std::uint8_t { OK = 0, ERROR = 1 };
enum class interface_configuration_type : std::uint8_t { ALL = 0, INDIVIDUAL = 1, NONE = 2 };

struct InterfaceConfiguration {
  interface_configuration_type type;
  std::vector<std::string> names = {};
};

class ChainableControllerInterface
    : public rclcpp_lifecycle::node_interfaces::LifecycleNodeInterface {
 public:
  virtual InterfaceConfiguration command_interface_configuration() const = 0;
  virtual InterfaceConfiguration state_interface_configuration() const = 0;
  virtual CallbackReturn on_init() = 0;
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> get_node() { return node_; }

  return_type update(const rclcpp::Time& time, const rclcpp::Duration& period) {
    const return_type first = update_reference_from_subscribers(time, period);
    return first == return_type::OK ? update_and_write_commands(time, period) : first;
  }
  std::vector<hardware_interface::StateInterface> export_state_interfaces() {
    return on_export_state_interfaces();
  }
  void assign(std::vector<hardware_interface::LoanedStateInterface>&& lent) {
    state_interfaces_ = std::move(lent);
  }

 protected:
  template <class T>
  auto auto_declare(const std::string& name, const T& default_value) {
    if (!node_->has_parameter(name)) node_->values[name] = default_value;
    return std::get<T>(node_->values[name]);
  }
  virtual std::vector<hardware_interface::StateInterface> on_export_state_interfaces() { return {}; }
  virtual bool on_set_chained_mode(bool) { return true; }
  virtual return_type update_reference_from_subscribers(const rclcpp::Time&,
                                                        const rclcpp::Duration&) = 0;
  virtual return_type update_and_write_commands(const rclcpp::Time&, const rclcpp::Duration&) = 0;

  std::vector<hardware_interface::LoanedStateInterface> state_interfaces_;

 private:
  std::shared_ptr<rclcpp_lifecycle::LifecycleNode> node_ =
      std::make_shared<rclcpp_lifecycle::LifecycleNode>("touch");
};

}  // namespace controller_interface
