// SPDX-License-Identifier: Apache-2.0
// What the joint torques of a segment are while nothing touches: their mean over the last half
// second, and the covariance of what they stray from it, noise, friction and model errors together.
// What came just before a touch was detected belongs to the touch. No allocation per sample.
// Theory: docs/theory.md, section 5.9.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/tuning.hpp"

namespace touchline {

class RestingTorques {
 public:
  RestingTorques(std::size_t joints, const PlaceTuning& tuning)
      : block_(tuning.rest_block),
        memory_(tuning.rest_memory),
        n_(joints),
        blocks_(kBlocks, std::vector<double>(joints)),
        counts_(kBlocks, 0),
        mean_(joints, 0.0), scatter_(joints * joints, 0.0), part_(joints * joints, 0.0),
        last_part_(joints * joints, 0.0) {}

  std::size_t joints() const { return n_; }

  // Takes the torques (n) [Nm] of a sample in which nothing touches; NaN is taken for no load.
  void take(const double* torque, double time) {
    if (touched_ || filled_ == 0) begin(time);
    if (time - since_ >= block_) next(time);
    std::vector<double>& block = blocks_[at_];
    const double count = ++counts_[at_];
    for (std::size_t j = 0; j < n_; ++j) {
      const double x = std::isfinite(torque[j]) ? torque[j] : 0.0;
      block[j] += (x - block[j]) / count;
    }
    if (!known_) return;
    for (std::size_t i = 0; i < n_; ++i) {
      for (std::size_t j = 0; j <= i; ++j)
        part_[i * n_ + j] += strayed(torque, i) * strayed(torque, j);
    }
  }

  // A touch begins: what has been seen last is not rest.
  void end() {
    if (touched_) return;
    touched_ = true;
    settle();
  }

  // Is there anything to compare a touch with?
  bool known() const { return known_; }
  double mean(std::size_t j) const { return mean_[j]; }
  // Covariance of torques i >= j about the mean [Nm2].
  double scatter(std::size_t i, std::size_t j) const {
    return samples_ > 0.0 ? scatter_[i * n_ + j] / samples_ : 0.0;
  }

 private:
  static constexpr int kBlocks = 10;  // room: the mean is that of half a second

  double strayed(const double* torque, std::size_t j) const {
    return std::isfinite(torque[j]) ? torque[j] - mean_[j] : 0.0;
  }

  // Rest begins, or begins again.
  void begin(double time) {
    touched_ = false;
    filled_ = 1;
    at_ = 0;
    fresh_ = true;
    open(time);
    last_count_ = 0;
  }

  void open(double time) {
    since_ = time;
    counts_[at_] = 0;
    std::fill(blocks_[at_].begin(), blocks_[at_].end(), 0.0);
    std::fill(part_.begin(), part_.end(), 0.0);
  }

  // A block is over. Up to the one before nothing has touched, since it has not been detected; the
  // first after a touch is still the end of it.
  void next(double time) {
    if (last_count_ > 0) {
      const double kept = std::min(samples_, memory_ / block_ * last_count_);
      for (std::size_t i = 0; i < n_ * n_; ++i) {
        if (samples_ > 0.0) scatter_[i] *= kept / samples_;
        scatter_[i] += last_part_[i];
      }
      samples_ = kept + last_count_;
    }
    last_count_ = known_ && !fresh_ ? counts_[at_] : 0;
    std::swap(part_, last_part_);
    fresh_ = false;
    settle();
    known_ = true;
    at_ = (at_ + 1) % kBlocks;
    filled_ = std::min(filled_ + 1, kBlocks);
    open(time);
  }

  // The mean of all blocks but the one at hand and the one before, or of what there is.
  void settle() {
    const int old = std::max(filled_ - 2, filled_ > 1 ? 1 : 0);
    if (old == 0 && known_) return;
    std::fill(mean_.begin(), mean_.end(), 0.0);
    double sum = 0.0;
    for (int k = 0; k < std::max(old, 1); ++k) {
      const int block = (at_ - filled_ + 1 + k + 2 * kBlocks) % kBlocks;
      sum += counts_[block];
      for (std::size_t j = 0; j < n_; ++j) mean_[j] += counts_[block] * blocks_[block][j];
    }
    for (std::size_t j = 0; j < n_; ++j) mean_[j] = sum > 0.0 ? mean_[j] / sum : 0.0;
    known_ = known_ || sum > 0.0;
  }

  double block_, memory_;  // [s]
  std::size_t n_;
  std::vector<std::vector<double>> blocks_;  // means of torques
  std::vector<int> counts_;
  std::vector<double> mean_, scatter_, part_, last_part_;
  double since_ = 0.0, samples_ = 0.0;
  int at_ = 0, filled_ = 0, last_count_ = 0;
  bool touched_ = false, known_ = false, fresh_ = true;
};

}  // namespace touchline
