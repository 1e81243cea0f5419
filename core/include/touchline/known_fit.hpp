// SPDX-License-Identifier: Apache-2.0
// Do contacts whose places are known explain a measurement? No allocation.
#pragma once

#include <algorithm>

#include "touchline/joint_fit.hpp"

namespace touchline {

class KnownFit {
 public:
  static constexpr int kMost = JointFit::kMost;
  // Squared distances beyond which known contacts do not explain a sample: this many sigmas of a
  // normal variable. Independent looks come every 2 / K: with ideal noise and K = 100 rad/s one
  // false arrival in 19 h of contact.
  static constexpr double kArrival = 5.0;
  static constexpr double kSteady = 0.05;  // change of a force that is held, in a sample [N]

  // `free`: standard deviation of a force that may change [N].
  KnownFit(const Measurement& measurement, JointFit& fit, double free)
      : measurement_(measurement), fit_(fit), free_(free) {}

  // Do known contacts explain the measurement with their forces held, or with one of them changed?
  bool explain(const KnownContact* known, int count) {
    double sigma[kMost];
    std::fill(sigma, sigma + kMost, kSteady);
    if (fit_.fit(measurement_, known, count, sigma) < limit(0)) return true;
    int best = -1;
    double least = limit(3);
    for (int c = 0; c < count; ++c) {
      sigma[c] = free_;
      const double cost = fit_.fit(measurement_, known, count, sigma);
      sigma[c] = kSteady;
      if (cost < least) {
        least = cost;
        best = c;
      }
    }
    if (best < 0) return false;
    sigma[best] = free_;
    fit_.fit(measurement_, known, count, sigma);
    return true;
  }

  // Do they with all their forces free?
  bool explain_freely(const KnownContact* known, int count) {
    double sigma[kMost];
    std::fill(sigma, sigma + kMost, free_);
    return fit_.fit(measurement_, known, count, sigma) < limit(3 * count);
  }

  // Does a sole one, if `mean` is where its body was when it felt what `q` says of its wrench?
  bool explain_alone(const KnownContact& known, Quadratic q, const Mean& mean) {
    q.shift({{}, mean.moment});
    return fit_.fit_alone(q, known, mean.pose, free_) < limit(3);
  }

 private:
  // What chi2 does not exceed, with so many unknowns.
  double limit(int unknowns) const {
    return chi2_limit(std::max(1, measurement_.size() - unknowns), kArrival);
  }

  const Measurement& measurement_;
  JointFit& fit_;
  double free_;
};

}  // namespace touchline
