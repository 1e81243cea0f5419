// SPDX-License-Identifier: Apache-2.0
// Where the bodies were when they felt what a filtered wrench speaks of. Of a force f at a point c
// of a moving body (R, p) the filter keeps the moment
//   int K exp(-K a) (R c + p)(t - a) x f(t - a) da.
// That is the moment of the filtered force at the mean place, weighed by the force that was felt
// then, and a rest, where the force has turned meanwhile. No allocation per sample.
// Theory: docs/theory.md, section 5.3.
#pragma once

#include <cmath>
#include <vector>

#include "touchline/detail/model/mesh.hpp"
#include "touchline/detail/model/posture.hpp"

namespace touchline {

// The mean place of a point c of a body is R c + p (R is a mean of rotations, not one itself).
struct Mean {
  Pose pose;
  Vec3 moment;  // the rest, at the body's origin [Nm]
};

// What is not known of where a body was: a part of the way it has come since, and so much per
// squared angle that it has turned [m]. A turn moves points `reach` [m] from its origin.
struct Doubt {
  double way, turn, reach;
};

// Of a body that has long moved with a steady twist (about the world origin) and felt a steady
// force: exp(-a V), averaged with K exp(-K a), is (1 + V / K)^-1. `lag`: 1 / K [s].
inline Mean steady_mean(const Pose& now, const Spatial& twist, double lag) {
  const Vec3 u = lag * twist.angular;
  const double scale = 1.0 / (1.0 + dot(u, u));
  const auto back = [&](const Vec3& x) {  // (1 + [u])^-1 x
    return scale * (x + dot(u, x) * u - cross(u, x));
  };
  return {{{back(now.R.x), back(now.R.y), back(now.R.z)}, back(now.p - lag * twist.linear)}, {}};
}

class Past {
 public:
  // `worn`: part of the force that must have kept its direction.
  Past(std::size_t nodes, double worn) : worn_(worn), bodies_(nodes) {}

  void restart() { weight_ = 0.0; }

  // Takes the filtered force of a sample. What a filter of bandwidth K has gained since the sample
  // before is what was felt between the two.
  void follow(const Vec3& force, double bandwidth, double time, const Posture& posture) {
    const double size = norm(force);
    if (!(size > 0.0)) return;
    double keep = std::exp(-bandwidth * (time - time_));
    if (!(weight_ > worn_ * norm(force_)) || !(keep < 1.0)) keep = 0.0;
    const bool anew = keep == 0.0;
    const Vec3 gained = force - keep * (anew ? Vec3{} : force_);
    const double gain = dot(gained, force) / size;
    weight_ = (anew ? 0.0 : keep * weight_) + gain;
    for (std::size_t i = 0; i < bodies_.size(); ++i) {
      Body& b = bodies_[i];
      const Pose& now = posture.pose(static_cast<int>(i));
      if (anew) b = {now, {}, {}, {}};
      const Vec3 p = 0.5 * (b.before.p + now.p);
      turn(b.R.x, keep, gain, b.before.R.x, now.R.x);
      turn(b.R.y, keep, gain, b.before.R.y, now.R.y);
      turn(b.R.z, keep, gain, b.before.R.z, now.R.z);
      b.p = keep * b.p + gain * p;
      b.moment = keep * b.moment + cross(p, gained);
      b.before = now;
    }
    force_ = force;
    time_ = time;
  }

  Mean mean(int node) const {
    const Body& b = bodies_[node];
    const double s = 1.0 / weight_;
    const Vec3 p = s * b.p;
    return {{{s * b.R.x, s * b.R.y, s * b.R.z}, p}, b.moment - cross(p, force_)};
  }
  // Is there a mean?
  bool known() const { return weight_ > worn_ * norm(force_); }

 private:
  struct Body {
    Pose before;
    Mat3 R;  // these three weighed and summed up
    Vec3 p, moment;
  };

  static void turn(Vec3& sum, double keep, double gain, const Vec3& before, const Vec3& now) {
    sum = keep * sum + (0.5 * gain) * (before + now);
  }

  double worn_;
  std::vector<Body> bodies_;  // per node
  Vec3 force_;
  double weight_ = 0.0, time_ = 0.0;
};

}  // namespace touchline
