// SPDX-License-Identifier: Apache-2.0
// Do contacts whose places are known explain a measurement, and which of their forces have changed
// at that? No allocation.
// Theory: docs/theory.md, section 6.3.
#pragma once

#include <algorithm>

#include "touchline/detail/localizer/joint_fit.hpp"
#include "touchline/detail/place/past.hpp"

namespace touchline {

class KnownFit {
 public:
  KnownFit(const Measurement& measurement, JointFit& fit, const LocalizerSettings& settings)
      : measurement_(measurement), fit_(fit), settings_(settings) {}

  // Do they explain the measurement with their forces held, or with one of them changed?
  bool explain(const JointEstimate& estimate) {
    change_ = Change::none();
    moved_ = false;
    fit_.begin(measurement_, estimate);
    const double held = fit_.cost(estimate, change_);
    if (held < limit(0, settings_.gate_held)) return true;
    double least = limit(3, settings_.gate_arrival);
    for (int c = 0; c < estimate.count; ++c) {
      const Change one = Change::of_force(c, settings_.force_scale);
      const double cost = fit_.cost(estimate, one);
      if (cost < least && held - cost > chi2_limit(3, settings_.gate_held)) {
        least = cost;
        change_ = one;
      }
    }
    if (least >= limit(3, settings_.gate_arrival) && held >= limit(0, settings_.gate_arrival))
      return false;
    least = std::min(least, held - chi2_limit(2, settings_.gate_held));
    for (int c = 0; c < estimate.count && !moved_; ++c)
      moved_ = fit_.cost(estimate, Change::of_place(c, settings_.place_radius)) < least;
    return true;
  }

  // Would one that has moved along its body explain more than one whose force has changed? So a slide
  // begins. Forces that followed it would hide it, and be wrong after it.
  bool moved() const { return moved_; }

  // Do they, one of them anywhere and with any force, as well as if nothing had changed?
  bool explain_calmly(const JointEstimate& estimate) {
    change_ = Change::none();
    fit_.begin(measurement_, estimate);
    return fit_.cost(estimate, change_) < limit(JointFit::kEach, settings_.gate_held);
  }

  // Do they with all their forces free?
  bool explain_freely(const JointEstimate& estimate) {
    change_ = Change::of_forces(estimate.count, settings_.force_scale);
    fit_.begin(measurement_, estimate);
    return fit_.cost(estimate, change_) < limit(3 * estimate.count, settings_.gate_arrival);
  }

  // Does a sole one with its force free, if `mean` is where its body was when it felt what `q` says
  // of its wrench?
  bool explain_alone(const JointEstimate& estimate, Quadratic q, const Mean& mean) {
    change_ = Change::of_force(0, settings_.force_scale);
    q.shift({{}, mean.moment});
    fit_.begin_alone(q, estimate, mean.pose);
    return fit_.cost(estimate, change_) < limit(3, settings_.gate_arrival);
  }

  // What has changed, by the last explanation.
  const Change& change() const { return change_; }
  bool held() const { return !change_.any(); }

 private:
  // What chi2 does not exceed, with so many unknowns.
  double limit(int unknowns, double sigmas) const {
    return chi2_limit(std::max(1, measurement_.size() - unknowns), sigmas);
  }

  const Measurement& measurement_;
  JointFit& fit_;
  const LocalizerSettings& settings_;
  Change change_;
  bool moved_ = false;
};

}  // namespace touchline
