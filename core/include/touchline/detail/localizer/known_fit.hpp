// SPDX-License-Identifier: Apache-2.0
// Do contacts whose places are known explain a measurement, and which of their forces have changed
// at that? No allocation.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/joint_fit.hpp"
#include "touchline/detail/place/past.hpp"

namespace touchline {

class KnownFit {
 public:
  // `free`: standard deviation of a force that may change [N].
  KnownFit(const Measurement& measurement, JointFit& fit, double free)
      : measurement_(measurement), fit_(fit), free_(free) {}

  // Do they explain the measurement with their forces held, or with one of them changed?
  bool explain(const JointEstimate& estimate) {
    change_ = Change::none();
    fit_.begin(measurement_, estimate);
    const double held = fit_.cost(estimate, change_);
    if (held < limit(0, kCalm)) return true;
    double least = limit(3, kArrival);
    for (int c = 0; c < estimate.count; ++c) {
      const Change one = Change::of_force(c, free_);
      const double cost = fit_.cost(estimate, one);
      if (cost < least && held - cost > chi2_limit(3, kCalm)) {
        least = cost;
        change_ = one;
      }
    }
    return least < limit(3, kArrival) || held < limit(0, kArrival);
  }

  // Do they, one of them anywhere and with any force, as well as if nothing had changed?
  bool explain_calmly(const JointEstimate& estimate) {
    change_ = Change::none();
    fit_.begin(measurement_, estimate);
    return fit_.cost(estimate, change_) < limit(JointFit::kEach, kCalm);
  }

  // Do they with all their forces free?
  bool explain_freely(const JointEstimate& estimate) {
    change_ = Change::of_forces(estimate.count, free_);
    fit_.begin(measurement_, estimate);
    return fit_.cost(estimate, change_) < limit(3 * estimate.count, kArrival);
  }

  // Does a sole one with its force free, if `mean` is where its body was when it felt what `q` says
  // of its wrench?
  bool explain_alone(const JointEstimate& estimate, Quadratic q, const Mean& mean) {
    change_ = Change::of_force(0, free_);
    q.shift({{}, mean.moment});
    fit_.begin_alone(q, estimate, mean.pose);
    return fit_.cost(estimate, change_) < limit(3, kArrival);
  }

  // What has changed, by the last explanation.
  const Change& change() const { return change_; }
  bool held() const { return !change_.any(); }

 private:
  // Squared distances beyond which forces are no longer held, and beyond which known contacts do
  // not explain a sample: this many sigmas of a normal variable. Independent looks come every 2 / K:
  // with ideal noise and K = 100 rad/s one false arrival in 19 h of contact.
  static constexpr double kCalm = 3.0, kArrival = 5.0;

  // What chi2 does not exceed, with so many unknowns.
  double limit(int unknowns, double sigmas) const {
    return chi2_limit(std::max(1, measurement_.size() - unknowns), sigmas);
  }

  const Measurement& measurement_;
  JointFit& fit_;
  double free_;
  Change change_;
};

}  // namespace touchline
