// SPDX-License-Identifier: Apache-2.0
// Two contacts on one segment that began at the same instant: the best pairs of points, moved over
// the surfaces to where they explain best, weighed by their evidence. Whether they can be told
// apart follows from the volume that explains as well: where the equations do not suffice (theory:
// 6 and one per instrumented joint between the two, of 10) it is large, and so is the weight of
// such an explanation. No allocation per search.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/localizer/pair_starts.hpp"
#include "touchline/model/dense.hpp"
#include "touchline/place/approach.hpp"

namespace touchline {

class PairSearch {
 public:
  static constexpr int kSolutions = 48, kUnknowns = 10;

  PairSearch(const Posture& posture, const LinkSurfaces& surfaces,
             const LocalizerSettings& settings, std::size_t rows, int segments)
      : posture_(posture),
        surfaces_(surfaces),
        settings_(settings),
        starts_(posture, surfaces, settings, rows, segments),
        columns_(rows * (kUnknowns + 1)),
        values_(rows) {}

  // Searches segment g, which `measurement` has read and whose rows are `lag` [s] old. The
  // solutions are those that explain, the most probable first.
  void search(int g, double lag, const Measurement& measurement) {
    g_ = g;
    lag_ = measurement.lag(lag);
    measurement_ = &measurement;
    rows_ = measurement.size();
    count_ = 0;
    measurement.values(values_.data(), 1);
    starts_.find(g, lag, measurement);
    for (int i = 0; i < starts_.count(); ++i) refine(starts_[i]);
    for (int i = 0, n = count_; i < n; ++i) enter(solutions_[i]);
    weigh();
  }

  int count() const { return count_; }
  const Pair& operator[](int i) const { return solutions_[i]; }
  // The parts of the segment that may be touched.
  const PairStarts& starts() const { return starts_; }

  // Independent equations for a contact on each of two bodies: the rows of the wrench, and those
  // that feel only one of the two; without a wrench those that feel either.
  int rank(int node_a, int node_b) const {
    const bool wrench = measurement_->has_wrench();
    int count = wrench ? 6 : 0;
    for (int i = count; i < rows_; ++i) {
      const bool a = measurement_->feels(i, node_a), b = measurement_->feels(i, node_b);
      count += wrench ? a != b : a || b;
    }
    return count;
  }

 private:
  static constexpr int kSteps = 24;        // of a refinement
  static constexpr double kSame = 0.01;    // solutions nearer than this are one [m]
  static constexpr double kWindow = 25.0;  // of cost: beyond it a solution weighs nothing
  static constexpr double kHopeless = 1e5;  // cost after a third of the steps

  Vec3 earlier(const Vec3& p, int node) const {
    const Spatial& v = posture_.twist(node);
    return p - lag_ * (v.linear + cross(v.angular, p));
  }

  // Fills columns: forces of both ends, their tangents, what is measured; all whitened.
  void model(const PairEnd* ends) {
    const int width = kUnknowns + 1;
    double* d = columns_.data();
    const Vec3 unit[3] = {{1.0, 0.0, 0.0}, {0.0, 1.0, 0.0}, {0.0, 0.0, 1.0}};
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = ends[k];
      const Vec3 p = earlier(e.point, e.node);
      for (int i = 0; i < 3; ++i)
        measurement_->load(e.node, {unit[i], cross(p, unit[i])}, lag_, d + 3 * k + i, width);
      Vec3 s[2];
      tangents(e.normal, s[0], s[1]);
      for (int i = 0; i < 2; ++i)
        measurement_->load(e.node, {{}, cross(s[i], e.force)}, lag_, d + 6 + 2 * k + i, width);
    }
    for (int r = 0; r < rows_; ++r) d[r * width + kUnknowns] = values_[r];
    for (int i = 0; i < width; ++i) measurement_->whiten(d + i, width);
  }

  // The forces at given points that explain best, in closed form.
  void solve_forces(Pair& s) {
    double A[36], g[6];
    const int width = kUnknowns + 1;
    double square = 0.0;
    model(s.ends);
    std::fill(A, A + 36, 0.0);
    std::fill(g, g + 6, 0.0);
    for (int r = 0; r < rows_; ++r) {
      const double* d = columns_.data() + r * width;
      square += d[kUnknowns] * d[kUnknowns];
      for (int i = 0; i < 6; ++i) {
        g[i] += d[i] * d[kUnknowns];
        for (int j = 0; j <= i; ++j) A[6 * i + j] += d[i] * d[j];
      }
    }
    for (int i = 0; i < 6; ++i) A[7 * i] += 1.0 / (settings_.force_scale * settings_.force_scale);
    double x[6];
    std::copy(g, g + 6, x);
    s.cost = std::numeric_limits<double>::infinity();
    if (!cholesky(A, 6)) return;
    solve_cholesky(A, 6, x);
    for (int i = 0; i < 6; ++i) square -= g[i] * x[i];
    s.ends[0].force = {x[0], x[1], x[2]};
    s.ends[1].force = {x[3], x[4], x[5]};
    s.chi2 = s.cost = square;
    for (const PairEnd& e : s.ends) s.cost += cone(e);
  }

  // Beyond the friction cone costs more and more, but a way out of it stays.
  double cone(const PairEnd& e) const {
    const double size = norm(e.force);
    if (!(size > 0.0)) return 0.0;
    const double beyond = std::acos(std::clamp(-dot(e.normal, e.force) / size, -1.0, 1.0)) -
                          std::atan(settings_.friction);
    const double x = std::max(0.0, beyond) / settings_.cone_softness;
    return x * x;
  }

  void refine(Pair s) {
    solve_forces(s);
    double damping = 1e-3;
    for (int i = 0; i < kSteps && damping < 1e6; ++i) {
      Pair next = s;
      const double length = step(next, damping);
      if (length < 1e-5) break;
      solve_forces(next);
      if (next.cost < s.cost) {
        const bool flat = s.cost - next.cost < 1e-3 * s.cost && length < 1e-3;
        s = next;
        damping = std::max(1e-6, 0.2 * damping);
        if (flat) break;
      } else {
        damping *= 8.0;
      }
      if (i == kSteps / 3 && s.cost > kHopeless) return;
    }
    if (s.cost > chi2_limit(rows_, settings_.pitch_limit) + kWindow) return;
    add(s);
  }

  // Where the line of either force enters its body elsewhere, it explains as well.
  void enter(const Pair& s) {
    for (int k = 0; k < 2; ++k) {
      const PairEnd& e = s.ends[k];
      const double size = norm(e.force);
      if (size < settings_.least_force) continue;
      const ForceLine line{e.point, (1.0 / size) * e.force};
      for (const Body& body : surfaces_.bodies(g_)) {
        if (body.node != e.node) continue;
        for (int own : body.surfaces) {
          surfaces_.entries(own, line, [&](int surface, const Vec3& point, const Vec3& normal,
                                           double t) {
            if (std::fabs(t) < kSame) return;
            Pair other = s;
            other.ends[k].surface = surface;
            other.ends[k].point = point;
            other.ends[k].normal = normal;
            solve_forces(other);
            if (other.cost < s.cost + kWindow) add(other);
          });
        }
      }
    }
  }

  // One damped Gauss-Newton step of the points; its length [m].
  double step(Pair& s, double damping) {
    double H[kUnknowns * kUnknowns], x[kUnknowns];
    information(s, H, x);
    for (int i = 6; i < kUnknowns; ++i) H[i * (kUnknowns + 1)] *= 1.0 + damping;
    if (!cholesky(H, kUnknowns)) return 0.0;
    solve_cholesky(H, kUnknowns, x);
    double length = 0.0;
    for (int k = 0; k < 2; ++k) {
      PairEnd& e = s.ends[k];
      Vec3 a, b;
      tangents(e.normal, a, b);
      Vec3 way = x[6 + 2 * k] * a + x[7 + 2 * k] * b;
      const double size = norm(way);
      if (size > 0.04) way = (0.04 / size) * way;
      const SurfacePoint p = surfaces_.nearest(e.surface, e.point + way, 0.1);
      if (p.face < 0) return 0.0;
      length = std::max(length, norm(p.point - e.point));
      e.point = p.point;
      e.normal = p.normal;
    }
    return length;
  }

  // Of forces and tangents, with what is assumed where nothing is measured; and the gradient.
  void information(const Pair& s, double* H, double* g) {
    const int n = kUnknowns, width = n + 1;
    model(s.ends);
    std::fill(H, H + n * n, 0.0);
    std::fill(g, g + n, 0.0);
    const Vec3 &f = s.ends[0].force, &h = s.ends[1].force;
    const double forces[6] = {f.x, f.y, f.z, h.x, h.y, h.z};
    for (int r = 0; r < rows_; ++r) {
      const double* d = columns_.data() + r * width;
      double rest = d[n];
      for (int i = 0; i < 6; ++i) rest -= d[i] * forces[i];
      for (int i = 0; i < n; ++i) {
        g[i] += d[i] * rest;
        for (int j = 0; j <= i; ++j) H[n * i + j] += d[i] * d[j];
      }
    }
    for (int i = 0; i < n; ++i) {
      const double scale = i < 6 ? settings_.force_scale : settings_.place_scale;
      H[i * width] += 1.0 / (scale * scale);
    }
  }

  void add(const Pair& s) {
    for (int i = 0; i < count_; ++i) {
      Pair& o = solutions_[i];
      const bool same = o.ends[0].surface == s.ends[0].surface &&
                        o.ends[1].surface == s.ends[1].surface && near(o, s, kSame);
      if (!same) continue;
      if (s.cost < o.cost) o = s;
      return;
    }
    if (count_ < kSolutions) solutions_[count_++] = s;
  }

  // Evidence of each solution (Laplace), then probabilities. Where the equations do not suffice the
  // solutions of two bodies are parts of one: only the best of them counts in full.
  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < count_; ++i) {
      Pair& s = solutions_[i];
      double H[kUnknowns * kUnknowns], g[kUnknowns];
      information(s, H, g);
      s.weight = -std::numeric_limits<double>::infinity();
      if (!cholesky(H, kUnknowns)) continue;
      s.weight = -0.5 * (s.cost + log_determinant(H, kUnknowns));
      for (int k = 0; k < 2; ++k) {
        const PairEnd& e = s.ends[k];
        const double cosine = -dot(e.normal, e.force) / std::max(norm(e.force), 1e-9);
        s.weight += std::log(std::max(cosine, 0.02)) +
                    approach(surfaces_, e.point, e.force, settings_.finger);
        spread_of(H, 6 + 2 * k, s.ends[k].along);
      }
      s.rank = rank(s.ends[0].node, s.ends[1].node);
      most = std::max(most, s.weight);
    }
    double sum = 0.0;
    for (int i = 0; i < count_; ++i) sum += solutions_[i].weight = std::exp(solutions_[i].weight - most);
    for (int i = 0; i < count_; ++i) solutions_[i].weight /= sum;
    std::sort(solutions_, solutions_ + count_,
              [](const Pair& a, const Pair& b) { return a.weight > b.weight; });
  }

  static void spread_of(const double* L, int i, double* out) {
    for (int k = 0; k < 2; ++k) {
      double x[kUnknowns] = {};
      x[i + k] = 1.0;
      solve_cholesky(L, kUnknowns, x);
      if (k == 0) out[0] = x[i];
      out[k + 1] = x[i + 1];
    }
  }

  const Posture& posture_;
  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  PairStarts starts_;
  std::vector<double> columns_, values_;
  Pair solutions_[kSolutions];
  const Measurement* measurement_ = nullptr;
  int g_ = 0, rows_ = 0, count_ = 0;
  double lag_ = 0.0;
};

}  // namespace touchline
