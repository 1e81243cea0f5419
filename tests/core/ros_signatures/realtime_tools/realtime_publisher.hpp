// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

#include <mutex>

#include "rclcpp/rclcpp.hpp"

namespace realtime_tools {

// Publishes in the caller's thread. A test takes the turn away with `held`.
template <class Message>
class RealtimePublisher {
 public:
  explicit RealtimePublisher(typename rclcpp::Publisher<Message>::SharedPtr publisher)
      : publisher_(std::move(publisher)) {}
  bool trylock() { return !held && mutex_.try_lock(); }
  void unlockAndPublish() {
    mutex_.unlock();
    publisher_->publish(msg_);
  }
  void lock() { mutex_.lock(); }
  void unlock() { mutex_.unlock(); }

  Message msg_;
  static inline bool held = false;

 private:
  typename rclcpp::Publisher<Message>::SharedPtr publisher_;
  std::mutex mutex_;
};

}  // namespace realtime_tools
