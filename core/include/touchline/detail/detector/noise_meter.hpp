// SPDX-License-Identifier: Apache-2.0
// How noisy rows are, as seen: the scatter of their residuals about their own short means, while
// nothing touches. All rows side by side. No allocation after construction.
// Theory: docs/theory.md, section 4.2.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/row_lanes.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

class NoiseMeter {
 public:
  // `bandwidths` of the rows' filters [rad/s]; `least`: per row a sigma below which noise does not
  // matter [N or Nm].
  NoiseMeter(const std::vector<double>& bandwidths, const std::vector<double>& least,
             const DetectorTuning& t)
      : news_(bandwidths, [](double x) { return std::tanh(x); }),
        mean_rate_(bandwidths.size()),
        least_(bandwidths.size()),
        told_(bandwidths.size()),
        bare_(bandwidths.size()),
        passed_(bandwidths.size(), 1.0),
        running_(bandwidths.size()),
        mean_(bandwidths.size()),
        variance_(bandwidths.size()),
        count_(bandwidths.size()) {
    for (std::size_t i = 0; i < bandwidths.size(); ++i) {
      mean_rate_[i] = bandwidths[i] / t.noise_mean;
      least_[i] = told_[i] = least[i];
    }
  }

  // The variance that noise as told has in a row now: of readings, which lasts for 1 / K, and of
  // velocities, which is nearly white.
  void tell(std::size_t i, double of_readings, double of_velocities, const DetectorTuning& t) {
    const double sum = of_readings + of_velocities;
    bare_[i] = std::sqrt(sum);
    told_[i] = std::max(least_[i], bare_[i]);
    passed_[i] = sum > 0.0
        ? (of_readings * t.noise_mean / (1.0 + t.noise_mean) + of_velocities) / sum : 1.0;
  }

  // The next residuals [N or Nm], `dt` [s] > 0 after those before, of the rows that are `known`; one
  // `counts` unless it may be a contact's. Both are 0 or 1.
  void add(const RowLanes& values, const RowLanes& known, const RowLanes& counts, double dt,
           const DetectorTuning& t) {
    const RowLanes& news_after = news_.after(dt);
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    for (std::size_t i = 0; i < mean_.size(); i += kLanes) {
      const Lanes here = known.at(i), runs = running_.at(i), value = values.at(i), mean = mean_.at(i);
      const Lanes off = value - mean, part = dt * mean_rate_.at(i);
      const Lanes moved = mean + off * (part < one ? part : one);
      mean_.put(i, here > zero ? (runs > zero ? moved : value) : mean);
      running_.put(i, here);  // after what is not known the mean begins anew
      const Lanes taken = here * runs * counts.at(i);
      const Lanes variance = variance_.at(i), told = told_.at(i), count = count_.at(i);
      const Lanes told2 = told * told;
      const Lanes most = t.noise_far * t.noise_far * (variance < told2 ? told2 : variance);
      Lanes square = off * off / passed_.at(i);  // of what lasts the mean takes a part
      Lanes news = news_after.at(i);
      news = square > most ? news * t.noise_doubted : news;
      square = most < square ? most : square;
      const Lanes more = count + news * (1.0 - count / t.noise_most), share = news / more;
      const Lanes now = variance + (square - variance) * (share < one ? share : one);
      count_.put(i, taken > zero ? more : count);
      variance_.put(i, taken > zero ? now : variance);
    }
  }

  // Row i goes on for row `of` of another meter.
  void go_on_from(const NoiseMeter& other, std::size_t of, std::size_t i) {
    news_.take(other.news_, of, i);
    for (RowLanes NoiseMeter::* member :
         {&NoiseMeter::mean_rate_, &NoiseMeter::least_, &NoiseMeter::told_, &NoiseMeter::bare_,
          &NoiseMeter::passed_, &NoiseMeter::running_, &NoiseMeter::mean_, &NoiseMeter::variance_,
          &NoiseMeter::count_})
      (this->*member)[i] = (other.*member)[of];
  }

  // One sigma of the noise as seen [N or Nm].
  double sigma(std::size_t i) const { return std::sqrt(variance_[i]); }

  // Does what is seen speak against what is told? A variance of `count` values has the relative
  // standard deviation sqrt(2 / count).
  bool contradicts(std::size_t i, const DetectorTuning& t) const { return exceeds(i, told_[i], t); }

  // How many times as large as told it is; 1 where that is not certain, or no more than noise figures
  // err by.
  double excess(std::size_t i, const DetectorTuning& t) const {
    const double bare = bare_[i];
    const double ratio = bare > 0.0 && exceeds(i, bare, t) ? sigma(i) / bare : 1.0;
    return ratio > t.noisier ? ratio : 1.0;
  }

  // What noise exceeds as rarely as a normal variable exceeds `sigmas` of its true sigma. Where
  // seen noise speaks against the told one that is the quantile of Student's t for so many
  // independent values (Wallace 1959): few values tell little.
  // Until then noise may be `first` times as large as told.
  double limit(std::size_t i, double sigmas, double first, const DetectorTuning& t) const {
    const double least = count_[i] < t.noise_enough ? std::max(told_[i], first * bare_[i]) : told_[i];
    if (!contradicts(i, t)) return sigmas * least;
    const double n = count_[i], z = sigmas * (8.0 * n + 3.0) / (8.0 * n + 1.0);
    return std::max(sigmas * least, sigma(i) * std::sqrt(n * std::expm1(z * z / n)));
  }

 private:
  bool exceeds(std::size_t i, double told, const DetectorTuning& t) const {
    const double variance = variance_[i], count = count_[i];
    if (!(variance > told * told)) return false;  // as nearly always: the root is dear
    return count > t.noise_few &&
        variance > told * told * (1.0 + t.noise_sure * std::sqrt(2.0 / count));
  }

  PerStep news_;  // how much of a value is new: squares of filtered noise are alike for 1 / 2K
  RowLanes mean_rate_, least_, told_, bare_, passed_, running_, mean_, variance_, count_;
};

}  // namespace touchline
