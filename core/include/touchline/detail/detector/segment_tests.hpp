// SPDX-License-Identifier: Apache-2.0
// All rows of one segment together: tests against their covariance. Rows that are not known now
// are left out; when that changes, what looks back begins anew. `scaled` and `chi2` look at
// residuals that are low-passed once more: what velocity noise leaves in a residual is nearly
// white, so that a second pole takes off most of it. No allocation in `step`.
// Theory: docs/theory.md, section 4.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/innovation_test.hpp"
#include "touchline/detail/detector/row_covariance.hpp"
#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/detector/window_test.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/observer/filter.hpp"

namespace touchline {

class SegmentTests {
 public:
  // `tuning` stays the caller's. Rows that are not `loadable` are left out.
  SegmentTests(const Observer& observer, std::vector<DetectionRow> rows,
               std::vector<char> loadable, const DetectionSettings& settings,
               const DetectorTuning& tuning)
      : tuning_(tuning),
        rows_(std::move(rows)),
        loadable_(std::move(loadable)),
        covariance_(observer, rows_, settings.noise),
        windows_(rows_.size(), settings.windows, settings.noise.period),
        innovations_(rows_.size(), settings.noise.period, tuning) {
    const std::size_t n = rows_.size();
    for (const TestSetting& setting : settings.tests) {
      uses_chi2_ |= setting.test == Test::chi2;
      uses_glrt_ |= setting.test == Test::glrt;
      uses_cusum_ |= setting.test == Test::cusum;
      uses_scaled_ |= setting.test == Test::scaled;
    }
    for (const DetectionRow& row : rows_) add_gains(observer, row, settings.noise.period);
    for (auto* m : {&momentum_, &reading_, &factor_, &whitener_}) m->assign(n * n, 0.0);
    for (auto* v : {&slow_, &quick_, &load_, &offset_, &difference_}) v->assign(n, 0.0);
    for (auto* v : {&expected_, &doubt_}) v->assign(n, 0.0);
    for (auto* v : {&smooth_slow_, &smooth_quick_}) v->assign(n, 0.0);
    active_.reserve(n);
  }

  bool used() const { return uses_chi2_ || uses_glrt_ || uses_cusum_ || uses_scaled_; }

  // Of a row, low-passed once more: its residual less the slow offset and less the quick one, and
  // the variance of both by the noise.
  double slow(std::size_t row) const { return smooth_slow_[row]; }
  double quick(std::size_t row) const { return smooth_quick_[row]; }
  double noise_variance(std::size_t row) const { return filtered(row, row); }

  // Follows the posture and the robot's activity.
  void weigh(const Posture& posture, const Activity& activity) {
    covariance_.evaluate(posture);
    const std::size_t n = rows_.size();
    for (std::size_t i = 0; i < n; ++i)
      expected_[i] = filtered(i, i) + rows_[i].slow.variance(activity);
    compact(activity);
  }

  // `samples`: one per row; `dt`: since the sample before, with some lost between if it is a `gap`;
  // `adapt`: nothing is felt now.
  void step(const RowSample* samples, double dt, bool gap, bool adapt, const Activity& activity,
            double most) {
    if (dt > 0.0) smoothen(samples);
    if (take(samples)) {
      windows_.restart(active_.size());
      innovations_.restart(active_.size(), load_.data());
      compact(activity);
      return;
    }
    if (dt <= 0.0 || active_.empty()) return;
    if (follow_doubts(samples)) find_whitener();
    for (std::size_t k = 0; k < active_.size(); ++k) load_[k] = samples[active_[k]].innovation;
    if (uses_glrt_) windows_.add(load_.data(), dt, gap);
    if (uses_cusum_) innovations_.add(load_.data(), dt, gap, adapt, most);
  }

  double statistic(Test test) {
    if (active_.empty()) return 0.0;
    switch (test) {
      case Test::scaled: return scaled();
      case Test::chi2: return chi2();
      case Test::glrt: return referred_ ? windows_.statistic(offset_.data()) : 0.0;
      case Test::cusum: return innovations_.statistic();
      default: return 0.0;
    }
  }

 private:
  void add_gains(const Observer& observer, const DetectionRow& row, double dt) {
    const double K = row.component < 0
                         ? observer.joints()[row.joint].bandwidth
                         : observer.sensors()[observer.layout().segments[row.segment].sensor].bandwidth;
    const double a = pole(K, dt, Discretization::automatic), b = 1.0 - a, c = 1.0 + a;
    smoothing_.push_back(b);
    // Two equal poles, of white noise and of its differences: with g_k = (k + 1) a^k the sums of
    // g_k^2 and of (g_k - g_k-1)^2.
    reading_gain_.push_back(b * b * std::sqrt((1.0 + a * a) / (b * b * b * c * c * c)));
    momentum_gain_.push_back(b * b / dt * std::sqrt(2.0 / (b * c * c * c)));
  }

  void smoothen(const RowSample* samples) {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const RowSample& s = samples[i];
      if (!s.known) continue;
      smooth_slow_[i] += smoothing_[i] * (s.residual - s.offset - smooth_slow_[i]);
      smooth_quick_[i] += smoothing_[i] * (s.residual - s.reference - smooth_quick_[i]);
    }
  }

  // Returns whether a gap has left doubts, or they have just gone.
  bool follow_doubts(const RowSample* samples) {
    bool any = false;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      any |= doubt_[i] > 0.0 || samples[i].gap_std > 0.0;
      doubt_[i] = tuning_.gap_sigmas * samples[i].gap_std * tuning_.gap_sigmas * samples[i].gap_std;
    }
    return any;
  }

  double filtered(std::size_t i, std::size_t j) const {
    const std::size_t at = i * rows_.size() + j;
    return momentum_gain_[i] * momentum_gain_[j] * covariance_.momentum()[at] +
           reading_gain_[i] * reading_gain_[j] * covariance_.reading()[at];
  }

  // Takes the samples; returns whether other rows are known than before.
  bool take(const RowSample* samples) {
    bool changed = false;
    std::size_t count = 0;
    referred_ = true;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (!samples[i].known || loadable_[i] == 0) continue;
      changed |= count >= active_.size() || active_[count] != i;
      ++count;
    }
    changed |= count != active_.size();
    if (changed) active_.clear();
    for (std::size_t i = 0, k = 0; i < rows_.size(); ++i) {
      if (!samples[i].known || loadable_[i] == 0) continue;
      if (changed) active_.push_back(i);
      difference_[k] = smooth_slow_[i];
      offset_[k] = samples[i].reference;
      referred_ = referred_ && samples[i].referred >= tuning_.reference;
      if (changed) load_[k] = samples[i].residual;
      ++k;
    }
    return changed;
  }

  // The matrices of the rows in use, and their factors.
  void compact(const Activity& activity) {
    const std::size_t n = rows_.size(), size = active_.size();
    for (std::size_t i = 0; i < size; ++i) {
      const std::size_t a = active_[i];
      slow_[i] = rows_[a].slow.variance(activity);
      quick_[i] = rows_[a].quick.variance(activity);
      for (std::size_t j = 0; j < size; ++j) {
        const std::size_t at = a * n + active_[j];
        momentum_[i * size + j] = covariance_.momentum()[at];
        reading_[i * size + j] = covariance_.reading()[at];
      }
    }
    find_whitener();
    if (uses_glrt_) windows_.weigh(momentum_.data(), reading_.data(), quick_.data());
    if (uses_cusum_) innovations_.weigh(momentum_.data(), reading_.data(), quick_.data());
  }

  void find_whitener() {
    const std::size_t size = active_.size();
    for (std::size_t i = 0; i < size; ++i) {
      for (std::size_t j = 0; j < size; ++j) {
        const double own = i == j ? slow_[i] + doubt_[active_[i]] : 0.0;
        factor_[i * size + j] = filtered(active_[i], active_[j]) + own;
      }
    }
    chi2_usable_ = uses_chi2_ && cholesky(factor_.data(), static_cast<int>(size), 1e-15);
    if (chi2_usable_) invert_lower(factor_.data(), static_cast<int>(size), whitener_.data());
  }

  double scaled() const {
    double most = 0.0;
    for (std::size_t k = 0; k < active_.size(); ++k)
      most = std::max(most, difference_[k] * difference_[k] /
                                (expected_[active_[k]] + doubt_[active_[k]]));
    return std::sqrt(most);
  }

  double chi2() const {
    if (!chi2_usable_) return 0.0;
    return std::sqrt(
        squared_norm(whitener_.data(), difference_.data(), static_cast<int>(active_.size())));
  }

  const DetectorTuning& tuning_;
  std::vector<DetectionRow> rows_;
  std::vector<char> loadable_;  // per row
  RowCovariance covariance_;
  WindowTest windows_;
  InnovationTest innovations_;
  bool uses_scaled_ = false, uses_chi2_ = false, uses_glrt_ = false, uses_cusum_ = false;
  bool chi2_usable_ = false;
  bool referred_ = false;  // have all rows in use been averaged over long enough?
  std::vector<double> reading_gain_, momentum_gain_, smoothing_;
  std::vector<double> smooth_slow_, smooth_quick_;  // by row
  std::vector<std::size_t> active_;  // rows that are known
  std::vector<double> expected_;     // variance of each row
  std::vector<double> doubt_;        // what a gap adds to it
  std::vector<double> momentum_, reading_, factor_, whitener_, slow_, quick_;
  std::vector<double> load_, offset_, difference_;
};

}  // namespace touchline
