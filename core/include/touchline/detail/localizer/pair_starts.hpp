// SPDX-License-Identifier: Apache-2.0
// Where the search for two contacts begins: all pairs of points spread over the links of a segment,
// with forces in closed form. Each point stands for its neighbourhood: an unknown moment goes with
// its force. No allocation per search.
// Theory: docs/theory.md, section 6.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/localizer/body_starts.hpp"
#include "touchline/detail/localizer/pair.hpp"
#include "touchline/detail/localizer/start_beside.hpp"
#include "touchline/detail/place/hypothesis.hpp"

namespace touchline {

class PairStarts {
 public:
  PairStarts(const LinkSurfaces& surfaces, const LocalizerSettings& settings, std::size_t rows,
             int segments)
      : settings_(settings),
        cone_(std::atan(settings.friction)),
        lanes_{StartLanes(kStarts, rows), StartLanes(kStarts, rows)},
        white_(2 * rows * 6),
        target_(rows),
        factor_(rows * rows) {
    std::size_t most = 0;
    for (int g = 0; g < segments; ++g) {
      starts_.emplace_back();
      for (const Body& body : surfaces.bodies(g)) starts_.back().emplace_back(surfaces, body);
      most = std::max(most, starts_.back().size());
    }
    bodies_most_ = static_cast<int>(most);
    costs_.resize(most * most * kBlocks);
    partners_.resize(costs_.size());
  }

  // Finds the best pairs of points of the segment.
  void find(const PairView& view) {
    view_ = &view;
    bodies_ = &starts_[view.segment()];
    count_ = tried_ = 0;
    std::fill(costs_.begin(), costs_.end(), all_lanes(kInfinity));
    for (int b = 0; b < view.bodies(); ++b) (*bodies_)[b].pose(view, b);
    const double* y = view.values();
    const double w = norm(Vec3{y[0], y[1], y[2]});
    moment_ = kSpacing * std::clamp(w, 10.0, settings_.force_scale);
    for (int a = 0; a < view.bodies(); ++a) {
      for (int b = a; b < view.bodies(); ++b) try_bodies(a, b);
    }
  }
  void clear() {
    view_ = nullptr;
    count_ = 0;
  }

  int count() const { return count_; }
  const Pair& operator[](int i) const { return found_[i]; }

  // Calls `visit(surface, point, cost, reach)` for each point of the segment that may be touched: the
  // cost is that of the best pair with one contact in its neighbourhood, within `reach` [m].
  template <class Visit>
  void regions(Visit&& visit) const {
    for (int b = 0; view_ != nullptr && b < view_->bodies(); ++b) {
      const BodyStarts& starts = (*bodies_)[b];
      for (int i = 0; i < starts.count(); ++i) {
        double cost = kInfinity;
        for (int other = 0; other < view_->bodies(); ++other)
          cost = std::min(cost, lane(costs_[at(b, other, i)], i % kLanes));
        if (cost < kPlausible) visit(starts.surface(i), starts.points()[i], cost, starts.reach());
      }
    }
  }

  // Calls `visit(pair, end)` for the best pair of each point with each body, where it may be touched.
  template <class Visit>
  void plausible(Visit&& visit) const {
    for (int a = 0; view_ != nullptr && a < view_->bodies(); ++a) {
      for (int b = 0; b < view_->bodies(); ++b) {
        for (int i = 0; i < (*bodies_)[a].count(); ++i) {
          const double cost = lane(costs_[at(a, b, i)], i % kLanes);
          if (!(cost < kPlausible)) continue;
          const int j = static_cast<int>(lane(partners_[at(a, b, i)], i % kLanes));
          Pair pair = a <= b ? placed(a, i, b, j) : placed(b, j, a, i);
          pair.cost = cost;
          visit(pair, a <= b ? 0 : 1);
        }
      }
    }
  }

 private:
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr int kStarts = BodyStarts::kMost, kBlocks = (kStarts + kLanes - 1) / kLanes;
  static constexpr int kPerBodies = 4;         // pairs that are kept of two bodies
  static constexpr int kFollowed = 24;         // and of all
  static constexpr int kTries = 45;            // pairs of bodies that are searched at most
  static constexpr double kSpacing = 0.02;     // of what a point stands for [m], one sigma
  static constexpr double kSoft = 0.3;         // of the friction cone of such a point [rad]
  static constexpr double kApart = 0.03;       // pairs nearer than this are one [m]
  static constexpr double kPlausible = 20.0;   // cost of a region that may be touched
  static constexpr double kFloor = 30.0;       // misfit at which two bodies are given up
  static constexpr double kTurn = 15.0;        // cost by which other pairs of bodies come first
  static constexpr double kForceless = 4.0;    // cost of an end without a force

  // The best pairs of points of two bodies.
  void try_bodies(int a, int b) {
    if (tried_ == kTries || !weigh_roughly(a, b)) return;
    ++tried_;
    const int rows = view_->rows(), ends[2] = {a, b};
    for (int k = 0; k < 2; ++k) {
      const BodyStarts& starts = (*bodies_)[ends[k]];
      lanes_[k].fill(starts.earlier(), starts.normals(), starts.count(),
                     white_.data() + k * 6 * rows, target_.data(), rows, settings_.force_scale);
    }
    double square = 0.0;
    for (int r = 0; r < rows; ++r) square += target_[r] * target_[r];
    Pair best[kPerBodies];
    for (int i = 0; i < lanes_[0].count(); ++i) try_start(a, i, b, square, best);
    for (int k = 0; k < kPerBodies; ++k) {
      if (!std::isfinite(best[k].cost)) continue;
      best[k].cost += k * kTurn;  // every pair of bodies gets its turn
      insert(best[k]);
    }
  }

  // Whitens the maps of two bodies, with the noise that their points stand for a neighbourhood;
  // false if not even free wrenches on the two explain.
  bool weigh_roughly(int a, int b) {
    const int rows = view_->rows();
    if (floor(a, b) > kFloor + chi2_limit(rows, settings_.pitch_limit)) return false;
    std::copy_n(view_->covariance(), rows * rows, factor_.data());
    for (const double* m : {view_->map(a), view_->map(b)}) {
      for (int i = 0; i < rows; ++i) {
        for (int j = 0; j <= i; ++j) {
          double sum = 0.0;
          for (int k = 3; k < 6; ++k) sum += m[6 * i + k] * m[6 * j + k];
          factor_[i * rows + j] += moment_ * moment_ * sum;
        }
      }
    }
    if (!cholesky(factor_.data(), rows, 1e-15)) return false;
    double* to = white_.data();
    for (const double* m : {view_->map(a), view_->map(b)}) {
      std::copy_n(m, 6 * rows, to);
      for (int c = 0; c < 6; ++c) solve_lower(factor_.data(), rows, to + c, 6);
      to += 6 * rows;
    }
    std::copy_n(view_->values(), rows, target_.data());
    solve_lower(factor_.data(), rows, target_.data());
    return true;
  }

  // The misfit of any two wrenches on the two bodies.
  double floor(int a, int b) const {
    const double *maps[2] = {view_->white_map(a), view_->white_map(b)}, *y = view_->white_values();
    double A[144] = {}, x[12] = {}, g[12], row[12], cost = 0.0;
    for (int r = 0; r < view_->rows(); ++r) {
      for (int c = 0; c < 12; ++c) row[c] = maps[c / 6][6 * r + c % 6];
      cost += y[r] * y[r];
      for (int i = 0; i < 12; ++i) {
        x[i] += row[i] * y[r];
        for (int j = 0; j <= i; ++j) A[12 * i + j] += row[i] * row[j];
      }
    }
    for (int i = 0; i < 12; ++i) A[13 * i] += 1e-4;  // wrenches of 100 N and Nm
    std::copy(x, x + 12, g);
    if (!cholesky(A, 12)) return 0.0;
    solve_cholesky(A, 12, x);
    for (int i = 0; i < 12; ++i) cost -= g[i] * x[i];
    return cost;
  }

  // Start i of body a beside all of body b; on one body, beside those that follow it.
  void try_start(int a, int i, int b, double square, Pair* best) {
    StartBeside one(lanes_[0], i, square);
    const StartLanes& others = lanes_[1];
    Lanes &own = costs_[at(a, b, i)], &partner = partners_[at(a, b, i)];
    const int k = i % kLanes;
    for (int block = a == b ? (i + 1) / kLanes : 0; block < others.blocks(); ++block) {
      Lanes cost = one.misfit(others, block);
      for (int j = 0; a == b && j < kLanes && block * kLanes + j <= i; ++j)
        set_lane(cost, j, kInfinity);
      Lanes& reach = costs_[at(b, a, block * kLanes)];
      const double enough = std::max(best[kPerBodies - 1].cost, lane(own, k));
      if (!any_below(cost, larger(reach, all_lanes(enough)))) continue;
      Lanes f[6], n[3];
      one.forces(others, block, f);
      for (int c = 0; c < 3; ++c) n[c] = all_lanes(one.normal()[c]);
      cost += soft_cone(f, n) + soft_cone(f + 3, others.normal(block));
      Lanes& theirs = partners_[at(b, a, block * kLanes)];
      theirs = cost < reach ? all_lanes(i) : theirs;
      reach = smaller(reach, cost);
      for (int j = 0; j < kLanes; ++j) {
        if (lane(cost, j) < lane(own, k)) {
          set_lane(own, k, lane(cost, j));
          set_lane(partner, k, block * kLanes + j);
        }
        if (lane(cost, j) < best[kPerBodies - 1].cost)
          keep(best, make(a, i, b, block * kLanes + j, f, lane(cost, j)));
      }
    }
  }

  // Where the costs of start i of body a with those of body b stand.
  int at(int a, int b, int i) const { return (a * bodies_most_ + b) * kBlocks + i / kLanes; }

  Lanes soft_cone(const Lanes* f, const Lanes* normal) const {
    const Lanes size = root(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    const Lanes along = f[0] * normal[0] + f[1] * normal[1] + f[2] * normal[2];
    const Lanes beyond =
        larger(arc_cosine(-along / larger(size, all_lanes(1e-9))) - cone_, all_lanes(0.0));
    return size < all_lanes(settings_.least_force) ? all_lanes(kForceless)
                                                   : beyond * beyond / (kSoft * kSoft);
  }

  Pair make(int a, int i, int b, int j, const Lanes* f, double cost) const {
    Pair rough = placed(a, i, b, j);
    rough.cost = cost;
    for (int e = 0; e < 2; ++e) {
      const Lanes* own = f + 3 * e;
      const int k = j % kLanes;
      rough.ends[e].force = {lane(own[0], k), lane(own[1], k), lane(own[2], k)};
    }
    return rough;
  }

  Pair placed(int a, int i, int b, int j) const {
    Pair pair;
    const int bodies[2] = {a, b}, starts[2] = {i, j};
    for (int e = 0; e < 2; ++e) {
      const BodyStarts& of = (*bodies_)[bodies[e]];
      PairEnd& end = pair.ends[e];
      end.surface = of.surface(starts[e]);
      end.body = bodies[e];
      end.node = view_->node(bodies[e]);
      end.point = of.points()[starts[e]];
      end.normal = of.normals()[starts[e]];
    }
    return pair;
  }

  // Keeps the best few of two bodies, apart from each other.
  static void keep(Pair* best, const Pair& rough) {
    int at = kPerBodies - 1;
    for (int k = 0; k < kPerBodies; ++k) {
      if (!std::isfinite(best[k].cost) || !near(best[k], rough, kApart)) continue;
      if (best[k].cost <= rough.cost) return;
      at = k;
      break;
    }
    best[at] = rough;
    for (; at > 0 && best[at].cost < best[at - 1].cost; --at) std::swap(best[at], best[at - 1]);
  }

  // And of all.
  void insert(const Pair& rough) {
    if (count_ == kFollowed && rough.cost >= found_[count_ - 1].cost) return;
    int at = count_ < kFollowed ? count_++ : kFollowed - 1;
    found_[at] = rough;
    for (; at > 0 && found_[at].cost < found_[at - 1].cost; --at)
      std::swap(found_[at], found_[at - 1]);
  }

  const LocalizerSettings& settings_;
  double cone_;
  std::vector<std::vector<BodyStarts>> starts_;  // per segment and body
  StartLanes lanes_[2];
  std::vector<double> white_, target_, factor_;
  // Of the best pair of each start with each body, and with which of its starts.
  std::vector<Lanes> costs_, partners_;
  int bodies_most_ = 0;
  Pair found_[kFollowed];
  const PairView* view_ = nullptr;
  std::vector<BodyStarts>* bodies_ = nullptr;
  int count_ = 0, tried_ = 0;
  double moment_ = 0.0;
};

}  // namespace touchline
