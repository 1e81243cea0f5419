// SPDX-License-Identifier: Apache-2.0
// One contact explained: a point of a link's surface and a force in its friction cone, judged by
// what the measurements say of the wrench that the two make.
// Theory: docs/theory.md, section 5.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/mesh.hpp"
#include "touchline/detail/place/quadratic.hpp"
#include "touchline/detail/place/settings.hpp"

namespace touchline {

struct Fit {
  Vec3 force;
  double chi2 = 0.0;    // of the measurements
  double cone = 0.0;    // cost of a force beyond the friction cone, and of its size
  double cosine = 0.0;  // between the push and the inward normal
  double cost() const { return chi2 + cone; }
};

inline double component(const Vec3& v, int i) { return i == 0 ? v.x : i == 1 ? v.y : v.z; }

inline void wrench_of(const Vec3& point, const Vec3& force, double* w) {
  store(Spatial{force, cross(point, force)}, w);
}

// Two directions along a surface.
inline void tangents(const Vec3& n, Vec3& s, Vec3& t) {
  const Vec3 helper = std::fabs(n.x) < 0.6 ? Vec3{1.0, 0.0, 0.0} : Vec3{0.0, 1.0, 0.0};
  s = cross(n, helper);
  s = (1.0 / norm(s)) * s;
  t = cross(n, s);
}

class ForceFitter {
 public:
  explicit ForceFitter(const PlaceSettings& settings)
      : settings_(settings),
        cone_(std::atan(settings.friction)),
        directions_(1.0 - std::cos(cone_)),
        surely_in_cone_(std::cos(cone_) + kCosineRounding),
        surely_straight_(std::cos(settings.slant) + kCosineRounding),
        surely_plain_(std::max(surely_in_cone_, surely_straight_)),
        turns_(turns()) {}

  // The force at `point` that explains best, in the friction cone of the outward `normal`, or, if
  // it may be `grasped`, in any direction. Beyond a chi2 of `limit` nothing is worked out, nor where
  // no force at all can cost less than `worth`.
  Fit fit(const Quadratic& q, const Vec3& point, const Vec3& normal, bool grasped,
          double limit = std::numeric_limits<double>::infinity(),
          double worth = std::numeric_limits<double>::infinity()) const {
    double A[9], g[3];
    reduce(q, point, A, g);
    Fit free;
    free.cone = std::numeric_limits<double>::infinity();
    if (solve(A, g, free.force)) {
      judge(q, point, normal, grasped, free);
      // It has the least of chi2 and the cost of its size together, which the cone only adds to.
      if (free.chi2 + size_cost(norm(free.force)) >= worth) return free;
    }
    if (grasped || free.cone < 1.0 || free.chi2 > limit) return free;
    const Fit bound = on_cone(q, point, normal, A, g, worth);
    return bound.cost() < free.cost() ? bound : free;
  }

  // The misfit of the best force at `point`, in whatever direction.
  double free_chi2(const Quadratic& q, const Vec3& point) const {
    double A[9], g[3], w[6];
    reduce(q, point, A, g);
    Vec3 force;
    if (!solve(A, g, force)) return std::numeric_limits<double>::infinity();
    wrench_of(point, force, w);
    return q(w);
  }

  // Of several points side by side: what a force there costs at least, its size included, but for
  // rounding. NaN where forces are not known.
  Lanes least_cost(const Quadratic& q, const BasicVec3<Lanes>& p) const {
    Lanes a[6][3];  // the information that each row has on a force along x, y and z
    for (int r = 0; r < 6; ++r) {
      const double* row = q.information + 6 * r;
      a[r][0] = row[0] + p.z * row[4] - p.y * row[5];
      a[r][1] = row[1] - p.z * row[3] + p.x * row[5];
      a[r][2] = row[2] + p.y * row[3] - p.x * row[4];
    }
    const double* h = q.vector;
    const Lanes g[3] = {h[0] + p.z * h[4] - p.y * h[5], h[1] - p.z * h[3] + p.x * h[5],
                        h[2] + p.y * h[3] - p.x * h[4]};
    const double size = 1.0 / (settings_.force_scale * settings_.force_scale);
    const Lanes xx = a[0][0] + p.z * a[4][0] - p.y * a[5][0] + size,
                yx = a[1][0] - p.z * a[3][0] + p.x * a[5][0],
                yy = a[1][1] - p.z * a[3][1] + p.x * a[5][1] + size,
                zx = a[2][0] + p.y * a[3][0] - p.x * a[4][0],
                zy = a[2][1] + p.y * a[3][1] - p.x * a[4][1],
                zz = a[2][2] + p.y * a[3][2] - p.x * a[4][2] + size;
    // The elements of L D L^T, and of L^-1 g.
    const Lanes lyx = yx / xx, lzx = zx / xx, dy = yy - lyx * yx, uzy = zy - lzx * yx, lzy = uzy / dy,
                dz = zz - lzx * zx - lzy * uzy;
    const Lanes y = g[1] - lyx * g[0], z = g[2] - lzx * g[0] - lzy * y;
    const Lanes gain = g[0] * g[0] / xx + y * y / dy + z * z / dz;
    return q.constant - gain - kRounding * (1.0 + std::fabs(q.constant));
  }

  // What is measured of the force at `point`, and assumed of its size:
  // chi2(f) = constant - 2 g . f + f^T A f.
  void force_terms(const Quadratic& q, const Vec3& point, double* A, double* g) const {
    reduce(q, point, A, g);
  }

  // Fills chi2, cone and cosine of a force that is given.
  void judge(const Quadratic& q, const Vec3& point, const Vec3& normal, bool grasped,
             Fit& fit) const {
    double w[6];
    wrench_of(point, fit.force, w);
    fit.chi2 = q(w);
    const double size = norm(fit.force);
    fit.cosine = size > 0.0 ? -dot(normal, fit.force) / size : 0.0;
    fit.cone = grasped ? 0.0 : cone_cost(fit.cosine);
    fit.cone += size_cost(size);
  }

  // Logarithm of how dense forces are, per volume: their directions, in the friction cone or all
  // of them, and sizes are equally likely, but that people push near the normal.
  double log_prior(const Fit& fit, bool grasped) const {
    const double directions = grasped ? 2.0 : directions_;
    const double volume = directions * std::max(dot(fit.force, fit.force), 1.0);
    if (grasped || fit.cosine > surely_straight_) return -std::log(volume);  // the angle is dear
    const double angle = std::acos(std::clamp(fit.cosine, -1.0, 1.0));
    const double beyond = std::max(0.0, angle - settings_.slant), sigma = settings_.slant_sigma;
    return -std::log(volume) - 0.5 * beyond * beyond / (sigma * sigma);
  }

  // How dense they are, those beyond the friction cone as far as they may be in it. Of a force: the
  // square of its size, and the cosine between it and the inward normal.
  double density(double square, double cosine, bool grasped) const {
    const double volume = (grasped ? 2.0 : directions_) * std::max(square, 1.0);
    if (grasped || cosine > surely_plain_) return 1.0 / volume;
    if (cosine <= 0.0) return 0.0;
    const double angle = std::acos(std::min(1.0, cosine));
    const double slanted = std::max(0.0, angle - settings_.slant) / settings_.slant_sigma;
    const double beyond = std::max(0.0, angle - cone_) / settings_.cone_softness;
    return std::exp(-0.5 * (slanted * slanted + beyond * beyond)) / volume;
  }

  const PlaceSettings& settings() const { return settings_; }

  // Cosine between push and inward normal, below which a face is not worth looking at.
  double steepest() const { return std::cos(cone_ + 4.0 * settings_.cone_softness); }

  double cone_cost(double cosine) const {
    if (cosine <= 0.0) return std::numeric_limits<double>::infinity();
    if (cosine > surely_in_cone_) return 0.0;  // as nearly always: the angle is dear
    const double beyond = std::acos(std::min(1.0, cosine)) - cone_;
    if (beyond <= 0.0) return 0.0;
    return beyond * beyond / (settings_.cone_softness * settings_.cone_softness);
  }

  // What is known of a displacement of the point of a force, the force being free: chi2 grows by
  // d^T G d. False where forces are not known.
  bool place_metric(const Quadratic& q, const Vec3& point, const Vec3& force, double* G) const {
    double D[6][6], H[36];
    for (int c = 0; c < 3; ++c) {
      wrench_of(point, unit(c), D[c]);
      store(Spatial{{}, cross(unit(c), force)}, D[3 + c]);
    }
    for (int a = 0; a < 6; ++a) {
      double L[6];
      for (int r = 0; r < 6; ++r) {
        L[r] = 0.0;
        for (int i = 0; i < 6; ++i) L[r] += q.information[6 * r + i] * D[a][i];
      }
      for (int b = 0; b < 6; ++b) {
        H[6 * a + b] = 0.0;
        for (int r = 0; r < 6; ++r) H[6 * a + b] += D[b][r] * L[r];
      }
      if (a < 3) H[7 * a] += 1.0 / (settings_.force_scale * settings_.force_scale);
    }
    double F[9], x[3][3];
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        F[3 * i + j] = H[6 * i + j];
        x[i][j] = H[6 * i + 3 + j];
      }
    }
    if (!cholesky(F, 3)) return false;
    for (int j = 0; j < 3; ++j) solve_lower(F, 3, &x[0][j], 3);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        G[3 * i + j] = H[6 * (3 + i) + 3 + j];
        for (int r = 0; r < 3; ++r) G[3 * i + j] -= x[r][i] * x[r][j];
      }
    }
    return true;
  }

  // The information on force and on the two tangent coordinates of the point (5, 5), with what is
  // assumed where nothing is measured; `gradient` (5): of -chi2 / 2.
  void information(const Quadratic& q, const Vec3& point, const Vec3& normal, const Vec3& force,
                   double* H, double* gradient) const {
    information(q, point, normal, force, settings_.place_scale, H, gradient);
  }
  // The same, with one sigma of the place along its surface [m].
  void information(const Quadratic& q, const Vec3& point, const Vec3& normal, const Vec3& force,
                   double place_scale, double* H, double* gradient) const {
    double D[6][5], w[6], rest[6];
    Vec3 along[2];
    tangents(normal, along[0], along[1]);
    for (int c = 0; c < 5; ++c) {
      double column[6];
      if (c < 3) {
        wrench_of(point, unit(c), column);
      } else {
        store(Spatial{{}, cross(along[c - 3], force)}, column);
      }
      for (int r = 0; r < 6; ++r) D[r][c] = column[r];
    }
    wrench_of(point, force, w);
    double LD[6][5];
    for (int r = 0; r < 6; ++r) {
      rest[r] = q.vector[r];
      for (int k = 0; k < 6; ++k) rest[r] -= q.information[6 * r + k] * w[k];
      for (int c = 0; c < 5; ++c) {
        LD[r][c] = 0.0;
        for (int k = 0; k < 6; ++k) LD[r][c] += q.information[6 * r + k] * D[k][c];
      }
    }
    for (int a = 0; a < 5; ++a) {
      gradient[a] = 0.0;
      for (int r = 0; r < 6; ++r) gradient[a] += D[r][a] * rest[r];
      for (int b = 0; b <= a; ++b) {
        double sum = 0.0;
        for (int r = 0; r < 6; ++r) sum += D[r][a] * LD[r][b];
        H[5 * a + b] = H[5 * b + a] = sum;
      }
      const double scale = a < 3 ? settings_.force_scale : place_scale;
      H[6 * a] += 1.0 / (scale * scale);
    }
  }

  // Variance of the place of a contact, both directions along the surface together, by errors that
  // have the part `lasting` (6, 6) of the information; `P` (5, 5) is the inverse of `information`.
  static double place_variance(const double* lasting, const double* P, const Vec3& point,
                               const Vec3& normal, const Vec3& force) {
    Vec3 along[2];
    tangents(normal, along[0], along[1]);
    double sum = 0.0;
    for (int c = 3; c < 5; ++c) {
      const double* x = P + 5 * c;
      const Vec3 df{x[0], x[1], x[2]}, way = x[3] * along[0] + x[4] * along[1];
      double w[6];
      store(Spatial{df, cross(point, df) + cross(way, force)}, w);
      for (int a = 0; a < 6; ++a) {
        for (int b = 0; b < 6; ++b) sum += w[a] * lasting[6 * a + b] * w[b];
      }
    }
    return sum;
  }

 private:
  static constexpr double kCosineRounding = 1e-9;  // of a cosine, far above what it errs by
  static constexpr double kRounding = 1e-9;  // a part of chi2, far above what it errs by

  // Directions around the cone, and those that lie half a step, a quarter and an eighth to either
  // side of one: all that a force on its edge is looked for at.
  struct Turns {
    static constexpr int kFirst = 8, kHalvings = 3, kEach = 3;  // itself, before it, behind it
    static constexpr int kAll = kFirst * (1 + kEach + kEach * kEach + kEach * kEach * kEach);

    Turns() {
      double angle[kAll], step = 0.5 * kTurn / kFirst;
      for (int i = 0; i < kFirst; ++i) angle[i] = kTurn * i / kFirst;
      for (int begin = 0, end = kFirst, made = kFirst; end < kAll; begin = end, end = made, step *= 0.5) {
        for (int i = begin; i < end; ++i, made += kEach) {
          halved[i] = made;
          angle[made] = angle[i];
          angle[made + 1] = angle[i] - step;
          angle[made + 2] = angle[i] + step;
        }
      }
      for (int i = 0; i < kAll; ++i) cosine[i] = std::cos(angle[i]), sine[i] = std::sin(angle[i]);
    }

    double cosine[kAll + kLanes] = {}, sine[kAll + kLanes] = {};  // room: for the last side by side
    int halved[kAll];  // where the three of it stand at the next half step

    static constexpr double kTurn = 6.283185307179586;  // [rad]
  };
  static const Turns& turns() {
    static const Turns all;
    return all;
  }

  double size_cost(double size) const {
    return size * size / (settings_.force_scale * settings_.force_scale);
  }

  static Vec3 unit(int i) { return {i == 0 ? 1.0 : 0.0, i == 1 ? 1.0 : 0.0, i == 2 ? 1.0 : 0.0}; }

  // The moment (rows 3 to 5 of a wrench) that a unit force along axis c makes at `p`.
  struct Lever {
    int first, second;
    double less, more;
  };
  static Lever lever(const double* p, int c) {
    return c == 0 ? Lever{4, 5, p[2], -p[1]} : c == 1 ? Lever{3, 5, -p[2], p[0]}
                                                      : Lever{3, 4, p[1], -p[0]};
  }

  // chi2(f) = constant - 2 g . f + f^T A f for a force at `point`, plus the force's prior.
  void reduce(const Quadratic& q, const Vec3& point, double* A, double* g) const {
    // Of the six numbers that a unit force along axis c makes, three are not zero: the force itself,
    // and its moment about the two other axes.
    const double p[3] = {point.x, point.y, point.z};
    double LJ[3][6];
    for (int c = 0; c < 3; ++c) {
      const Lever l = lever(p, c);
      g[c] = q.vector[c] + l.less * q.vector[l.first] + l.more * q.vector[l.second];
      for (int r = 0; r < 6; ++r) {
        const double* row = q.information + 6 * r;
        LJ[c][r] = row[c] + l.less * row[l.first] + l.more * row[l.second];
      }
    }
    for (int a = 0; a < 3; ++a) {
      const Lever l = lever(p, a);
      for (int b = 0; b < 3; ++b)
        A[3 * a + b] = LJ[b][a] + l.less * LJ[b][l.first] + l.more * LJ[b][l.second];
      A[4 * a] += 1.0 / (settings_.force_scale * settings_.force_scale);
    }
  }

  static bool solve(const double* A, const double* g, Vec3& force) {
    double factor[9], f[3] = {g[0], g[1], g[2]};
    std::copy(A, A + 9, factor);
    if (!cholesky(factor, 3)) return false;
    solve_cholesky(factor, 3, f);
    force = {f[0], f[1], f[2]};
    return true;
  }

  // The best force on the edge of the cone: for each direction the size follows in closed form. It is
  // not worked out where its chi2 and the cost of its size are `worth` or more.
  Fit on_cone(const Quadratic& q, const Vec3& point, const Vec3& normal, const double* A,
              const double* g, double worth) const {
    Vec3 s, t;
    tangents(normal, s, t);
    const double part[3][3] = {{s.x, s.y, s.z}, {t.x, t.y, t.z}, {normal.x, normal.y, normal.z}};
    double best = 0.0, size = 0.0;
    int at = 0;
    // So many directions from one on, side by side; each as if alone.
    const auto offer = [&](int first, int count) {
      for (int i = first; i < first + count; i += kLanes) {
        const Lanes cosine = load_lanes(turns_.cosine + i), sine = load_lanes(turns_.sine + i);
        Lanes x[3], along{}, curve{};
        for (int k = 0; k < 3; ++k)
          x[k] = settings_.friction * (cosine * part[0][k] + sine * part[1][k]) - part[2][k];
        for (int k = 0; k < 3; ++k) {
          along += g[k] * x[k];
          for (int j = 0; j < 3; ++j) curve += x[k] * A[3 * k + j] * x[j];
        }
        const Lanes less = along * along / curve;
        for (int k = 0; k < std::min(kLanes, first + count - i); ++k) {
          if (lane(along, k) <= 0.0 || lane(less, k) <= best) continue;
          best = lane(less, k);
          at = i + k;
          size = lane(along, k) / lane(curve, k);
        }
      }
    };
    offer(0, Turns::kFirst);
    for (int halving = 0; halving < Turns::kHalvings; ++halving) {
      at = turns_.halved[at];
      offer(at + 1, Turns::kEach - 1);
    }
    Fit fit;
    if (best > 0.0)
      fit.force = size * (settings_.friction * (turns_.cosine[at] * s + turns_.sine[at] * t) - normal);
    fit.cone = std::numeric_limits<double>::infinity();
    const double least = q.constant - best;
    if (best > 0.0 && least - kRounding * (1.0 + std::fabs(q.constant)) < worth)
      judge(q, point, normal, false, fit);
    return fit;
  }

  const PlaceSettings& settings_;
  double cone_;            // half of its opening [rad]
  double directions_;      // in it, as a part of half of all
  double surely_in_cone_;  // a cosine: above it nothing is beyond the cone
  double surely_straight_;  // above it no push is oblique
  double surely_plain_;    // above it neither
  const Turns& turns_;
};

}  // namespace touchline
