// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

#include <memory>
#include <string>
#include <utility>

namespace hardware_interface {

class StateInterface {
 public:
  using ConstSharedPtr = std::shared_ptr<const StateInterface>;
  explicit StateInterface(const std::string& prefix_name, const std::string& interface_name,
                          double* value_ptr = nullptr)
      : prefix_(prefix_name), name_(interface_name), value_(value_ptr) {}
  std::string get_name() const { return prefix_ + "/" + name_; }
  const std::string& get_interface_name() const { return name_; }
  const std::string& get_prefix_name() const { return prefix_; }
  double get_value() const { return *value_; }

 private:
  std::string prefix_, name_;
  double* value_;
};

class LoanedStateInterface {
 public:
  explicit LoanedStateInterface(StateInterface::ConstSharedPtr lent) : lent_(std::move(lent)) {}
  LoanedStateInterface(const LoanedStateInterface&) = delete;
  LoanedStateInterface(LoanedStateInterface&&) = default;
  const std::string get_name() const { return lent_->get_name(); }
  double get_value() const { return lent_->get_value(); }

 private:
  StateInterface::ConstSharedPtr lent_;
};

}  // namespace hardware_interface
