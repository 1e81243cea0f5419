// SPDX-License-Identifier: Apache-2.0
// How the noise of the signals reaches the rows that a segment is judged by: linear in independent
// sources (readings, velocities), from which the covariance of all rows follows. No allocation per
// sample.
// Theory: docs/theory.md, section 5.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/noise_figures.hpp"
#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

class RowNoise {
 public:
  RowNoise(const Observer& observer, const Posture& posture, NoiseFigures figures, std::size_t rows)
      : observer_(observer),
        posture_(posture),
        figures_(std::move(figures)),
        sensors_(observer.row_layout().sensors),
        joints_(observer.row_layout().joints),
        sources_(6 * sensors_ + 2 * joints_),
        room_((static_cast<int>(rows) + kLanes - 1) / kLanes * kLanes),
        coefficients_(room_ * sources_),
        units_(6 * sensors_) {}

  // Of so many rows, all that the methods below add to them begins anew.
  void clear(int rows) {
    width_ = (rows + kLanes - 1) / kLanes * kLanes;
    std::fill_n(coefficients_.begin(), width_ * sources_, 0.0);
    for (int s = 0; s < sensors_; ++s) {
      for (int a = 0; a < 6; ++a) units_[6 * s + a] = unit_wrench(observer_.sensors()[s].node, a);
    }
  }

  // Rows `at` to `at + 5`: the wrench of a segment [world].
  void add_wrench(int at, const Segment& segment) {
    const Gains g = gains(observer_.sensors()[segment.sensor].bandwidth);
    add_sensor(at, segment.sensor, g, 1.0);
    for (int t : segment.successors) add_sensor(at, t, g, -1.0);
  }

  // A row that is one axis of a sensor.
  void add_axis(int at, int sensor, int axis) {
    const Gains g = gains(observer_.sensors()[sensor].bandwidth);
    of(at, 6 * sensor + axis) = g.reading * figures_.wrench[6 * sensor + axis];
    const int node = observer_.sensors()[sensor].node;
    add_velocity(at, posture_.axis(node, axis), node, g.velocity);
  }

  // A row that is a joint's torque, less what the sensors outboard of it say.
  void add_joint(int at, int j) {
    const JointRow& joint = observer_.joints()[j];
    const Gains g = gains(joint.bandwidth);
    of(at, 6 * sensors_ + j) = g.reading * figures_.tau[j];
    for (int node : joint.nodes) add_velocity(at, posture_.subspace(node), node, g.velocity);
    for (const Projection& pair : observer_.layout().outboard_sensors[j]) {
      const Spatial& s = posture_.subspace(observer_.layout().lines[pair.line]);
      const int node = observer_.sensors()[pair.sensor].node;
      for (int a = 0; a < 6; ++a)
        of(at, 6 * pair.sensor + a) -=
            g.reading * figures_.wrench[6 * pair.sensor + a] * dot(s, units_[6 * pair.sensor + a]);
      add_velocity(at, s, node, -g.velocity);
    }
  }

  // The lower triangle of the covariance (size, size) of the first rows, of which `forces` are
  // forces. The floors cover what the trapezoid leaves of motion: on arms of 20 kg 1e-5 N where every
  // joint turns at 1 rad/s, 7e-4 N at 3 rad/s. Where all swing at 2 Hz it is more (4e-3 N and Nm).
  void covariance(int size, int forces, double* out) const {
    // The noise of a torque reaches one row alone.
    const int own = 6 * sensors_, shared = own + joints_;
    for (int a = 0; a < size; ++a) {
      double alone = 0.0;
      for (int k = own; k < shared; ++k) {
        const double of_source = coefficients_[k * width_ + a];
        alone += of_source * of_source;
      }
      for (int b = 0; b <= a; b += kLanes) {
        Lanes sum = all_lanes(0.0);
        const auto add = [&](int k) {
          const double* of_source = coefficients_.data() + k * width_;
          sum += all_lanes(of_source[a]) * load_lanes(of_source + b);
        };
        for (int k = 0; k < own; ++k) add(k);
        if (a < b + kLanes) set_lane(sum, a - b, lane(sum, a - b) + alone);
        for (int k = shared; k < sources_; ++k) add(k);
        for (int c = 0; c < kLanes && b + c <= a; ++c) out[a * size + b + c] = lane(sum, c);
      }
      const double least = a < forces ? figures_.force : figures_.moment;
      out[a * size + a] += least * least;
    }
  }

 private:
  // How a first-order filter passes noise: of readings, averaged over each interval, and of
  // velocities, which enter through a difference of momenta.
  struct Gains {
    double reading, velocity;
  };
  Gains gains(double bandwidth) const {
    const double dt = figures_.period, a = pole(bandwidth, dt, Discretization::automatic);
    return {std::sqrt(std::min(1.0, 0.5 * (1.0 - a))),
            (1.0 - a) / dt * std::sqrt(2.0 / (1.0 + a))};
  }

  void add_sensor(int at, int s, const Gains& g, double sign) {
    const int node = observer_.sensors()[s].node;
    for (int a = 0; a < 6; ++a)
      add_column(at, 6 * s + a, units_[6 * s + a],
                 sign * g.reading * figures_.wrench[6 * s + a]);
    for (int i = 0; i < joints_; ++i)
      add_column(at, 6 * sensors_ + joints_ + i, posture_.momentum(node, i),
                 sign * g.velocity * figures_.qd[i]);
  }

  void add_column(int at, int source, const Spatial& w, double scale) {
    double values[6];
    store(w, values);
    for (int i = 0; i < 6; ++i) of(at + i, source) += scale * values[i];
  }

  // What the noise of velocities does to the momentum of a node along a twist.
  void add_velocity(int at, const Spatial& along, int node, double gain) {
    for (int c = 0; c < joints_; ++c)
      of(at, 6 * sensors_ + joints_ + c) += gain * figures_.qd[c] * dot(along, posture_.momentum(node, c));
  }

  Spatial unit_wrench(int node, int axis) const {
    double w[6] = {0, 0, 0, 0, 0, 0};
    w[axis] = 1.0;
    return wrench_to_parent(posture_.pose(node), {{w[0], w[1], w[2]}, {w[3], w[4], w[5]}});
  }

  double& of(int row, int source) { return coefficients_[source * width_ + row]; }

  const Observer& observer_;
  const Posture& posture_;
  NoiseFigures figures_;
  int sensors_, joints_, sources_;
  int room_, width_ = 0;  // for rows, and those in use: whole registers
  std::vector<double> coefficients_;  // sources by rows
  std::vector<Spatial> units_;        // per sensor and axis: a unit of it [world]
};

}  // namespace touchline
