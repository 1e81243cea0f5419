// SPDX-License-Identifier: Apache-2.0
// Where the search for two contacts begins: all pairs of points spread over the links of a segment,
// with forces in closed form. Each point stands for its neighbourhood: an unknown moment goes with
// its force. The search goes on by parts; what it finds does not depend on them. No allocation per
// search.
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
  // Of segment g.
  PairStarts(const LinkSurfaces& surfaces, const LocalizerSettings& settings, int g)
      : settings_(settings),
        cone_(std::atan(settings.friction)),
        lanes_{StartLanes(kStarts), StartLanes(kStarts)} {
    for (const Body& body : surfaces.bodies(g)) bodies_.emplace_back(surfaces, body);
    costs_.resize(bodies_.size() * bodies_.size() * kBlocks);
    partners_.resize(costs_.size());
  }

  // Begins to look for the best pairs of points of the segment.
  void begin(const PairView& view) {
    view_ = &view;
    count_ = 0;
    bodies_at_[0] = bodies_at_[1] = start_ = 0;
    prepared_ = false;
    std::fill(costs_.begin(), costs_.end(), all_lanes(kInfinity));
    for (int b = 0; b < bodies(); ++b) bodies_[b].pose(view, b);
    const double* y = view.values();
    const double w = norm(Vec3{y[0], y[1], y[2]});
    moment_ = kSpacing * std::clamp(w, 10.0, settings_.force_scale);
  }
  void clear() {
    view_ = nullptr;
    count_ = 0;
  }
  bool working() const { return view_ != nullptr && bodies_at_[0] < bodies(); }

  // Goes on for about so many units of work (`LocalizerTuning::pair_work`); how many there were.
  int work(int units) {
    int done = 0;
    while (working() && done < units) {
      const int a = bodies_at_[0], b = bodies_at_[1];
      if (!prepared_) {
        prepared_ = prepare(a, b);
        done += prepared_ ? kPrepared : kGivenUp;
        if (!prepared_) next_bodies();
        continue;
      }
      done += kKept * try_start(a, start_, b) + 2 + lanes_[1].count() / kTried;
      if (++start_ < bodies_[a].count()) continue;
      for (int k = 0; k < kPerBodies; ++k) {
        if (!std::isfinite(best_[k].cost)) continue;
        best_[k].cost += k * kTurn;  // every pair of bodies gets its turn
        insert(best_[k]);
      }
      next_bodies();
    }
    return done;
  }

  int count() const { return count_; }
  const Pair& operator[](int i) const { return found_[i]; }

  // Calls `visit(surface, point, cost, reach)` for each point of the segment, in the frame of its node,
  // that may be touched: the cost is that of the best pair with one contact in its neighbourhood,
  // within `reach` [m].
  template <class Visit>
  void regions(Visit&& visit) const {
    for (int b = 0; view_ != nullptr && b < bodies(); ++b) {
      const BodyStarts& starts = bodies_[b];
      for (int i = 0; i < starts.count(); ++i) {
        double cost = kInfinity;
        for (int other = 0; other < bodies(); ++other)
          cost = std::min(cost, lane(costs_[at(b, other, i)], i % kLanes));
        if (cost < kPlausible) visit(starts.surface(i), starts.own_point(i), cost, starts.reach());
      }
    }
  }

  // The best pair of each point with each body, where it may be touched: the next one after a place in
  // that list, which begins at 0, and which of its ends the point is.
  bool plausible(int& place, Pair& pair, int& end) const {
    for (; place < bodies() * bodies() * kStarts; ++place) {
      const int a = place / kStarts / bodies(), b = place / kStarts % bodies(), i = place % kStarts;
      if (i >= bodies_[a].count()) continue;
      const double cost = lane(costs_[at(a, b, i)], i % kLanes);
      if (!(cost < kPlausible)) continue;
      const int j = static_cast<int>(lane(partners_[at(a, b, i)], i % kLanes));
      pair = a <= b ? placed(a, i, b, j) : placed(b, j, a, i);
      pair.cost = cost;
      end = a <= b ? 0 : 1;
      ++place;
      return true;
    }
    return false;
  }

 private:
  static constexpr int kBoth = 12;  // unknowns of two wrenches
  static constexpr double kInfinity = std::numeric_limits<double>::infinity();
  static constexpr int kStarts = BodyStarts::kMost, kBlocks = (kStarts + kLanes - 1) / kLanes;
  static constexpr int kPerBodies = 4;         // pairs that are kept of two bodies
  static constexpr int kFollowed = 24;         // and of all
  // Units of work, as measured: a pair of bodies that is given up, or prepared; and a pair that is kept.
  // So many points of one body are a unit beside a point of the other. Not blocks: how wide they are
  // depends on the processor.
  static constexpr int kGivenUp = 10, kPrepared = 100, kKept = 3, kTried = 3;
  static constexpr double kSpacing = 0.02;     // of what a point stands for [m], one sigma
  static constexpr double kSoft = 0.3;         // of the friction cone of such a point [rad]
  static constexpr double kApart = 0.03;       // pairs nearer than this are one [m]
  static constexpr double kPlausible = 20.0;   // cost of a region that may be touched
  static constexpr double kFloor = 30.0;       // misfit at which two bodies are given up
  static constexpr double kTurn = 15.0;        // cost by which other pairs of bodies come first
  static constexpr double kForceless = 4.0;    // cost of an end without a force

  int bodies() const { return static_cast<int>(bodies_.size()); }

  void next_bodies() {
    prepared_ = false;
    start_ = 0;
    if (++bodies_at_[1] == bodies()) bodies_at_[1] = ++bodies_at_[0];
  }

  // Makes two bodies ready for their points to be tried; false if not even free wrenches on the two
  // explain.
  bool prepare(int a, int b) {
    double h[kBoth];
    view_->information(a, b, N_, h);
    square_ = view_->square();
    if (floor(N_, h) > kFloor + chi2_limit(view_->rows(), settings_.pitch_limit)) return false;
    if (!soften(h)) return false;
    const int ends[2] = {a, b};
    for (int k = 0; k < 2; ++k) {
      const BodyStarts& starts = bodies_[ends[k]];
      lanes_[k].fill(starts.earlier(), starts.normals(), starts.count(), N_ + k * 6 * (kBoth + 1),
                     kBoth, h + 6 * k, settings_.force_scale);
    }
    std::fill(best_, best_ + kPerBodies, Pair{});
    return true;
  }

  // The misfit of any two wrenches on the two bodies.
  double floor(const double* N, const double* h) const {
    double A[kBoth * kBoth], x[kBoth], cost = square_;
    std::copy_n(N, kBoth * kBoth, A);
    std::copy_n(h, kBoth, x);
    for (int i = 0; i < kBoth; ++i) A[(kBoth + 1) * i] += 1e-4;  // wrenches of 100 N and Nm
    if (!cholesky(A, kBoth)) return 0.0;
    solve_lower(A, kBoth, x);
    for (int i = 0; i < kBoth; ++i) cost -= x[i] * x[i];
    return cost;
  }

  // Takes out of the normal equations what unknown moments on both bodies may do. Points stand for a
  // neighbourhood: with `z` those moments, of variance m^2, N - N_z (N_zz + 1 / m^2)^-1 N_z is left.
  bool soften(double* h) {
    constexpr int moments[6] = {3, 4, 5, 9, 10, 11};
    double K[36], X[6 * (kBoth + 1)];
    for (int i = 0; i < 6; ++i) {
      const double* row = N_ + kBoth * moments[i];
      for (int j = 0; j <= i; ++j) K[6 * i + j] = row[moments[j]];
      K[7 * i] += 1.0 / (moment_ * moment_);
      std::copy_n(row, kBoth, X + (kBoth + 1) * i);
      X[(kBoth + 1) * i + kBoth] = h[moments[i]];
    }
    if (!cholesky(K, 6, 1e-15)) return false;
    for (int c = 0; c <= kBoth; ++c) solve_lower(K, 6, X + c, kBoth + 1);
    for (int k = 0; k < 6; ++k) {
      const double *x = X + (kBoth + 1) * k, z = x[kBoth];
      for (int i = 0; i < kBoth; ++i) {
        h[i] -= x[i] * z;
        for (int j = 0; j < kBoth; ++j) N_[kBoth * i + j] -= x[i] * x[j];
      }
      square_ -= z * z;
    }
    return true;
  }

  // Start i of body a beside all of body b; on one body, beside those that follow it. First all costs,
  // whatever they are: a branch on each would be guessed wrong more often than it saves.
  // How many are kept.
  int try_start(int a, int i, int b) {
    StartBeside one(lanes_[0], i, N_ + 6, kBoth, square_);
    const StartLanes& others = lanes_[1];
    const int first = a == b ? (i + 1) / kLanes : 0, k = i % kLanes;
    const Lanes normal[3] = {all_lanes(one.normal()[0]), all_lanes(one.normal()[1]),
                             all_lanes(one.normal()[2])};
    Lanes costs[kBlocks], f[6];
    int kept = 0;
    for (int block = first; block < others.blocks(); ++block) {
      Lanes cost = one.misfit(others, block);
      one.forces(others, block, f);
      cost += soft_cone(f, normal) + soft_cone(f + 3, others.normal(block));
      for (int j = 0; a == b && j < kLanes && block * kLanes + j <= i; ++j)
        set_lane(cost, j, kInfinity);
      Lanes &reach = costs_[at(b, a, block * kLanes)], &by = partners_[at(b, a, block * kLanes)];
      const auto nearer = cost < reach;
      by = nearer ? all_lanes(i) : by;
      reach = nearer ? cost : reach;
      costs[block] = cost;
    }
    Lanes &own = costs_[at(a, b, i)], &partner = partners_[at(a, b, i)];
    for (int block = first; block < others.blocks(); ++block) {
      const Lanes cost = costs[block];
      const double enough = std::max(best_[kPerBodies - 1].cost, lane(own, k));
      if (!any_below(cost, all_lanes(enough))) continue;
      for (int j = 0; j < kLanes; ++j) {
        if (lane(cost, j) < lane(own, k)) {
          set_lane(own, k, lane(cost, j));
          set_lane(partner, k, block * kLanes + j);
        }
        if (!(lane(cost, j) < best_[kPerBodies - 1].cost)) continue;
        const int at = place_among_best(a, i, b, block * kLanes + j, lane(cost, j));
        if (at < 0) continue;
        ++kept;
        one.misfit(others, block);
        one.forces(others, block, f);
        keep(make(a, i, b, block * kLanes + j, f, lane(cost, j)), at);
      }
    }
    return kept;
  }

  // Where the costs of start i of body a with those of body b stand.
  int at(int a, int b, int i) const { return (a * bodies() + b) * kBlocks + i / kLanes; }

  Lanes soft_cone(const Lanes* f, const Lanes* normal) const {
    const Lanes size = root(f[0] * f[0] + f[1] * f[1] + f[2] * f[2]);
    const Lanes along = f[0] * normal[0] + f[1] * normal[1] + f[2] * normal[2];
    const Lanes beyond =
        larger(arc_cosine(-along / larger(size, all_lanes(1e-9))) - cone_, all_lanes(0.0));
    return size < all_lanes(settings_.least_force) ? all_lanes(kForceless)
                                                   : (1.0 / (kSoft * kSoft)) * beyond * beyond;
  }

  // While the starts stand where they were posed.
  Pair make(int a, int i, int b, int j, const Lanes* f, double cost) const {
    Pair rough = indexed(a, i, b, j);
    rough.cost = cost;
    rough.ends[0].point = bodies_[a].points()[i];
    rough.ends[1].point = bodies_[b].points()[j];
    rough.ends[0].normal = bodies_[a].normals()[i];
    rough.ends[1].normal = bodies_[b].normals()[j];
    for (int e = 0; e < 2; ++e) {
      const Lanes* own = f + 3 * e;
      const int k = j % kLanes;
      rough.ends[e].force = {lane(own[0], k), lane(own[1], k), lane(own[2], k)};
    }
    return rough;
  }

  // By the view as it is.
  Pair placed(int a, int i, int b, int j) const {
    Pair pair = indexed(a, i, b, j);
    const int starts[2] = {i, j};
    for (int e = 0; e < 2; ++e) {
      PairEnd& end = pair.ends[e];
      const BodyStarts& of = bodies_[end.body];
      end.point = view_->to_world(of.own_point(starts[e]), end.body);
      end.normal = view_->turn_to_world(of.own_normal(starts[e]), end.body);
    }
    return pair;
  }

  // Without points and normals.
  Pair indexed(int a, int i, int b, int j) const {
    Pair pair;
    const int bodies[2] = {a, b}, starts[2] = {i, j};
    for (int e = 0; e < 2; ++e) {
      const BodyStarts& of = bodies_[bodies[e]];
      PairEnd& end = pair.ends[e];
      end.surface = of.surface(starts[e]);
      end.body = bodies[e];
      end.node = view_->node(bodies[e]);
      end.place = of.place(starts[e]);
    }
    return pair;
  }

  // The best few of two bodies are apart from each other: whose place would a pair take of that cost?
  // -1: nobody's.
  int place_among_best(int a, int i, int b, int j, double cost) const {
    const Vec3 &first = bodies_[a].points()[i], &second = bodies_[b].points()[j];
    for (int k = 0; k < kPerBodies; ++k) {
      if (!std::isfinite(best_[k].cost) || !near(best_[k], first, second, kApart)) continue;
      return best_[k].cost <= cost ? -1 : k;
    }
    return kPerBodies - 1;
  }
  void keep(const Pair& rough, int at) {
    best_[at] = rough;
    for (; at > 0 && best_[at].cost < best_[at - 1].cost; --at) std::swap(best_[at], best_[at - 1]);
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
  std::vector<BodyStarts> bodies_;
  StartLanes lanes_[2];
  // Of the best pair of each start with each body, and with which of its starts.
  std::vector<Lanes> costs_, partners_;
  Pair found_[kFollowed];
  const PairView* view_ = nullptr;
  int count_ = 0;
  // What is at hand: two bodies, whether they are ready, and a start of the first one; the best pairs
  // of the two so far.
  int bodies_at_[2] = {}, start_ = 0;
  bool prepared_ = false;
  Pair best_[kPerBodies];
  // Normal equations of wrenches on both bodies, without what moments may do (theory: 6.5).
  double N_[kBoth * kBoth], square_ = 0.0;
  double moment_ = 0.0;  // one sigma of those [Nm]
};

}  // namespace touchline
