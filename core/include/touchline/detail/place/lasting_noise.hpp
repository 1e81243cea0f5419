// SPDX-License-Identifier: Apache-2.0
// Errors that stay while a contact lasts, unlike white noise, which any mean takes away. They are of
// the model, as far as the arm has moved on since the baseline, and of gains, which grow with the load.
// No allocation per sample.
// Theory: docs/theory.md, section 5.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/detail/place/segment_rows.hpp"

namespace touchline {

class LastingNoise {
 public:
  LastingNoise(const Observer& observer, const Posture& posture, std::vector<DetectionRow> tests,
               double wrench_error, double torque_error, double wrench_error_off)
      : observer_(observer),
        posture_(posture),
        tests_(std::move(tests)),
        wrench_error_(wrench_error),
        torque_error_(torque_error),
        wrench_errors_{wrench_error, std::max(wrench_error, wrench_error_off)},
        joints_(observer.row_layout().joints, 0.0) {}

  double torque_error() const { return torque_error_; }
  // Are torques as good as their noise figures say?
  bool exact_torques() const { return torque_error_ == 0.0; }

  // Does any wrench of the arm stand off? A wrong gain does that, as the sensor bears weight.
  void set_off(bool off) { wrench_error_ = wrench_errors_[off ? 1 : 0]; }

  // Takes what the model's errors have added to the rows of the detector (see `Detector::drift`),
  // or null: nothing. Returns whether there is any lasting error.
  bool find(int segment, const double* drift) {
    std::fill(joints_.begin(), joints_.end(), 0.0);
    std::fill(wrench_, wrench_ + 6, 0.0);
    bool any = wrench_error_ > 0.0 || torque_error_ > 0.0;
    for (std::size_t i = 0; drift != nullptr && i < tests_.size(); ++i) {
      const DetectionRow& test = tests_[i];
      if (test.segment != segment) continue;
      (test.component < 0 ? joints_[test.joint] : wrench_[test.component]) = drift[i];
      any = any || drift[i] > 0.0;
    }
    return any;
  }

  // The lower triangle of the covariance (size, size) of a segment's wrench [world], of `sensor` and
  // loaded by `load`, if there is one; then of the rows in use, which read `values`.
  void covariance(int sensor, const Spatial& load, const SegmentRow* const* rows,
                  const double* values, int count, int size, double* out) const {
    const int first = size - count;
    std::fill(out, out + size * size, 0.0);
    if (first > 0) add_wrench(sensor, load, size, out);
    for (int i = 0; i < count; ++i)
      out[(first + i) * (size + 1)] = row_variance(*rows[i], values[i], first, size, out);
  }

 private:
  void add_wrench(int sensor, const Spatial& load, int size, double* out) const {
    const Pose& X = posture_.pose(observer_.sensors()[sensor].node);
    const Spatial own = wrench_to_child(X, load);
    const double e = wrench_error_ * wrench_error_;
    const double gain[2] = {e * dot(own.linear, own.linear), e * dot(own.angular, own.angular)};
    const Vec3 axes[3] = {X.R.x, X.R.y, X.R.z};
    for (int a = 0; a < 6; ++a) {
      const double variance = wrench_[a] * wrench_[a] + gain[a / 3];
      double w[6];
      store(a < 3 ? Spatial{axes[a], cross(X.p, axes[a])} : Spatial{{}, axes[a - 3]}, w);
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j <= i; ++j) out[i * size + j] += variance * w[i] * w[j];
      }
    }
  }

  double row_variance(const SegmentRow& r, double value, int first, int size,
                      const double* wrench) const {
    if (r.joint >= 0) {
      const double gain = torque_error_ * value, model = joints_[r.joint];
      return gain * gain + model * model;
    }
    // No detector tests an axis of a sensor that has fewer than six: at most what the segment's
    // wrench errs by is felt along it.
    const double gain = wrench_error_ * value;
    double s[6], sum = gain * gain;
    store(posture_.axis(observer_.sensors()[r.sensor].node, r.axis), s);
    for (int i = 0; i < first; ++i) {
      for (int j = 0; j < first; ++j) sum += s[i] * s[j] * wrench[std::max(i, j) * size + std::min(i, j)];
    }
    return sum;
  }

  const Observer& observer_;
  const Posture& posture_;
  std::vector<DetectionRow> tests_;
  double wrench_error_, torque_error_;
  double wrench_errors_[2];     // as told, and of an arm that is not as told
  double wrench_[6] = {};       // by the model: sigmas in the frame of the segment's sensor
  std::vector<double> joints_;  // and of the joints' torques
};

}  // namespace touchline
