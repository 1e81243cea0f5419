// SPDX-License-Identifier: Apache-2.0
// For tests: what the broadcaster uses of ROS 2 Jazzy, with the published signatures and no ROS behind.
#pragma once

namespace std_msgs::msg {
struct Bool {
  bool data = false;
};
}  // namespace std_msgs::msg
