// SPDX-License-Identifier: Apache-2.0
// CUSUM on the innovations of a Kalman filter. Its state is the momentum that the known loads do
// not explain, P' = P + w dt + (noise of the readings), and the load w. That is a random walk that takes
// up the model's errors. Measured is P with the noise of the velocities. In coordinates in which both
// noises are diagonal every row is a filter of its own, with gains in closed form: those of the
// second-order moving average that its second differences are. The innovations are white with unit
// variance; a two-sided CUSUM watches each. No allocation in `weigh`, `add` and `statistic`.
// Theory: docs/theory.md, section 4.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <complex>
#include <limits>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/model/dense.hpp"

namespace touchline {

// Gains of the steady filter of P and w dt, and the standard deviation of its innovations, for
// variances r of the measurement and q of the increments of w dt. Those of P have variance 1.
struct SteadyGains {
  double level, slope, sigma;
};

inline SteadyGains steady_gains(double r, double q) {
  // gamma0 = q + 2 + 6 r, gamma1 = -1 - 4 r, gamma2 = r. With x = z + 1/z the spectrum is
  // r x^2 + gamma1 x + gamma0 - 2 r, and of each root's z and 1/z the one inside counts.
  const std::complex<double> root = std::sqrt(std::complex<double>(1.0 - 4.0 * r * q));
  const std::complex<double> x[2] = {2.0 + (1.0 + root) / (2.0 * r), 2.0 + 2.0 * q / (1.0 + root)};
  std::complex<double> z[2];
  for (int i = 0; i < 2; ++i) {
    const std::complex<double> s = std::sqrt(x[i] * x[i] - 4.0);
    const std::complex<double> outer = 0.5 * (x[i] + s), other = 0.5 * (x[i] - s);
    z[i] = 1.0 / (std::abs(outer) > std::abs(other) ? outer : other);
  }
  const double sum = (z[0] + z[1]).real(), product = (z[0] * z[1]).real();
  return {1.0 - product, 1.0 + product - sum, std::sqrt(r / product)};
}

class InnovationTest {
 public:
  // `tuning` stays the caller's.
  InnovationTest(std::size_t rows, double period, const DetectorTuning& tuning)
      : tuning_(tuning), period_(period) {
    for (auto* m : {&to_white_, &from_white_, &factor_, &turned_, &scratch_, &vectors_})
      m->assign(rows * rows, 0.0);
    for (auto* v : {&load_, &gap_, &white_, &up_, &down_}) v->assign(rows, 0.0);
    gains_.assign(rows, SteadyGains{0.0, 0.0, 1.0});
  }

  // Begins anew, with `size` rows in use, from the loads `w`.
  void restart(std::size_t size, const double* w) {
    size_ = size;
    for (auto* v : {&gap_, &up_, &down_}) std::fill(v->begin(), v->end(), 0.0);
    std::copy_n(w, size, load_.begin());
    count_ = 0.0;
    since_gap_ = kNoGap;
    age_ = 0.0;
    turned_before_ = false;
  }

  // Covariances (size, size) of one sample; `model` (size): variances of the model's errors over
  // the quick baseline.
  void weigh(const double* momentum, const double* reading, const double* model) {
    const int n = static_cast<int>(size_);
    for (std::size_t i = 0; i < size_ * size_; ++i) factor_[i] = period_ * period_ * reading[i];
    usable_ = cholesky(factor_.data(), n, 1e-15);
    if (!usable_) return;
    // turned = L^-1 A L^-T
    std::copy_n(momentum, size_ * size_, turned_.begin());
    for (int j = 0; j < n; ++j) solve_lower(factor_.data(), n, turned_.data() + j, n);
    for (int i = 0; i < n; ++i) solve_lower(factor_.data(), n, turned_.data() + i * n);
    // From the axes of before, which are nearly right: a row goes on as the same row.
    if (!turned_before_) set_identity();
    turn(n);
    diagonalize(turned_.data(), vectors_.data(), n);
    turned_before_ = true;
    // to_white = U^T L^-1 by rows; from_white = L U.
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) to_white_[i * n + k] = vectors_[k * n + i];
      solve_transposed(to_white_.data() + i * n, n);
      for (int k = 0; k < n; ++k) {
        double sum = 0.0;
        for (int c = 0; c <= i; ++c) sum += factor_[i * n + c] * vectors_[c * n + k];
        from_white_[i * n + k] = sum;
      }
    }
    for (int i = 0; i < n; ++i) {
      double drift = 0.0;
      for (int k = 0; k < n; ++k) drift += square(to_white_[i * n + k]) * model[k];
      // A random walk that scatters by `model` about its low-pass of time constant `reference`.
      const double q = drift * (2.0 / tuning_.reference) * period_ * period_ * period_;
      gains_[i] = steady_gains(std::max(turned_[i * n + i], 1e-6), std::max(q, 1e-12));
    }
  }

  // The mean loads e of an interval dt, with samples lost in it if it is a `gap`; `adapt`: may the
  // load be followed? `most`: sums stay below.
  void add(const double* e, double dt, bool gap, bool adapt, double most) {
    if (!usable_) return;
    const std::size_t n = size_;
    count_ += 1.0;
    age_ += dt;
    since_gap_ += 1.0;
    if (gap) {  // of P nothing is known but this measurement
      std::fill_n(gap_.begin(), n, 0.0);
      since_gap_ = 0.0;
      return;
    }
    // Then it is the mean of all since; the innovation has 1 + 1/k of its variance.
    const double mean = 1.0 / (since_gap_ + 1.0), wider = std::sqrt(1.0 + 1.0 / since_gap_);
    // At first the gains of a straight line through all samples so far, if they are larger.
    const double level_first = 2.0 * (2.0 * count_ - 1.0) / (count_ * (count_ + 1.0));
    const double slope_first = 6.0 / (count_ * (count_ + 1.0));
    for (std::size_t i = 0; i < n; ++i) gap_[i] += (e[i] - load_[i]) * dt;
    for (std::size_t i = 0; i < n; ++i) {
      double nu = 0.0;
      for (std::size_t k = 0; k < n; ++k) nu += to_white_[i * n + k] * gap_[k];
      white_[i] = nu;
      if (age_ < tuning_.cusum_warm_up) continue;
      const double z = nu / (gains_[i].sigma * (mean > gains_[i].level ? wider : 1.0));
      up_[i] = std::clamp(up_[i] + z - 0.5 * tuning_.cusum_shift, 0.0, most);
      down_[i] = std::clamp(down_[i] - z - 0.5 * tuning_.cusum_shift, 0.0, most);
    }
    for (std::size_t i = 0; i < n; ++i) {
      double level = 0.0, slope = 0.0;
      for (std::size_t k = 0; k < n; ++k) {
        const double part = from_white_[i * n + k] * white_[k];
        level += std::max({gains_[k].level, level_first, mean}) * part;
        slope += std::max(gains_[k].slope, slope_first) * part;
      }
      gap_[i] -= level;
      if (adapt) load_[i] += slope / dt;
    }
  }

  double statistic() const {
    double most = 0.0;
    for (std::size_t i = 0; usable_ && i < size_; ++i) most = std::max({most, up_[i], down_[i]});
    return most;
  }

 private:
  static double square(double x) { return x * x; }

  void set_identity() {
    for (std::size_t i = 0; i < size_ * size_; ++i) vectors_[i] = i % (size_ + 1) == 0 ? 1.0 : 0.0;
  }

  // turned = V^T turned V.
  void turn(int n) {
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k < n; ++k) {
        double sum = 0.0;
        for (int c = 0; c < n; ++c) sum += turned_[i * n + c] * vectors_[c * n + k];
        scratch_[i * n + k] = sum;
      }
    }
    for (int i = 0; i < n; ++i) {
      for (int k = 0; k <= i; ++k) {
        double sum = 0.0;
        for (int c = 0; c < n; ++c) sum += vectors_[c * n + i] * scratch_[c * n + k];
        turned_[i * n + k] = turned_[k * n + i] = sum;
      }
    }
  }

  // x = L^-T x.
  void solve_transposed(double* x, int n) const {
    for (int i = n - 1; i >= 0; --i) {
      double s = x[i];
      for (int k = i + 1; k < n; ++k) s -= factor_[k * n + i] * x[k];
      x[i] = s / factor_[i * n + i];
    }
  }

  std::size_t size_ = 0;
  static constexpr double kNoGap = std::numeric_limits<double>::infinity();  // samples since one

  const DetectorTuning& tuning_;
  double period_, count_ = 0.0, age_ = 0.0;  // samples and time since the beginning
  double since_gap_ = kNoGap;
  bool usable_ = false, turned_before_ = false;
  std::vector<double> to_white_, from_white_, factor_, turned_, scratch_, vectors_;
  std::vector<double> load_, gap_, white_, up_, down_;  // gap: measured less estimated momentum
  std::vector<SteadyGains> gains_;
};

}  // namespace touchline
