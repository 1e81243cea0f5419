// SPDX-License-Identifier: Apache-2.0
// How far the arm has come from where the baseline of a segment was averaged: an error of the model
// that the baseline has taken out comes back as the arm moves on. No allocation per sample.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class BaselinePosture {
 public:
  BaselinePosture(std::size_t segments, std::size_t joints)
      : joints_(joints), mean_(segments * joints, 0.0) {}

  // The baseline takes a sample with the weight `gain`.
  void average(std::size_t segment, const double* q, double gain) {
    double* mean = mean_.data() + segment * joints_;
    for (std::size_t j = 0; j < joints_; ++j) mean[j] += gain * (q[j] - mean[j]);
  }

  // Sum of squares of the joints' ways since [rad2].
  double distance2(std::size_t segment, const double* q) const {
    const double* mean = mean_.data() + segment * joints_;
    double sum = 0.0;
    for (std::size_t j = 0; j < joints_; ++j) sum += (q[j] - mean[j]) * (q[j] - mean[j]);
    return sum;
  }

 private:
  std::size_t joints_;
  std::vector<double> mean_;  // per segment: joint positions
};

// Which share of the constant part of the model's errors comes back `way2` [rad2] away from where the
// baseline was averaged. That part is what an arm leaves on its way through ordinary motion. Weight
// changes with the pose, about in proportion to the way as far as `drift_farthest`. In a joint's own
// torque there is friction, too, all of which comes with motion.
struct DriftShares {
  DriftShares(const Activity& activity, double way2, const DetectorTuning& t)
      : of_wrench(std::min(way2, t.drift_farthest * t.drift_farthest) / (t.drift_way * t.drift_way)),
        of_torque(std::max(of_wrench,
                           std::min(1.0, activity.speed2 / (t.drift_speed * t.drift_speed)))) {}
  double of_wrench, of_torque;
};

// Variance of what the model's errors have added to a row since its baseline.
inline double drifted(const DetectionRow& row, const Activity& activity, const DriftShares& shares) {
  const double share = row.component < 0 ? shares.of_torque : shares.of_wrench;
  const double constant = row.drift.constant;
  return row.drift.variance(activity) + (share - 1.0) * constant * constant;
}

}  // namespace touchline
