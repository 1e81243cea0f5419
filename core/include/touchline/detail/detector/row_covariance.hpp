// SPDX-License-Identifier: Apache-2.0
// How the noise of the signals enters the rows that a segment is tested by: velocity noise through
// the momentum, noise of torques and wrenches directly. No allocation per sample.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <algorithm>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/noise_figures.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

class RowCovariance {
 public:
  RowCovariance(const Observer& observer, std::vector<DetectionRow> rows,
                const NoiseFigures& noise)
      : observer_(observer),
        rows_(std::move(rows)),
        joints_(observer.row_layout().joints),
        readings_(joints_ + 6 * observer.row_layout().sensors),
        by_velocity_(rows_.size() * joints_),
        by_reading_(rows_.size() * readings_),
        unit_forces_(3 * observer.sensors().size()),
        momentum_(rows_.size() * rows_.size()),
        reading_(rows_.size() * rows_.size()) {
    for (std::size_t j = 0; j < joints_; ++j) sigma_velocity_.push_back(noise.qd[j]);
    for (std::size_t j = 0; j < joints_; ++j) sigma_reading_.push_back(noise.tau[j]);
    for (std::size_t i = joints_; i < readings_; ++i)
      sigma_reading_.push_back(noise.wrench[i - joints_]);
  }

  // Covariances (r, r): of the rows' momentum, by the velocities; of the rows' loads, by the
  // readings; both of one sample.
  const double* momentum() const { return momentum_.data(); }
  const double* reading() const { return reading_.data(); }

  void evaluate(const Posture& posture) {
    trace(posture);
    square(by_velocity_, sigma_velocity_, momentum_);
    square(by_reading_, sigma_reading_, reading_);
  }

  // The variances alone, without covariances.
  void evaluate_variances(const Posture& posture) {
    trace(posture);
    square(by_velocity_, sigma_velocity_, momentum_, true);
    square(by_reading_, sigma_reading_, reading_, true);
  }

 private:
  // From where the noise of each row comes.
  void trace(const Posture& posture) {
    std::fill(by_velocity_.begin(), by_velocity_.end(), 0.0);
    std::fill(by_reading_.begin(), by_reading_.end(), 0.0);
    for (std::size_t s = 0; s < observer_.sensors().size(); ++s) {
      const Pose& X = posture.pose(observer_.sensors()[s].node);
      const Vec3 axes[3] = {X.R.x, X.R.y, X.R.z};
      for (int a = 0; a < 3; ++a) unit_forces_[3 * s + a] = {axes[a], cross(X.p, axes[a])};
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      double *velocity = by_velocity_.data() + i * joints_,
             *reading = by_reading_.data() + i * readings_;
      if (rows_[i].component >= 0) {
        enter_wrench(posture, rows_[i], velocity, reading);
      } else {
        enter_joint(posture, rows_[i], velocity, reading);
      }
    }
  }

  // A component of the segment's wrench in its sensor's frame: the power that the wrench has on
  // the twist that goes with the component.
  void enter_wrench(const Posture& posture, const DetectionRow& row, double* velocity,
                    double* reading) const {
    const Segment& segment = observer_.layout().segments[row.segment];
    const Pose& X = posture.pose(observer_.sensors()[segment.sensor].node);
    const Vec3 axes[3] = {X.R.x, X.R.y, X.R.z};
    const Vec3& a = axes[row.component % 3];
    const Spatial pick = row.component < 3 ? Spatial{a, {}} : Spatial{cross(X.p, a), a};
    add_sensor(posture, segment.sensor, pick, 1.0, velocity, reading);
    for (int t : segment.successors) add_sensor(posture, t, pick, -1.0, velocity, reading);
  }

  void enter_joint(const Posture& posture, const DetectionRow& row, double* velocity,
                   double* reading) const {
    const JointRow& joint = observer_.joints()[row.joint];
    reading[row.joint] = 1.0;
    for (int node : joint.nodes) {
      for (std::size_t c = 0; c < joints_; ++c)
        velocity[c] += dot(posture.subspace(node), posture.momentum(node, c));
    }
    velocity[row.joint] += joint.rotor_inertia;
    for (const Projection& pair : observer_.layout().outboard_sensors[row.joint])
      add_sensor(posture, pair.sensor, posture.subspace(observer_.layout().lines[pair.line]), -1.0,
                 velocity, reading);
  }

  // What a sensor measures, on a twist in world.
  void add_sensor(const Posture& posture, int s, const Spatial& twist, double sign,
                  double* velocity, double* reading) const {
    const int node = observer_.sensors()[s].node;
    for (std::size_t c = 0; c < joints_; ++c)
      velocity[c] += sign * dot(twist, posture.momentum(node, c));
    double* of_sensor = reading + joints_ + 6 * s;
    for (int a = 0; a < 3; ++a) {
      const Spatial& force = unit_forces_[3 * s + a];  // a unit moment stands along the same axis
      of_sensor[a] += sign * dot(twist, force);
      of_sensor[3 + a] += sign * dot(twist.angular, force.linear);
    }
  }

  void square(const std::vector<double>& by, const std::vector<double>& sigma,
              std::vector<double>& out, bool diagonal = false) const {
    const std::size_t sources = sigma.size(), size = rows_.size();
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = diagonal ? i : 0; j <= i; ++j) {
        double sum = 0.0;
        for (std::size_t c = 0; c < sources; ++c)
          sum += by[i * sources + c] * by[j * sources + c] * sigma[c] * sigma[c];
        out[i * size + j] = out[j * size + i] = sum;
      }
    }
  }

  const Observer& observer_;
  std::vector<DetectionRow> rows_;
  std::size_t joints_, readings_;
  std::vector<double> sigma_velocity_, sigma_reading_;
  std::vector<double> by_velocity_, by_reading_;  // rows, sources
  std::vector<Spatial> unit_forces_;  // per sensor: along its axes, in world
  std::vector<double> momentum_, reading_;
};

}  // namespace touchline
