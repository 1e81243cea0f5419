// SPDX-License-Identifier: Apache-2.0
// What a sample says of contacts on some bodies, kept: work on it can go on in the samples that follow,
// and all of it speaks of the same one. No allocation after construction.
// Theory: docs/theory.md, section 6.4.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/localizer/joint_estimate.hpp"
#include "touchline/detail/place/measurement.hpp"

namespace touchline {

class HeldSample {
 public:
  // `rows`: at most so many are measured.
  explicit HeldSample(std::size_t rows) : values_(rows), loads_(kBodies * rows * 6) {}

  // Takes what `measurement` has read, to the scale of the noise.
  void take(const Measurement& measurement) {
    measurement_ = &measurement;
    rows_ = measurement.size();
    bodies_ = 0;
    measurement.values(values_.data(), 1);
    measurement.whiten(values_.data(), 1);
  }

  // And of contacts on the body of `node` whose force is `lag` [s] old. Those beyond the most are left out.
  void add(int node, double lag) {
    if (find(node, lag) >= 0 || bodies_ == kBodies) return;
    const Posture& posture = measurement_->posture();
    body_[bodies_] = {node, lag, measurement_->lag(lag), posture.pose(node), posture.twist(node)};
    double* out = loads_.data() + bodies_++ * rows_ * 6;
    for (int i = 0; i < 6; ++i) {
      double unit[6] = {};
      unit[i] = 1.0;
      measurement_->load(node, touchline::load(unit), lag, out + i, 6);
    }
    for (int i = 0; i < 6; ++i) measurement_->whiten(out + i, 6);
  }

  int size() const { return rows_; }

  // What force and shift of a contact do to all rows, in columns of a matrix of that width.
  void columns(const KnownContact& k, double* out, int width) const {
    const int at = std::max(0, find(k.node, k.lag));
    const Body& body = body_[at];
    const Vec3 now = body.pose.R * k.point + body.pose.p;
    const Vec3 p = now - body.way * (body.twist.linear + cross(body.twist.angular, now));
    Vec3 along[2];
    tangents(k.normal, along[0], along[1]);
    for (Vec3& v : along) v = cross(body.pose.R * v, k.force);
    const double* load = loads_.data() + at * rows_ * 6;
    for (int r = 0; r < rows_; ++r, load += 6, out += width) {
      const Vec3 moment{load[3], load[4], load[5]}, turned = cross(moment, p);
      out[0] = load[0] + turned.x;
      out[1] = load[1] + turned.y;
      out[2] = load[2] + turned.z;
      for (int i = 0; i < 2; ++i) out[3 + i] = dot(moment, along[i]);
    }
  }

  // What is measured, in a column of that width.
  void values(double* out, int width) const {
    for (int r = 0; r < rows_; ++r) out[r * width] = values_[r];
  }

 private:
  static constexpr int kBodies = JointEstimate::kMost + Answer::kCandidates;  // room

  struct Body {
    int node;
    double lag, way;  // told; of what is measured [s]
    Pose pose;
    Spatial twist;
  };

  int find(int node, double lag) const {
    int any = -1;
    for (int i = 0; i < bodies_; ++i) {
      if (body_[i].node != node) continue;
      if (body_[i].lag == lag) return i;
      any = i;
    }
    return any;
  }

  const Measurement* measurement_ = nullptr;
  std::vector<double> values_, loads_;  // loads: of each body (rows, 6), of wrenches about the origin
  Body body_[kBodies];
  int rows_ = 0, bodies_ = 0;
};

}  // namespace touchline
