// SPDX-License-Identifier: Apache-2.0
// The signals of all joints and sensors, read into the rows of the balances.
#pragma once

#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/balance.hpp"
#include "touchline/health.hpp"
#include "touchline/signals.hpp"
#include "touchline/spatial.hpp"

namespace touchline {

// Joint torques: the settings of all joints side by side.
class JointReadings {
 public:
  explicit JointReadings(const std::vector<JointRow>& joints) : present_(joints.size(), 0) {
    for (const JointRow& joint : joints) {
      measured_.push_back(joint.measured());
      gain_.push_back(joint.gain);
      sign_.push_back(joint.sign);
      bias_.push_back(joint.measured() ? joint.bias : kNaN);
      range_.push_back(joint.range);
      viscous_.push_back(joint.viscous);
      if (joint.coulomb != 0.0) rough_.push_back(gain_.size() - 1);
      coulomb_.push_back(joint.coulomb);
      width_.push_back(joint.coulomb_width);
    }
  }

  // Per joint: was its last torque usable?
  const std::vector<char>& present() const { return present_; }

  // Writes the known loads u = tau - friction - n [Nm] (NaN for joints that have no sensor);
  // returns whether all joints that should have one have a usable torque.
  bool read(const double* logged, const double* qd, const double* n_bar, double* u,
            Health& health) {
    const std::size_t n = gain_.size();
    bool good = true, saturated = false;
    for (std::size_t j = 0; j < n; ++j) {
      const double reading = gain_[j] * logged[j];
      u[j] = sign_[j] * reading - bias_[j] - viscous_[j] * qd[j] - n_bar[j];
      saturated |= measured_[j] && std::fabs(reading) >= range_[j];
      present_[j] = measured_[j] && std::fabs(logged[j]) < kAbsurd;
      good &= present_[j] == measured_[j];
    }
    for (std::size_t j : rough_) u[j] -= coulomb_[j] * std::tanh(qd[j] / width_[j]);
    if (saturated) health |= kSaturated;
    if (!good) tell(logged, health);
    return good;
  }

 private:
  void tell(const double* logged, Health& health) const {
    for (std::size_t j = 0; j < measured_.size(); ++j) {
      if (measured_[j]) health |= judge(logged[j]);
    }
  }

  std::vector<char> measured_, present_;
  std::vector<double> gain_, sign_, bias_, range_, viscous_, coulomb_, width_;
  std::vector<std::size_t> rough_;  // joints with Coulomb friction
};

}  // namespace touchline
