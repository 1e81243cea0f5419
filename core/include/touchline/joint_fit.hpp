// SPDX-License-Identifier: Apache-2.0
// Several contacts whose places are known explain one measurement: their forces, and small shifts
// of their places, from a linear Gaussian model,
//   rows = sum of H_c (p_c) (f_c + df_c) + G_c dp_c + noise,   df_c ~ (0, s_c^2),  dp ~ (0, P),
// P being joint: where the wrench alone tells two places, what one gains the other loses.
// No allocation after construction.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/known_contact.hpp"
#include "touchline/measurement.hpp"

namespace touchline {

class JointFit {
 public:
  static constexpr int kMost = 4, kEach = 5;  // contacts; unknowns of each

  JointFit(const Posture& posture, const LinkSurfaces& surfaces, std::size_t rows)
      : posture_(posture),
        surfaces_(surfaces),
        rows_(rows * (kEach * kMost + 1)),
        loose_(rows * (kEach * kMost + 1)) {}

  // Where a contact was at the time that its force speaks of [world].
  Vec3 earlier(const KnownContact& k) const {
    const Vec3 p = surfaces_.to_world(k.point, k.node);
    const Spatial& v = posture_.twist(k.node);
    return p - k.lag * (v.linear + cross(v.angular, p));
  }

  // Widens the noise of the rows by what is not known of how the contacts moved in the meantime.
  void allow_for_motion(const KnownContact* known, int count, Measurement& measurement) const {
    double moment = 0.0;
    for (int c = 0; c < count; ++c) {
      const Vec3 way = surfaces_.to_world(known[c].point, known[c].node) - earlier(known[c]);
      moment += kUncertainWay * norm(way) * norm(known[c].force);
    }
    if (moment > 1e-6) measurement.loosen_moments(moment);
  }

  // The best explanation of `measurement` with standard deviations `sigma` of the forces [N] about
  // their last values; returns the squared distance of the measurement from its prediction, a
  // chi-squared variable of as many degrees of freedom as there are rows.
  double fit(const Measurement& measurement, const KnownContact* known, int count,
             const double* sigma) {
    count_ = count;
    const int n = kEach * count;
    fill(measurement, known, count);
    double* b = rhs_;
    for (int i = 0; i < n; ++i) b[i] = 0.0;
    std::fill(factor_, factor_ + n * n, 0.0);
    double cost = 0.0;
    for (int r = 0; r < measurement.size(); ++r) {
      const double* d = rows_.data() + r * (n + 1);
      for (int i = 0; i < n; ++i) {
        b[i] += d[i] * d[n];
        for (int j = 0; j <= i; ++j) factor_[i * n + j] += d[i] * d[j];
      }
      cost += d[n] * d[n];
    }
    return solve(known, sigma, cost);
  }

  // The same of one contact, whose body was at the mean place `then` when it felt the wrench that
  // `q` tells of.
  double fit_alone(const Quadratic& q, const KnownContact& k, const Pose& then, double sigma) {
    count_ = 1;
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
      rhs_[i] = 0.0;
      for (int r = 0; r < 6; ++r) rhs_[i] += D[i][r] * rest[r];
      for (int j = 0; j <= i; ++j) {
        double sum = 0.0;
        for (int r = 0; r < 6; ++r) {
          for (int c = 0; c < 6; ++c) sum += D[i][r] * q.information[6 * r + c] * D[j][c];
        }
        factor_[kEach * i + j] = sum;
      }
    }
    return solve(&k, &sigma, q(w));
  }

  // Takes the forces of the last fit over.
  void apply_forces(KnownContact* known) const {
    for (int c = 0; c < count_; ++c) {
      const double* x = solution_ + kEach * c;
      known[c].force = known[c].force + Vec3{x[0], x[1], x[2]};
    }
  }

  // And of the places what the part `independence` of a sample of filtered rows tells, with forces
  // known to `sigma` [N] at that; `drift`: how far places may have moved, as a variance [m2].
  // Forces follow the noise of the rows: what was found of them is no second source for the places.
  void apply_places(KnownContact* known, double independence, const double* sigma,
                    double drift) const {
    const int n = kEach * count_;
    double factor[kEach * kMost * kEach * kMost], x[kEach * kMost];
    for (int i = 0; i < n * n; ++i) factor[i] = independence * information_[i];
    for (int i = 0; i < n; ++i) x[i] = independence * rhs_[i];
    add_prior(factor, sigma);
    if (!cholesky(factor, n)) return;
    solve_cholesky(factor, n, x);
    for (int c = 0; c < count_; ++c) {
      share(factor, known, c, drift);
      shift(known[c], x[kEach * c + 3], x[kEach * c + 4]);
    }
  }

  // Standard deviation of the force of a contact after the last fit [N], in its worst direction at
  // most.
  double force_sigma(int c) const {
    double sum = 0.0, column[kEach * kMost];
    for (int i = 0; i < 3; ++i) {
      covariances(factor_, kEach * c + i, column);
      sum += column[kEach * c + i];
    }
    return std::sqrt(sum);
  }

  // How uncertain contacts are, as vectors whose outer products add up to the covariance of the
  // unknowns; valid for the contacts of the fit that it was taken from.
  struct Uncertainty {
    int size = 0;
    double root[kEach * kMost * kEach * kMost];  // columns of the inverse, transposed factor
    // Standard deviation of a contact's force along an axis, on average [N].
    double force_sigma(int c) const {
      double sum = 0.0;
      for (int k = 0; k < size; ++k) {
        for (int i = kEach * c; i < kEach * c + 3; ++i) sum += root[k * size + i] * root[k * size + i];
      }
      return std::sqrt(sum / 3.0);
    }
  };
  void uncertainty(Uncertainty& out) const {
    const int n = out.size = kEach * count_;
    for (int k = 0; k < n; ++k) {
      double* x = out.root + k * n;  // L^-T e_k
      for (int i = 0; i < n; ++i) x[i] = i == k ? 1.0 : 0.0;
      for (int i = n - 1; i >= 0; --i) {
        double s = x[i];
        for (int j = i + 1; j < n; ++j) s -= factor_[j * n + i] * x[j];
        x[i] = s / factor_[i * n + i];
      }
    }
  }

  // Forces known to `sigma`, places as they are, all independent.
  static void independent(const KnownContact* known, int count, double sigma,
                    Uncertainty& out) {
    const int n = out.size = kEach * count;
    std::fill(out.root, out.root + n * n, 0.0);
    for (int c = 0; c < count; ++c) {
      double* to = out.root + kEach * c * (n + 1);
      for (int i = 0; i < 3; ++i) to[i * (n + 1)] = sigma;
      const Spread& p = known[c].place;
      const double a = std::sqrt(p.a), b = p.b / a;
      to[3 * (n + 1)] = a;
      to[3 * n + 4] = b;
      to[4 * (n + 1)] = std::sqrt(std::max(0.0, p.c - b * b));
    }
  }

  // Takes contacts out of a measurement, with their uncertainty; false if nothing can be weighed.
  bool take_out(const KnownContact* known, int count, const Uncertainty& uncertainty,
                Measurement& measurement) {
    const int n = kEach * count, rows = measurement.size();
    allow_for_motion(known, count, measurement);
    for (int c = 0; c < count; ++c) columns(measurement, known[c], rows_.data() + kEach * c, n);
    for (int c = 0; c < count; ++c)
      measurement.take_out(known[c].node, wrench(known[c]), known[c].lag);
    for (int k = 0; k < n; ++k) {
      double* column = loose_.data() + k * rows;
      for (int r = 0; r < rows; ++r) {
        column[r] = 0.0;
        for (int i = 0; i < n; ++i)
          column[r] += rows_[r * n + i] * uncertainty.root[k * n + i];
      }
    }
    return measurement.spread(loose_.data(), n);
  }

 private:
  // Of the unknowns, from their information in `factor_` and `rhs_`; `cost`: that of the last values.
  double solve(const KnownContact* known, const double* sigma, double cost) {
    const int n = kEach * count_;
    std::copy(factor_, factor_ + n * n, information_);
    std::copy(rhs_, rhs_ + n, solution_);
    places_before(known, count_);
    add_prior(factor_, sigma);
    if (!cholesky(factor_, n)) return std::numeric_limits<double>::infinity();
    solve_cholesky(factor_, n, solution_);
    for (int i = 0; i < n; ++i) cost -= rhs_[i] * solution_[i];
    return cost;
  }

  static constexpr double kUncertainWay = 0.1;  // of the way that a contact has come
  static constexpr double kSharpest = 1e-8;     // variance of a place [m2]

  Spatial wrench(const KnownContact& k) const {
    const Vec3 p = earlier(k);
    return {k.force, cross(p, k.force)};
  }

  // What force and shift of a contact do to the rows, in columns of a matrix of that width.
  void columns(const Measurement& m, const KnownContact& k, double* out, int width) const {
    const Vec3 p = earlier(k);
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
  void fill(const Measurement& m, const KnownContact* known, int count) {
    const int n = kEach * count, width = n + 1;
    double* d = rows_.data();
    for (int c = 0; c < count; ++c) columns(m, known[c], d + kEach * c, width);
    m.values(d + n, width);
    for (int r = 0; r < m.size(); ++r) {
      double* row = d + r * width;
      for (int c = 0; c < count; ++c) {
        const Vec3& f = known[c].force;
        row[n] -= row[kEach * c] * f.x + row[kEach * c + 1] * f.y + row[kEach * c + 2] * f.z;
      }
    }
    for (int i = 0; i < width; ++i) m.whiten(d + i, width);
  }

  // The inverse of the joint covariance of the places, in `prior_`.
  void places_before(const KnownContact* known, int count) {
    const int n = 2 * count;
    double P[4 * kMost * kMost];
    for (bool jointly : {true, false}) {
      for (int a = 0; a < count; ++a) {
        for (int b = 0; b <= a; ++b) block(known[a], known[b], jointly, P + 2 * a * n + 2 * b, n);
      }
      if (cholesky(P, n)) break;
    }
    for (int i = 0; i < n; ++i) {
      double* column = prior_ + i * n;
      for (int k = 0; k < n; ++k) column[k] = i == k ? 1.0 : 0.0;
      solve_cholesky(P, n, column);
    }
  }

  static void block(const KnownContact& a, const KnownContact& b, bool jointly, double* out,
                    int width) {
    const Spread& p = a.place;
    double with[2][2] = {{p.a, p.b}, {p.b, p.c}};
    if (&a != &b) {
      const KnownContact::Shared* s = jointly ? shared(a, b) : nullptr;
      for (int i = 0; i < 4; ++i) with[i / 2][i % 2] = s == nullptr ? 0.0 : s->with[i / 2][i % 2];
    }
    for (int i = 0; i < 4; ++i) out[i / 2 * width + i % 2] = with[i / 2][i % 2];
  }

  // To the lower half of an information matrix.
  void add_prior(double* H, const double* sigma) const {
    const int n = kEach * count_, m = 2 * count_;
    for (int a = 0; a < count_; ++a) {
      for (int i = 0; i < 3; ++i) H[(kEach * a + i) * (n + 1)] += 1.0 / (sigma[a] * sigma[a]);
      for (int b = 0; b <= a; ++b) {
        for (int i = 0; i < 4; ++i)
          H[(kEach * a + 3 + i / 2) * n + kEach * b + 3 + i % 2] +=
              prior_[(2 * a + i / 2) * m + 2 * b + i % 2];
      }
    }
  }

  // A column of the covariance after a fit.
  void covariances(const double* factor, int i, double* column) const {
    const int n = kEach * count_;
    std::fill(column, column + n, 0.0);
    column[i] = 1.0;
    solve_cholesky(factor, n, column);
  }

  // Notes how uncertain contact c is after a fit, and what it shares with the others.
  void share(const double* factor, KnownContact* known, int c, double drift) const {
    double column[2][kEach * kMost];
    for (int i = 0; i < 2; ++i) covariances(factor, kEach * c + 3 + i, column[i]);
    KnownContact& k = known[c];
    const int own = kEach * c + 3;
    k.place = {std::max(column[0][own] + drift, kSharpest), column[0][own + 1],
               std::max(column[1][own + 1] + drift, kSharpest)};
    KnownContact::Shared* to = k.shared;
    for (KnownContact::Shared& s : k.shared) s.serial = -1;
    for (int b = 0; b < count_; ++b) {
      if (b == c) continue;
      to->serial = known[b].serial;
      for (int i = 0; i < 4; ++i) to->with[i / 2][i % 2] = column[i / 2][kEach * b + 3 + i % 2];
      ++to;
    }
  }

  // Moves a place along its surface [m].
  void shift(KnownContact& k, double along, double across) const {
    if (std::fabs(along) + std::fabs(across) < 1e-7) return;
    Vec3 s, t;
    tangents(k.normal, s, t);
    const SurfacePoint p =
        surfaces_[k.surface].mesh.nearest_to_point(k.point + along * s + across * t, 0.06);
    if (p.face < 0) return;
    k.point = p.point;
    k.normal = p.normal;
  }

  const Posture& posture_;
  const LinkSurfaces& surfaces_;
  int count_ = 0;
  std::vector<double> rows_, loose_;
  double information_[kEach * kMost * kEach * kMost], rhs_[kEach * kMost];
  double prior_[4 * kMost * kMost];
  double factor_[kEach * kMost * kEach * kMost], solution_[kEach * kMost];
};

}  // namespace touchline
