// SPDX-License-Identifier: Apache-2.0
// Which six-axis sensors have no reading that counts. One that settles again has yet to.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/gates/channel_gates.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/robot.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class AbsentSensors {
 public:
  explicit AbsentSensors(std::size_t sensors) : absent_(sensors, 0) {}

  // In a sample of which the gates believe this.
  void find(const Sample& sample, const ChannelGates& gates, const Robot& robot) {
    any_ = false;
    for (std::size_t s = 0; s < absent_.size(); ++s) {
      absent_[s] = absent(sample, gates, robot.sensors[s], s);
      any_ = any_ || absent_[s] != 0;
    }
  }
  bool any() const { return any_; }
  const std::vector<char>& all() const { return absent_; }  // per sensor

 private:
  static bool absent(const Sample& sample, const ChannelGates& gates, const SensorRow& sensor,
                     std::size_t s) {
    double sum = 0.0;
    for (int i = 0; i < 6; ++i) {
      if (!sensor.axes[i]) continue;
      if (gates.passes(gates.layout().wrench() + 6 * s + i)) return true;
      sum += std::fabs(sample.wrench[6 * s + i]);
    }
    return !(sum < kAbsurd);
  }

  std::vector<char> absent_;
  bool any_ = false;
};

}  // namespace touchline
