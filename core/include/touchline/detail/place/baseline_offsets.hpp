// SPDX-License-Identifier: Apache-2.0
// What the detector has taken out of the rows of a segment: the offset of its wrench and of each
// joint's torque, and how sure it is.
// Theory: docs/theory.md, section 5.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

class BaselineOffsets {
 public:
  BaselineOffsets(const Observer& observer, const Posture& posture, std::vector<DetectionRow> tests)
      : observer_(observer),
        posture_(posture),
        tests_(std::move(tests)),
        joints_(observer.row_layout().joints) {}

  // From the observer's row and the detector's normalized rows; `raw` is the segment's wrench, or
  // null. Without normalized rows (null) there are no offsets.
  void find(int segment, const double* row, const double* normalized, const double* raw) {
    std::fill(joints_.begin(), joints_.end(), 0.0);
    std::fill(wrench_, wrench_ + 6, 0.0);
    if (normalized == nullptr) return;
    const int torques = observer_.row_layout().segment_torque();
    double clean[6];
    bool complete = false;
    for (std::size_t i = 0; i < tests_.size(); ++i) {
      const DetectionRow& test = tests_[i];
      if (test.segment != segment) continue;
      const double value = normalized[i] * test.contact;
      if (test.component < 0) {
        joints_[test.joint] = row[torques + test.joint] - value;
      } else {
        clean[test.component] = value;
        complete = test.component == 5;
      }
    }
    if (raw == nullptr || !complete) return;
    const int sensor = observer_.layout().segments[segment].sensor;
    store(wrench_to_parent(posture_.pose(observer_.sensors()[sensor].node),
                           {{clean[0], clean[1], clean[2]}, {clean[3], clean[4], clean[5]}}),
          clean);
    for (int i = 0; i < 6; ++i) wrench_[i] = raw[i] - clean[i];
  }

  const double* wrench() const { return wrench_; }
  double joint(int j) const { return joints_[j]; }
  const std::vector<DetectionRow>& tests() const { return tests_; }

  // Of a mean of filtered noise over `time` [s], in parts of the variance of one sample.
  double variance(int segment, double time) const {
    const int sensor = observer_.layout().segments[segment].sensor;
    const double bandwidth = sensor >= 0       ? observer_.sensors()[sensor].bandwidth
                             : !joints_.empty() ? observer_.joints()[0].bandwidth
                                                : 0.0;
    const double x = bandwidth * time;
    return x > 1e-3 ? 2.0 / x * (1.0 - (1.0 - std::exp(-x)) / x) : 1.0;
  }

 private:
  const Observer& observer_;
  const Posture& posture_;
  std::vector<DetectionRow> tests_;
  double wrench_[6] = {};
  std::vector<double> joints_;
};

}  // namespace touchline
