// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

#include <cstdint>
#include <cstdio>
#include <map>
#include <memory>
#include <stdexcept>
#include <string>
#include <utility>
#include <variant>
#include <vector>

namespace builtin_interfaces::msg {
struct Time {
  std::int32_t sec = 0;
  std::uint32_t nanosec = 0;
};
}  // namespace builtin_interfaces::msg

namespace rclcpp {

class Time {
 public:
  explicit Time(std::int64_t nanoseconds = 0) : nanoseconds_(nanoseconds) {}
  double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_); }
  operator builtin_interfaces::msg::Time() const {
    return {static_cast<std::int32_t>(nanoseconds_ / 1000000000),
            static_cast<std::uint32_t>(nanoseconds_ % 1000000000)};
  }

 private:
  std::int64_t nanoseconds_;
};

class Duration {
 public:
  explicit Duration(std::int64_t nanoseconds) : nanoseconds_(nanoseconds) {}
  double seconds() const { return 1e-9 * static_cast<double>(nanoseconds_); }

 private:
  std::int64_t nanoseconds_;
};

class QoS {};
class SystemDefaultsQoS : public QoS {};

template <class Message>
class Publisher {
 public:
  using SharedPtr = std::shared_ptr<Publisher>;
  void publish(const Message& message) { published.push_back(message); }
  std::vector<Message> published;  // for the test
};

class Logger {
 public:
  std::shared_ptr<std::vector<std::string>> lines = std::make_shared<std::vector<std::string>>();
};

class Parameter {
 public:
  using Value = std::variant<std::string, std::vector<std::string>>;
  explicit Parameter(Value value) : value_(std::move(value)) {}
  std::string as_string() const { return std::get<std::string>(value_); }
  std::vector<std::string> as_string_array() const {
    return std::get<std::vector<std::string>>(value_);
  }

 private:
  Value value_;
};

}  // namespace rclcpp

#define RCLCPP_ERROR(logger, ...)                          \
  do {                                                     \
    char line_[512];                                       \
    std::snprintf(line_, sizeof line_, __VA_ARGS__);       \
    (logger).lines->push_back(line_);                      \
  } while (false)
