// SPDX-License-Identifier: Apache-2.0
// Several contacts whose places are known explain one measurement. Their forces, and small shifts
// of their places, follow from a linear Gaussian model:
//
//   rows = sum of H_c (p_c) (f_c + df_c) + G_c dp_c + noise,   (df, dp) ~ (0, P),
//
// P is the joint covariance of the estimate at hand. No allocation after construction.
// Theory: docs/theory.md, section 6.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/localizer/held_sample.hpp"
#include "touchline/detail/localizer/joint_estimate.hpp"
#include "touchline/detail/place/measurement.hpp"

namespace touchline {

// Unknowns that have changed since the estimate was made, with the variance that this adds.
struct Change {
  double added[JointEstimate::kSize] = {};

  static Change none() { return {}; }
  static Change of_force(int c, double sigma) {
    Change change;
    change.force(c, sigma);
    return change;
  }
  static Change of_forces(int count, double sigma) {
    Change change;
    for (int c = 0; c < count; ++c) change.force(c, sigma);
    return change;
  }
  static Change of_place(int c, double sigma) {
    Change change;
    for (int i = 3; i < JointEstimate::kEach; ++i)
      change.added[JointEstimate::kEach * c + i] = sigma * sigma;
    return change;
  }
  bool any() const {
    return std::any_of(added, added + JointEstimate::kSize, [](double v) { return v > 0.0; });
  }
  void force(int c, double sigma) {
    for (int i = 0; i < 3; ++i) added[JointEstimate::kEach * c + i] = sigma * sigma;
  }
};

class JointFit {
 public:
  static constexpr int kMost = JointEstimate::kMost, kEach = JointEstimate::kEach;

  JointFit(const Posture& posture, const LinkSurfaces& surfaces, const LocalizerSettings& settings,
           std::size_t rows)
      : posture_(posture), surfaces_(surfaces), settings_(settings), rows_(rows * (kSize + 1)),
          loose_(rows * kSize) {}

  // Where a contact was at the time that its force speaks of [world].
  Vec3 earlier(const KnownContact& k, const Measurement& measurement) const {
    const Vec3 p = surfaces_.to_world(k.point, k.node);
    const Spatial& v = posture_.twist(k.node);
    return p - measurement.lag(k.lag) * (v.linear + cross(v.angular, p));
  }

  // Widens the noise of the rows by what is not known of how the contacts moved in the meantime.
  void allow_for_motion(const JointEstimate& estimate, Measurement& measurement) const {
    double moment = 0.0;
    for (int c = 0; c < estimate.count; ++c) {
      const KnownContact& k = estimate.known[c];
      const Vec3 way = surfaces_.to_world(k.point, k.node) - earlier(k, measurement);
      moment += settings_.uncertain_way * norm(way) * norm(k.force);
    }
    if (moment > 1e-6) measurement.loosen_moments(moment);
  }

  // Weighs a measurement by that too.
  void weigh(const JointEstimate& estimate, Measurement& measurement) const {
    allow_for_motion(estimate, measurement);
    measurement.spread(nullptr, 0);
  }

  // Takes a measurement, to be explained by an estimate and what may have changed since.
  void begin(const Measurement& measurement, const JointEstimate& estimate) {
    fill(measurement, estimate);
    sum_up(measurement.size(), estimate.size());
  }

  // The same of a sample that has been kept.
  void begin(const HeldSample& sample, const JointEstimate& estimate) {
    const int n = estimate.size(), width = n + 1;
    double* d = rows_.data();
    for (int c = 0; c < estimate.count; ++c) sample.columns(estimate.known[c], d + kEach * c, width);
    sample.values(d + n, width);
    leave_unexplained(estimate, sample.size());
    sum_up(sample.size(), n);
  }

  // The same of one contact, whose body was at the mean place `then` when it felt the wrench that `q`
  // tells of.
  void begin_alone(const Quadratic& q, const JointEstimate& estimate, const Pose& then) {
    const KnownContact& k = estimate.known[0];
    n_ = kEach;
    const Vec3 p = then.R * k.point + then.p, axes[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
    Vec3 along[2];
    tangents(k.normal, along[0], along[1]);
    double w[6], rest[6], D[kEach][6];
    for (int i = 0; i < 3; ++i) wrench_of(p, axes[i], D[i]);
    for (int i = 0; i < 2; ++i) store({{}, cross(then.R * along[i], k.force)}, D[3 + i]);
    wrench_of(p, k.force, w);
    for (int r = 0; r < 6; ++r) {
      rest[r] = q.vector[r];
      for (int c = 0; c < 6; ++c) rest[r] -= q.information[6 * r + c] * w[c];
    }
    for (int i = 0; i < kEach; ++i) {
      b_[i] = 0.0;
      for (int r = 0; r < 6; ++r) b_[i] += D[i][r] * rest[r];
      for (int j = 0; j <= i; ++j) {
        double& sum = A_[kEach * i + j] = 0.0;
        for (int r = 0; r < 6; ++r) {
          for (int c = 0; c < 6; ++c) sum += D[i][r] * q.information[6 * r + c] * D[j][c];
        }
      }
    }
    square_ = q(w);
  }

  // The squared distance of the measurement from its prediction, a chi-squared variable of as many
  // degrees of freedom as there are rows.
  double cost(const JointEstimate& estimate, const Change& change) {
    if (!prior(estimate, change)) return std::numeric_limits<double>::infinity();
    know(1.0, factor_);
    double x[kSize];
    std::copy(b_, b_ + n_, x);
    if (!factor(factor_, n_)) return std::numeric_limits<double>::infinity();
    solve_cholesky(factor_, n_, x);
    double cost = square_;
    for (int i = 0; i < n_; ++i) cost -= b_[i] * x[i];
    return cost;
  }

  // The log of how well an estimate foresees the part `independence` of a sample. How large those
  // unknowns are that have changed does not count: nothing was foreseen of them.
  double log_evidence(const JointEstimate& estimate, const Change& change, double independence) {
    constexpr double kNever = -std::numeric_limits<double>::infinity();
    if (!(independence > 0.0)) return 0.0;
    if (!prior(estimate, change)) return kNever;
    double volume = log_volume(change);
    std::copy(prior_, prior_ + n_ * n_, factor_);
    if (!factor(factor_, n_)) return kNever;
    volume = log_determinant(factor_, n_) - volume;
    know(independence, factor_);
    double H[kSize * kSize];
    std::copy(factor_, factor_ + n_ * n_, H);
    if (!factor(factor_, n_)) return kNever;
    volume -= log_determinant(factor_, n_);
    volume += log_volume(change, H);
    double x[kSize];
    for (int i = 0; i < n_; ++i) x[i] = independence * b_[i];
    solve_cholesky(factor_, n_, x);
    double cost = independence * square_;
    for (int i = 0; i < n_; ++i) cost -= independence * b_[i] * x[i];
    return 0.5 * (volume - cost);
  }

  // Takes over what a sample tells. What has changed is as this sample says; of the rest it tells
  // something new in part only, `independence`: its noise is filtered.
  void accept(JointEstimate& estimate, const Change& change, double independence) {
    const int n = n_;
    if (!prior(estimate, change)) return;
    double* P = factor_;
    know(independence, P);
    if (!invert_all(P, n)) return;
    double x[kSize];
    for (int i = 0; i < n; ++i) {
      x[i] = 0.0;
      for (int j = 0; j < n; ++j) x[i] += P[i * n + j] * independence * b_[j];
    }
    if (independence < 1.0) renew(change, P, x);
    if (independence > 0.0 && independence < 1.0) tell_corrections(estimate, P, x);
    std::copy(P, P + n * n, estimate.covariance);
    for (int c = 0; c < estimate.count; ++c) {
      const double* own = x + kEach * c;
      estimate.known[c].force = estimate.known[c].force + Vec3{own[0], own[1], own[2]};
      shift(estimate, c, own[3], own[4]);
    }
    estimate.spread(settings_);
  }

  // How much is known of an estimate that follows from this sample.
  void judge(JointEstimate& estimate) {
    if (!prior(estimate, Change::none())) return;
    know(1.0, factor_);
    if (!invert_all(factor_, n_)) return;
    std::copy(factor_, factor_ + n_ * n_, estimate.covariance);
    estimate.spread(settings_);
  }

  // Takes the contacts of an estimate out of a measurement, with their uncertainty; false if
  // nothing can be weighed.
  bool take_out(const JointEstimate& estimate, const Change& change, Measurement& measurement) {
    const int n = estimate.size(), rows = measurement.size();
    allow_for_motion(estimate, measurement);
    for (int c = 0; c < estimate.count; ++c)
      columns(measurement, estimate.known[c], rows_.data() + kEach * c, n);
    for (int c = 0; c < estimate.count; ++c) {
      const KnownContact& k = estimate.known[c];
      measurement.take_out(k.node, wrench(k, measurement), k.lag);
    }
    std::copy(estimate.covariance, estimate.covariance + n * n, factor_);
    for (int i = 0; i < n; ++i) factor_[i * (n + 1)] += change.added[i];
    if (!factor(factor_, n)) return false;
    for (int k = 0; k < n; ++k) {
      double* column = loose_.data() + k * rows;
      for (int r = 0; r < rows; ++r) {
        column[r] = 0.0;
        for (int i = k; i < n; ++i) column[r] += rows_[r * n + i] * factor_[i * n + k];
      }
    }
    return measurement.spread(loose_.data(), n);
  }

 private:
  static constexpr int kSize = JointEstimate::kSize;
  static constexpr double kUnmoved = 1e-7;  // [m] less is rounding

  Spatial wrench(const KnownContact& k, const Measurement& m) const {
    const Vec3 p = earlier(k, m);
    return {k.force, cross(p, k.force)};
  }

  // What force and shift of a contact do to the rows, in columns of a matrix of that width.
  void columns(const Measurement& m, const KnownContact& k, double* out, int width) const {
    const Vec3 p = earlier(k, m);
    const Vec3 unit[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (int i = 0; i < 3; ++i) m.load(k.node, {unit[i], cross(p, unit[i])}, k.lag, out + i, width);
    Vec3 s[2];
    tangents(k.normal, s[0], s[1]);
    for (int i = 0; i < 2; ++i) {
      const Vec3 along = surfaces_.turn_to_world(s[i], k.node);
      m.load(k.node, {{}, cross(along, k.force)}, k.lag, out + 3 + i, width);
    }
  }

  // The whitened model, and in the last column what the last values leave unexplained.
  void fill(const Measurement& m, const JointEstimate& estimate) {
    const int n = estimate.size(), width = n + 1;
    double* d = rows_.data();
    for (int c = 0; c < estimate.count; ++c) columns(m, estimate.known[c], d + kEach * c, width);
    m.values(d + n, width);
    leave_unexplained(estimate, m.size());
    for (int i = 0; i < width; ++i) m.whiten(d + i, width);
  }

  // Takes what the forces explain out of the values, in the last column of so many rows.
  void leave_unexplained(const JointEstimate& estimate, int rows) {
    const int n = estimate.size();
    for (int r = 0; r < rows; ++r) {
      double* row = rows_.data() + r * (n + 1);
      for (int c = 0; c < estimate.count; ++c) {
        const Vec3& f = estimate.known[c].force;
        row[n] -= row[kEach * c] * f.x + row[kEach * c + 1] * f.y + row[kEach * c + 2] * f.z;
      }
    }
  }

  // The normal equations of so many rows for `n` unknowns.
  void sum_up(int rows, int n) {
    n_ = n;
    std::fill(A_, A_ + n * n, 0.0);
    std::fill(b_, b_ + n, 0.0);
    square_ = 0.0;
    for (int r = 0; r < rows; ++r) {
      const double* d = rows_.data() + r * (n + 1);
      for (int i = 0; i < n; ++i) {
        b_[i] += d[i] * d[n];
        for (int j = 0; j <= i; ++j) A_[i * n + j] += d[i] * d[j];
      }
      square_ += d[n] * d[n];
    }
  }

  // What a sample with the covariance P after it has corrected the forces by.
  static void tell_corrections(JointEstimate& estimate, const double* P, const double* x) {
    const int n = estimate.size();
    for (int c = 0; c < estimate.count; ++c) {
      double expected = 0.0;
      for (int i = kEach * c; i < kEach * c + 3; ++i)
        expected += std::max(0.0, estimate.covariance[i * (n + 1)] - P[i * (n + 1)]);
      const double* by = x + kEach * c;
      estimate.known[c].unrest.correct({by[0], by[1], by[2]}, expected);
    }
  }

  // What was known before the sample, as information, in `prior_`.
  bool prior(const JointEstimate& estimate, const Change& change) {
    std::copy(estimate.covariance, estimate.covariance + n_ * n_, prior_);
    for (int i = 0; i < n_; ++i) prior_[i * (n_ + 1)] += change.added[i];
    return invert_all(prior_, n_);
  }

  // Log of the determinant of the information on what has changed, the rest being known.
  double log_volume(const Change& change, const double* information = nullptr) const {
    const double* H = information != nullptr ? information : prior_;
    int changed[kSize], m = 0;
    for (int i = 0; i < n_; ++i) {
      if (change.added[i] > 0.0) changed[m++] = i;
    }
    double part[kSize * kSize];
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j <= i; ++j) part[i * m + j] = H[changed[i] * n_ + changed[j]];
    }
    return m > 0 && cholesky(part, m, 1e-15) ? log_determinant(part, m) : 0.0;
  }

  // And with a part of the sample: the lower triangle.
  void know(double part, double* H) const {
    for (int i = 0; i < n_; ++i) {
      for (int j = 0; j <= i; ++j) H[i * n_ + j] = prior_[i * n_ + j] + part * A_[i * n_ + j];
    }
  }

  // What has changed follows from the rest, as P and x have it now, by the whole sample.
  void renew(const Change& change, double* P, double* x) {
    int changed[kSize], rest[kSize], m = 0, others = 0;
    for (int i = 0; i < n_; ++i) (change.added[i] > 0.0 ? changed[m++] : rest[others++]) = i;
    if (m == 0) return;
    const auto whole = [&](int i, int j) {
      return prior_[i * n_ + j] + A_[std::max(i, j) * n_ + std::min(i, j)];
    };
    double H[kSize * kSize], B[kSize * kSize];  // of the changed ones; regression on the rest
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < m; ++j) H[i * m + j] = whole(changed[i], changed[j]);
    }
    if (!invert(H, m, work_)) return;
    for (int i = 0; i < m; ++i) {
      double sum = 0.0;
      for (int k = 0; k < m; ++k) sum += H[i * m + k] * b_[changed[k]];
      for (int j = 0; j < others; ++j) {
        double& to = B[i * others + j] = 0.0;
        for (int k = 0; k < m; ++k) to -= H[i * m + k] * whole(changed[k], rest[j]);
        sum += to * x[rest[j]];
      }
      x[changed[i]] = sum;
    }
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j < others; ++j) {
        double sum = 0.0;
        for (int k = 0; k < others; ++k) sum += B[i * others + k] * P[rest[k] * n_ + rest[j]];
        P[changed[i] * n_ + rest[j]] = P[rest[j] * n_ + changed[i]] = sum;
      }
    }
    for (int i = 0; i < m; ++i) {
      for (int j = 0; j <= i; ++j) {
        double sum = H[i * m + j];
        for (int k = 0; k < others; ++k) sum += B[j * others + k] * P[changed[i] * n_ + rest[k]];
        P[changed[i] * n_ + changed[j]] = P[changed[j] * n_ + changed[i]] = sum;
      }
    }
  }

  // Moves a place along its surface [m].
  void shift(JointEstimate& estimate, int c, double along, double across) const {
    if (std::fabs(along) + std::fabs(across) < kUnmoved) return;
    const KnownContact& k = estimate.known[c];
    Vec3 s, t;
    tangents(k.normal, s, t);
    const SurfacePoint p =
        surfaces_[k.surface].mesh.nearest_to_point(k.point + along * s + across * t,
            settings_.surface_reach);
    if (p.face >= 0) estimate.follow(c, p);
  }

  // Of all unknowns of so many contacts: their sizes are known.
  bool invert_all(double* a, int n) {
    switch (n) {
      case kEach: return invert_by_rows<kEach>(a);
      case 2 * kEach: return invert_by_rows<2 * kEach>(a);
      case 3 * kEach: return invert_by_rows<3 * kEach>(a);
      case 4 * kEach: return invert_by_rows<4 * kEach>(a);
      default: return invert(a, n, work_);
    }
  }
  static bool factor(double* a, int n) {
    switch (n) {
      case kEach: return cholesky_by_rows<kEach>(a, 1e-15);
      case 2 * kEach: return cholesky_by_rows<2 * kEach>(a, 1e-15);
      case 3 * kEach: return cholesky_by_rows<3 * kEach>(a, 1e-15);
      case 4 * kEach: return cholesky_by_rows<4 * kEach>(a, 1e-15);
      default: return cholesky(a, n, 1e-15);
    }
  }

  const Posture& posture_;
  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  int n_ = 0;
  std::vector<double> rows_, loose_;
  double A_[kSize * kSize], b_[kSize], square_ = 0.0;  // of the sample
  double prior_[kSize * kSize], factor_[kSize * kSize], work_[kSize * kSize];
};

}  // namespace touchline
