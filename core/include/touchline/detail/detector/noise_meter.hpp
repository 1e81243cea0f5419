// SPDX-License-Identifier: Apache-2.0
// How noisy a row is, as seen: the scatter of its residual about its own short mean, while nothing
// touches. No allocation.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>

#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class NoiseMeter {
 public:
  // `bandwidth` of the row's filter [rad/s]; `least`: a sigma below which noise does not matter
  // [N or Nm].
  NoiseMeter(double bandwidth, double least, const DetectorTuning& t)
      : bandwidth_(bandwidth),
        mean_rate_(bandwidth / t.noise_mean),
        least_(least),
        told_(least) {}

  // The variance that noise as told has in the row now: of readings, which lasts for 1 / K, and of
  // velocities, which is nearly white.
  void tell(double of_readings, double of_velocities, const DetectorTuning& t) {
    const double sum = of_readings + of_velocities;
    bare_ = std::sqrt(sum);
    told_ = std::max(least_, bare_);
    passed_ = sum > 0.0
        ? (of_readings * t.noise_mean / (1.0 + t.noise_mean) + of_velocities) / sum : 1.0;
  }

  // The next residual [N or Nm], `dt` [s] after the one before; `counts` unless it may be a contact's.
  void add(double value, double dt, bool counts, const DetectorTuning& t) {
    if (!running_) {
      running_ = true;
      mean_ = value;
      return;
    }
    const double off = value - mean_;
    mean_ += off * std::min(1.0, dt * mean_rate_);
    if (!counts) return;
    double square = off * off / passed_;  // of what lasts the mean takes a part
    double news = news_after(dt);
    const double most = t.noise_far * t.noise_far * std::max(variance_, told_ * told_);
    const bool far = square > most;
    square = std::min(square, most);
    if (far) news *= t.noise_doubted;
    count_ += news * (1.0 - count_ / t.noise_most);
    variance_ += (square - variance_) * std::min(1.0, news / count_);
  }

  // One sigma of the noise as seen [N or Nm].
  double sigma() const { return std::sqrt(variance_); }

  // Does what is seen speak against what is told? A variance of `count_` values has the relative
  // standard deviation sqrt(2 / count_).
  bool contradicts(const DetectorTuning& t) const { return exceeds(told_, t); }

  // How many times as large as told it is; 1 where that is not certain, or no more than noise figures
  // err by.
  double excess(const DetectorTuning& t) const {
    const double ratio = bare_ > 0.0 && exceeds(bare_, t) ? sigma() / bare_ : 1.0;
    return ratio > t.noisier ? ratio : 1.0;
  }

  // What noise exceeds as rarely as a normal variable exceeds `sigmas` of its true sigma. Where
  // seen noise speaks against the told one that is the quantile of Student's t for so many
  // independent values (Wallace 1959): few values tell little.
  // Until then noise may be `first` times as large as told.
  double limit(double sigmas, double first, const DetectorTuning& t) const {
    const double least = count_ < t.noise_enough ? std::max(told_, first * bare_) : told_;
    if (!contradicts(t)) return sigmas * least;
    const double n = count_, z = sigmas * (8.0 * n + 3.0) / (8.0 * n + 1.0);
    return std::max(sigmas * least, sigma() * std::sqrt(n * std::expm1(z * z / n)));
  }

 private:
  bool exceeds(double told, const DetectorTuning& t) const {
    if (!(variance_ > told * told)) return false;  // as nearly always: the root is dear
    return count_ > t.noise_few &&
        variance_ > told * told * (1.0 + t.noise_sure * std::sqrt(2.0 / count_));
  }

  // How much of a value is new after dt [s]: squares of filtered noise are like each other for
  // 1 / 2K. The stamps of a steady clock differ by two numbers that take turns, as they are rounded:
  // both are remembered, since the function is dear.
  double news_after(double dt) {
    if (dt == known_.dt) return known_.news;
    std::swap(known_, other_);
    if (dt != known_.dt) known_ = {dt, std::tanh(bandwidth_ * dt)};
    return known_.news;
  }

  struct News {
    double dt = 0.0, news = 0.0;  // [s], of a value
  };

  News known_, other_;
  double bandwidth_, mean_rate_, least_, told_;
  double bare_ = 0.0, passed_ = 1.0, mean_ = 0.0, variance_ = 0.0, count_ = 0.0;
  bool running_ = false;
};

}  // namespace touchline
