// SPDX-License-Identifier: Apache-2.0
// The posterior of a contact's place over the surfaces, cell by cell: triangles halved until each
// is small beside the spread of the place, however many places there are and whatever their shape.
// For those who ask how sure a place is; not for the control loop: it allocates.
// Theory: docs/theory.md, section 5.8.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/place/approach.hpp"
#include "touchline/detail/place/explanations.hpp"
#include "touchline/detail/place/force_evidence.hpp"

namespace touchline {

struct SurfaceCell {
  int surface;
  Vec3 centre, normal;         // in world
  double area;                 // [m2]
  double log_density;          // of the posterior, per area
  double probability = 0.0;
};

class CredibleRegion {
 public:
  CredibleRegion(const Explanations& found, const PlaceSettings& settings)
      : found_(found), settings_(settings) {}

  // The cells of the segment that was explained last; probabilities sum to one.
  const std::vector<SurfaceCell>& cells() {
    cells_.clear();
    for (int i = 0; i < found_.views(); ++i) divide(found_.view(i), i);
    weigh();
    return cells_;
  }

 private:
  static constexpr std::size_t kMost = 20000;  // room: then cells stay as they are

  // chi2 grows by (p - origin)^T G (p - origin) away from an explanation.
  struct Metric {
    Vec3 origin;
    double G[9];
    double norm2(const Vec3& d) const {
      const double v[3] = {d.x, d.y, d.z};
      double sum = 0.0;
      for (int i = 0; i < 3; ++i)
        for (int j = 0; j < 3; ++j) sum += v[i] * G[3 * i + j] * v[j];
      return std::max(0.0, sum);
    }
  };
  struct Piece {
    Vec3 a, b, c;
  };

  void divide(const View& view, int index) {
    metrics_.clear();
    for (const Candidate& k : found_) {
      // Without a line a candidate is no measure of its surroundings: open forces add to them.
      const bool counts = view.line
          ? k.weight > 1e-9 : k.fit.cost() < found_.best() + settings_.cell_close;
      if (k.view != index || !counts) continue;
      Metric m;
      if (!metric(view, k, m)) continue;
      metrics_.push_back(m);
      if (view.line) break;  // all entries of one line look alike
    }
    if (metrics_.empty()) return;
    for (int s : *view.surfaces) {
      for (const Triangle& t : found_.surfaces()[s].mesh.triangles()) {
        const LinkSurfaces& all = found_.surfaces();
        const Vec3 a = all.to_world(t.a, view.node);
        pieces_.push_back({a, a + all.turn_to_world(t.ab, view.node),
                           a + all.turn_to_world(t.ac, view.node)});
        halve(view, s, all.turn_to_world(t.normal, view.node));
      }
    }
  }

  void halve(const View& view, int surface, const Vec3& normal) {
    while (!pieces_.empty()) {
      const Piece p = pieces_.back();
      pieces_.pop_back();
      const Vec3 centre = (1.0 / 3.0) * (p.a + p.b + p.c);
      int longest = 0;
      double distance = std::numeric_limits<double>::infinity(), excess = 0.0;
      for (const Metric& m : metrics_) {
        const double edges[3] = {m.norm2(p.b - p.a), m.norm2(p.c - p.b), m.norm2(p.a - p.c)};
        const int most = static_cast<int>(std::max_element(edges, edges + 3) - edges);
        const double edge = std::sqrt(edges[most]);
        const double d = std::max(0.0, std::sqrt(m.norm2(centre - m.origin)) - 0.67 * edge);
        distance = std::min(distance, d);
        const double beyond = std::max(0.0, d - settings_.cell_core);
        const double over = edge / (settings_.cell_edge + settings_.cell_growth * beyond);
        if (d < settings_.cell_reach && over > excess) {
          excess = over;
          longest = most;
        }
      }
      if (distance < settings_.cell_core && excess <= 1.0) {
        const double lengths[3] = {norm(p.b - p.a), norm(p.c - p.b), norm(p.a - p.c)};
        longest = static_cast<int>(std::max_element(lengths, lengths + 3) - lengths);
        excess = lengths[longest] / settings_.cell_length;
      }
      if (distance > settings_.cell_reach) continue;
      if (excess > 1.0 && cells_.size() + pieces_.size() < kMost) {
        const Vec3 q[3] = {p.a, p.b, p.c};
        const Vec3 &from = q[longest], &to = q[(longest + 1) % 3], &other = q[(longest + 2) % 3];
        const Vec3 middle = 0.5 * (from + to);
        pieces_.push_back({from, middle, other});
        pieces_.push_back({middle, to, other});
        continue;
      }
      const double area = 0.5 * norm(cross(p.b - p.a, p.c - p.a));
      const bool grasped = found_.surfaces()[surface].graspable;
      const Vec3 place = view.earlier(centre);
      const Fit fit = found_.fitter().fit(view.q, place, normal, grasped);
      const double log_density =
          ForceEvidence(found_.fitter()).at(view.q, place, normal, grasped, fit) - view.width;
      if (std::isfinite(log_density)) {
        cells_.push_back({surface, centre, normal, area, log_density});
        forces_.push_back(fit.force);
      }
    }
  }

  bool metric(const View& view, const Candidate& k, Metric& out) const {
    out.origin = k.point;
    return found_.fitter().place_metric(view.q, view.earlier(k.point), k.fit.force, out.G);
  }

  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (const SurfaceCell& c : cells_) most = std::max(most, c.log_density);
    const double floor = most - settings_.cell_negligible;
    most = -std::numeric_limits<double>::infinity();
    for (std::size_t i = 0; i < cells_.size(); ++i) {
      SurfaceCell& c = cells_[i];
      if (c.log_density > floor && !found_.surfaces()[c.surface].graspable)
        c.log_density += approach(found_.surfaces(), c.centre, forces_[i], settings_);
      most = std::max(most, c.log_density);
    }
    double sum = 0.0;
    for (SurfaceCell& c : cells_) {
      c.log_density -= most;
      sum += c.probability = c.area * std::exp(c.log_density);
    }
    for (SurfaceCell& c : cells_) c.probability /= sum;
    for (SurfaceCell& c : cells_) c.log_density -= std::log(sum);
  }

  const Explanations& found_;
  const PlaceSettings& settings_;
  std::vector<Metric> metrics_;
  std::vector<Piece> pieces_;
  std::vector<SurfaceCell> cells_;
  std::vector<Vec3> forces_;
};

}  // namespace touchline
