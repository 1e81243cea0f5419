// SPDX-License-Identifier: Apache-2.0
// Where the search for two contacts begins: all pairs of points spread over the links of a segment,
// with forces in closed form. Each point stands for its neighbourhood: an unknown moment goes with
// its force. No allocation per search.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/localizer/pair.hpp"
#include "touchline/model/dense.hpp"
#include "touchline/place/hypothesis.hpp"
#include "touchline/place/link_surfaces.hpp"
#include "touchline/place/measurement.hpp"

namespace touchline {

class PairStarts {
 public:
  static constexpr double kReach = 0.025;  // of what a point of a region stands for [m]

  PairStarts(const Posture& posture, const LinkSurfaces& surfaces,
             const LocalizerSettings& settings, std::size_t rows, int segments)
      : posture_(posture),
        surfaces_(surfaces),
        settings_(settings),
        white_(2 * rows * 6),
        values_(rows),
        target_(rows) {
    std::size_t most = 0;
    for (int g = 0; g < segments; ++g) {
      starts_.emplace_back();
      for (const Body& body : surfaces.bodies(g)) starts_.back().push_back(spread(body));
      most = std::max(most, starts_.back().size());
    }
    maps_.resize(most * rows * 6);
    costs_.resize(most * kStarts);
    for (auto& terms : terms_) {
      terms.resize(kStarts);
      for (Term& t : terms) t.load.resize(3 * rows);
    }
  }

  // Finds the best pairs of points of segment g, which `measurement` has read and whose rows are
  // `lag` [s] old.
  void find(int g, double lag, const Measurement& measurement) {
    g_ = g;
    lag_ = measurement.lag(lag);
    measurement_ = &measurement;
    rows_ = measurement.size();
    count_ = tried_ = 0;
    std::fill(costs_.begin(), costs_.end(), std::numeric_limits<double>::infinity());
    if (rows_ > kRows) return;
    const std::vector<Body>& bodies = surfaces_.bodies(g);
    measurement.values(values_.data(), 1);
    for (std::size_t b = 0; b < bodies.size(); ++b)
      map(bodies[b].node, maps_.data() + b * 6 * rows_);
    const double w = norm(Vec3{values_[0], values_[1], values_[2]});
    moment_ = kSpacing * std::clamp(w, 10.0, settings_.force_scale);
    for (std::size_t a = 0; a < bodies.size(); ++a) {
      for (std::size_t b = a; b < bodies.size(); ++b) try_bodies(a, b);
    }
  }

  int count() const { return count_; }
  const Pair& operator[](int i) const { return found_[i]; }

  // Calls `visit(surface, point, cost)` for each point of the segment that may be touched: the cost
  // is that of the best pair with one contact in its neighbourhood.
  template <class Visit>
  void regions(Visit&& visit) const {
    for (std::size_t b = 0; b < starts_[g_].size(); ++b) {
      const BodyStarts& body = starts_[g_][b];
      for (std::size_t i = 0; i < body.starts.size(); ++i) {
        const double cost = costs_[b * kStarts + i];
        if (cost < kPlausible)
          visit(body.starts[i].surface, surfaces_.to_world(body.starts[i].point, body.node), cost);
      }
    }
  }

 private:
  static constexpr int kRows = 64;             // beyond it nothing is searched
  static constexpr int kStarts = 40;           // points per body
  static constexpr int kPerBodies = 4;         // pairs that are kept of two bodies
  static constexpr int kFollowed = 24;         // and of all
  static constexpr int kTries = 45;            // pairs of bodies that are searched at most
  static constexpr double kSpacing = 0.02;     // of what a point stands for [m], one sigma
  static constexpr double kSoft = 0.3;         // of the friction cone of such a point [rad]
  static constexpr double kApart = 0.03;       // pairs nearer than this are one [m]
  static constexpr double kPlausible = 20.0;   // cost of a region that may be touched
  static constexpr double kFloor = 30.0;       // misfit at which two bodies are given up
  static constexpr double kTurn = 15.0;        // cost by which other pairs of bodies come first

  struct Start {
    int surface;
    Vec3 point, normal;  // in the frame of the node
  };
  struct BodyStarts {
    int node;
    std::vector<Start> starts;
  };
  // A start at this posture, whitened: what its force does, and its normal equations.
  struct Term {
    const Start* start;
    Vec3 point, normal;
    std::vector<double> load;  // rows by three
    double A[9], g[3];
  };
  // Points of a body, shared out by the areas of its surfaces.
  BodyStarts spread(const Body& body) const {
    BodyStarts out{body.node, {}};
    double total = 0.0;
    std::vector<double> areas;
    for (int s : body.surfaces) {
      areas.push_back(0.0);
      for (const Triangle& t : surfaces_[s].mesh.triangles()) areas.back() += norm(cross(t.ab, t.ac));
      total += areas.back();
    }
    for (std::size_t k = 0; k < areas.size(); ++k) {
      const auto& samples = surfaces_.samples(body.surfaces[k]);
      const int share = std::max(1, static_cast<int>(kStarts * areas[k] / total));
      for (int i = 0; i < share && !samples.empty(); ++i) {
        if (out.starts.size() == kStarts) break;
        const SurfaceSample& p = samples[(2 * i + 1) * samples.size() / (2 * share)];
        out.starts.push_back({body.surfaces[k], p.point, p.normal});
      }
    }
    return out;
  }

  // What unit wrenches on a body do to the rows (rows, 6).
  void map(int node, double* out) const {
    for (int i = 0; i < 6; ++i) {
      double w[6] = {};
      w[i] = 1.0;
      measurement_->load(node, touchline::load(w), lag_, out + i, 6);
    }
  }

  Vec3 earlier(const Vec3& p, int node) const {
    const Spatial& v = posture_.twist(node);
    return p - lag_ * (v.linear + cross(v.angular, p));
  }

  // The best pairs of points of two bodies.
  void try_bodies(std::size_t a, std::size_t b) {
    if (tried_ == kTries || !weigh_roughly(a, b)) return;
    ++tried_;
    const std::size_t ends[2] = {a, b};
    int sizes[2];
    for (int k = 0; k < 2; ++k) sizes[k] = place(ends[k], white_.data() + k * 6 * rows_, terms_[k]);
    double square = 0.0;
    for (int r = 0; r < rows_; ++r) square += target_[r] * target_[r];
    Pair best[kPerBodies];
    for (int i = 0; i < sizes[0]; ++i) {
      for (int j = a == b ? i + 1 : 0; j < sizes[1]; ++j) {
        double* const reach[2] = {&costs_[a * kStarts + i], &costs_[b * kStarts + j]};
        try_pair(i, j, square, reach, best);
      }
    }
    for (int k = 0; k < kPerBodies; ++k) {
      Pair& rough = best[k];
      if (!std::isfinite(rough.cost)) continue;
      rough.cost += k * kTurn;  // every pair of bodies gets its turn
      rough.ends[0].node = surfaces_.bodies(g_)[a].node;
      rough.ends[1].node = surfaces_.bodies(g_)[b].node;
      insert(rough);
    }
  }

  // Whitens the maps of two bodies, with the noise that their points stand for a neighbourhood;
  // false if not even free wrenches on the two explain.
  bool weigh_roughly(std::size_t a, std::size_t b) {
    const double* maps[2] = {maps_.data() + a * 6 * rows_, maps_.data() + b * 6 * rows_};
    if (floor(maps[0], maps[1]) > kFloor + chi2_limit(rows_, settings_.pitch_limit)) return false;
    measurement_->covariance(factor_);
    for (const double* m : maps) {
      for (int i = 0; i < rows_; ++i) {
        for (int j = 0; j <= i; ++j) {
          double sum = 0.0;
          for (int k = 3; k < 6; ++k) sum += m[6 * i + k] * m[6 * j + k];
          factor_[i * rows_ + j] += moment_ * moment_ * sum;
        }
      }
    }
    if (!cholesky(factor_, rows_, 1e-15)) return false;
    for (int k = 0; k < 2; ++k) {
      double* to = white_.data() + k * 6 * rows_;
      std::copy_n(maps[k], 6 * rows_, to);
      for (int c = 0; c < 6; ++c) solve_lower(factor_, rows_, to + c, 6);
    }
    std::copy_n(values_.data(), rows_, target_.data());
    solve_lower(factor_, rows_, target_.data());
    return true;
  }

  // The misfit of any two wrenches on the two bodies.
  double floor(const double* a, const double* b) {
    double J[kRows * 12], y[kRows], A[144], g[12];
    for (int r = 0; r < rows_; ++r) {
      y[r] = values_[r];
      for (int c = 0; c < 6; ++c) {
        J[12 * r + c] = a[6 * r + c];
        J[12 * r + 6 + c] = b[6 * r + c];
      }
    }
    for (int c = 0; c < 12; ++c) measurement_->whiten(J + c, 12);
    measurement_->whiten(y, 1);
    double cost = 0.0;
    std::fill(A, A + 144, 0.0);
    std::fill(g, g + 12, 0.0);
    for (int r = 0; r < rows_; ++r) {
      cost += y[r] * y[r];
      for (int i = 0; i < 12; ++i) {
        g[i] += J[12 * r + i] * y[r];
        for (int j = 0; j <= i; ++j) A[12 * i + j] += J[12 * r + i] * J[12 * r + j];
      }
    }
    for (int i = 0; i < 12; ++i) A[13 * i] += 1e-4;  // wrenches of 100 N and Nm
    double x[12];
    std::copy(g, g + 12, x);
    if (!cholesky(A, 12)) return 0.0;
    solve_cholesky(A, 12, x);
    for (int i = 0; i < 12; ++i) cost -= g[i] * x[i];
    return cost;
  }

  // The starts of a body with their whitened loads; how many.
  int place(std::size_t b, const double* map, std::vector<Term>& terms) {
    const BodyStarts& body = starts_[g_][b];
    int n = 0;
    for (const Start& start : body.starts) {
      Term& t = terms[n++];
      t.start = &start;
      t.point = surfaces_.to_world(start.point, body.node);
      t.normal = surfaces_.turn_to_world(start.normal, body.node);
      const Vec3 p = earlier(t.point, body.node);
      for (int r = 0; r < rows_; ++r) {
        const double* m = map + 6 * r;
        // f . row + (p x f) . moments = f . (row + moments x p)
        const Vec3 row = Vec3{m[0], m[1], m[2]} + cross(Vec3{m[3], m[4], m[5]}, p);
        t.load[3 * r] = row.x;
        t.load[3 * r + 1] = row.y;
        t.load[3 * r + 2] = row.z;
      }
      for (int i = 0; i < 3; ++i) {
        t.g[i] = 0.0;
        for (int r = 0; r < rows_; ++r) t.g[i] += t.load[3 * r + i] * target_[r];
        for (int j = 0; j <= i; ++j) {
          double sum = i == j ? 1.0 / (settings_.force_scale * settings_.force_scale) : 0.0;
          for (int r = 0; r < rows_; ++r) sum += t.load[3 * r + i] * t.load[3 * r + j];
          t.A[3 * i + j] = sum;
        }
      }
    }
    return n;
  }

  void try_pair(int i, int j, double square, double* const* reach, Pair* best) const {
    const Term &a = terms_[0][i], &b = terms_[1][j];
    double A[36], x[6] = {a.g[0], a.g[1], a.g[2], b.g[0], b.g[1], b.g[2]}, g[6];
    std::copy(x, x + 6, g);
    for (int p = 0; p < 3; ++p) {
      for (int q = 0; q <= p; ++q) {
        A[6 * p + q] = a.A[3 * p + q];
        A[6 * (3 + p) + 3 + q] = b.A[3 * p + q];
      }
      for (int q = 0; q < 3; ++q) A[6 * (3 + p) + q] = 0.0;
    }
    for (int r = 0; r < rows_; ++r) {
      const double *u = a.load.data() + 3 * r, *v = b.load.data() + 3 * r;
      for (int p = 0; p < 3; ++p) {
        for (int q = 0; q < 3; ++q) A[6 * (3 + p) + q] += v[p] * u[q];
      }
    }
    if (!cholesky(A, 6)) return;
    solve_cholesky(A, 6, x);
    double cost = square;
    for (int k = 0; k < 6; ++k) cost -= g[k] * x[k];
    if (cost > std::max({best[kPerBodies - 1].cost, *reach[0], *reach[1]})) return;
    const Vec3 f{x[0], x[1], x[2]}, h{x[3], x[4], x[5]};
    cost += soft_cone(f, a.normal) + soft_cone(h, b.normal);
    for (int k = 0; k < 2; ++k) *reach[k] = std::min(*reach[k], cost);
    if (cost > best[kPerBodies - 1].cost) return;
    Pair rough;
    rough.cost = cost;
    rough.ends[0] = {a.start->surface, -1, a.point, a.normal, f, {}};
    rough.ends[1] = {b.start->surface, -1, b.point, b.normal, h, {}};
    int at = kPerBodies - 1;
    for (int k = 0; k < kPerBodies; ++k) {
      if (!std::isfinite(best[k].cost) || !near(best[k], rough, kApart)) continue;
      if (best[k].cost <= cost) return;
      at = k;
      break;
    }
    best[at] = rough;
    for (; at > 0 && best[at].cost < best[at - 1].cost; --at) std::swap(best[at], best[at - 1]);
  }

  double soft_cone(const Vec3& f, const Vec3& normal) const {
    const double size = norm(f);
    if (size < settings_.least_force) return 4.0;
    const double beyond =
        std::acos(std::clamp(-dot(normal, f) / size, -1.0, 1.0)) - std::atan(settings_.friction);
    return beyond > 0.0 ? beyond * beyond / (kSoft * kSoft) : 0.0;
  }

  // Keeps the best starts of all.
  void insert(const Pair& rough) {
    if (count_ == kFollowed && rough.cost >= found_[count_ - 1].cost) return;
    int at = count_ < kFollowed ? count_++ : kFollowed - 1;
    found_[at] = rough;
    for (; at > 0 && found_[at].cost < found_[at - 1].cost; --at)
      std::swap(found_[at], found_[at - 1]);
  }

  const Posture& posture_;
  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  std::vector<std::vector<BodyStarts>> starts_;  // per segment and body
  std::vector<double> maps_, white_, values_, target_;
  std::vector<double> costs_;  // of the best pair that each start is part of
  std::vector<Term> terms_[2];
  double factor_[kRows * kRows];
  Pair found_[kFollowed];
  const Measurement* measurement_ = nullptr;
  int g_ = 0, rows_ = 0, count_ = 0, tried_ = 0;
  double lag_ = 0.0, moment_ = 0.0;
};

}  // namespace touchline
