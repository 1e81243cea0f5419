// SPDX-License-Identifier: Apache-2.0
// The explanations of one contact on a segment: all entries of the line of force action into all
// its links, the nearest surface where the line misses, and sampled points, improved on the mesh,
// where there is no line. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/hypothesis.hpp"
#include "touchline/measurement.hpp"
#include "touchline/mesh.hpp"

namespace touchline {

// The surface of one link, in the frame of the node that carries it.
struct LinkSurface {
  int node;
  Mesh mesh;
};

struct Candidate {
  int surface = -1;  // index of the link's surface
  Vec3 point, normal;
  Fit fit;
  int view = 0;         // of the bodies looked at
  double weight = 0.0;  // log of the posterior, then the probability
  double along[3] = {};  // covariance of the two tangent coordinates: 00, 01, 11
};

// What the measurements say if the contact is on this body.
struct View {
  int node = -1;
  const std::vector<int>* surfaces = nullptr;
  Quadratic q;
  bool line = false;   // is there a line of force action?
  double floor = 0.0;  // chi2 that no point of the body goes below
  double pitch = 0.0;
  Spatial wrench;      // the pure force that explains best
  bool met = false;    // does its line meet the body, and steeply enough?
  bool steep = false;
  // How far the body has moved since the time that the filtered wrench speaks of: at the world
  // origin, and turned.
  Vec3 shift, turn;
  double width = 0.0;  // log of how much that adds to the spread of the measurements

  Vec3 earlier(const Vec3& point) const { return point - shift - cross(turn, point); }
  // A line of points of that time, as it is carried along.
  ForceLine later(const ForceLine& line) const {
    const Vec3 direction = line.direction + cross(turn, line.direction);
    return {line.origin + shift + cross(turn, line.origin), (1.0 / norm(direction)) * direction};
  }
};

class Explanations {
 public:
  static constexpr double kWindow = 50.0;  // of chi2: beyond it an explanation weighs nothing

  Explanations(const Observer& observer, const Measurement& measurement,
               const LocalizerSettings& settings, std::vector<LinkSurface> surfaces)
      : observer_(observer),
        posture_(measurement.posture()),
        fitter_(settings),
        surfaces_(std::move(surfaces)) {
    for (int g = 0; g < observer.row_layout().segments; ++g) bodies_.push_back(bodies_of(g));
    std::size_t most = 0;
    for (const auto& bodies : bodies_) most = std::max(most, bodies.size());
    views_.resize(most);
    candidates_.resize(kMost);
    for (const LinkSurface& surface : surfaces_) sample(surface);
  }

  Explanations(const Explanations&) = delete;
  Explanations& operator=(const Explanations&) = delete;

  // Finds all that may explain segment g; `measurement` has read it. `lag`: the age of what its
  // wrench speaks of [s].
  void find(int g, double lag, Measurement& measurement) {
    count_ = used_ = 0;
    best_ = std::numeric_limits<double>::infinity();
    for (const Body& body : bodies_[g]) {
      View& view = views_[used_++];
      view = View{};
      view.node = body.node;
      view.surfaces = &body.surfaces;
      view.q = measurement.quadratic(body.node);
      view.shift = lag * posture_.twist(body.node).linear;
      view.turn = lag * posture_.twist(body.node).angular;
      if (measurement.has_wrench()) allow_for_motion(view, measurement.wrench());
      find_line(view);
    }
    std::sort(views_.begin(), views_.begin() + used_,
              [](const View& a, const View& b) { return a.floor < b.floor; });
    for (int i = 0; i < used_ && views_[i].floor < best_ + kWindow; ++i) {
      if (views_[i].line) enter(views_[i]);
    }
    // What must be searched for costs more, so it comes last and only where it may matter.
    for (int i = 0; i < used_ && views_[i].floor < best_ + kRelevant; ++i) {
      View& view = views_[i];
      if (view.line && !view.steep) beside(view);
      if (!measurement.has_wrench()) search(view);
    }
  }

  int count() const { return count_; }
  Candidate* begin() { return candidates_.data(); }
  Candidate* end() { return candidates_.data() + count_; }
  void shrink(int count) { count_ = count; }
  double best() const { return best_; }
  const View& view(const Candidate& k) const { return views_[k.view]; }
  const std::vector<LinkSurface>& surfaces() const { return surfaces_; }
  const ForceFitter& fitter() const { return fitter_; }

  static ForceLine line_of(const Spatial& w) {
    const double size2 = dot(w.linear, w.linear);
    return {(1.0 / size2) * cross(w.linear, w.angular), (1.0 / std::sqrt(size2)) * w.linear};  // (19)
  }
  ForceLine to_node(const ForceLine& line, int node) const {
    const Pose& X = posture_.pose(node);
    return {transposed_times(X.R, line.origin - X.p), transposed_times(X.R, line.direction)};
  }
  Vec3 to_world(const Vec3& p, int node) const {
    const Pose& X = posture_.pose(node);
    return X.R * p + X.p;
  }
  Vec3 to_node(const Vec3& p, int node) const {
    const Pose& X = posture_.pose(node);
    return transposed_times(X.R, p - X.p);
  }

  // Calls `visit(surface, point, normal, t)` for each entry of a line into the links of segment g.
  template <class Visit>
  void entries(int g, const ForceLine& line, Visit&& visit) const {
    for (const Body& body : bodies_[g]) {
      for (int s : body.surfaces) entries_of(s, line, visit);
    }
  }

 private:
  static constexpr int kMost = 192, kSamples = 64, kStarts = 2;
  static constexpr double kRelevant = 25.0;  // of chi2: where a search is worth while
  static constexpr double kRough = 400.0;    // of chi2: where a start may lead to something
  static constexpr double kArrived = 2e-4;   // length of a step [m]
  static constexpr double kFar = 0.15;       // from the line: not what it speaks of [m]
  static constexpr double kUncertainWay = 0.1;  // of the way since then
  static constexpr double kGrazing = 4.0;  // cost of the cone beyond which a point is moved
  static constexpr double kSame = 5e-3;    // points nearer than this are one [m]

  struct Body {
    int node;
    std::vector<int> surfaces;
  };
  struct Sample {
    Vec3 point, normal;
  };

  std::vector<Body> bodies_of(int g) const {
    std::vector<Body> bodies;
    for (std::size_t i = 0; i < surfaces_.size(); ++i) {
      const int node = surfaces_[i].node;
      if (segment_of(node) != g) continue;
      auto found = std::find_if(bodies.begin(), bodies.end(),
                                [node](const Body& b) { return b.node == node; });
      if (found == bodies.end()) {
        bodies.push_back({node, {}});
        found = bodies.end() - 1;
      }
      found->surfaces.push_back(static_cast<int>(i));
    }
    return bodies;
  }

  // Segment of a node; -1 for what cannot be felt.
  int segment_of(int node) const {
    const auto& segments = observer_.layout().segments;
    bool moves = false;
    for (int n = node; n >= 0; n = posture_.nodes()[n].parent) {
      for (std::size_t g = 0; g < segments.size(); ++g) {
        if (segments[g].sensor >= 0 && observer_.sensors()[segments[g].sensor].node == n)
          return static_cast<int>(g);
      }
      moves = moves || posture_.nodes()[n].kind != NodeKind::fixed;
    }
    if (!moves || segments.back().sensor >= 0) return -1;
    return static_cast<int>(segments.size()) - 1;
  }

  // Points spread evenly over a surface.
  void sample(const LinkSurface& surface) {
    samples_.emplace_back();
    const auto& triangles = surface.mesh.triangles();
    double total = 0.0;
    for (const Triangle& t : triangles) total += norm(cross(t.ab, t.ac));
    double passed = 0.0, next = 0.5 * total / kSamples, u = 0.0, v = 0.0;
    for (const Triangle& t : triangles) {
      for (passed += norm(cross(t.ab, t.ac)); next < passed; next += total / kSamples) {
        u = std::fmod(u + 0.7548776662466927, 1.0);
        v = std::fmod(v + 0.5698402909980532, 1.0);
        const bool inside = u + v <= 1.0;
        samples_.back().push_back(
            {t.a + (inside ? u : 1.0 - u) * t.ab + (inside ? v : 1.0 - v) * t.ac, t.normal});
      }
    }
  }

  // The way that the point of contact has come since is known but for a part of it.
  void allow_for_motion(View& view, const double* w) const {
    const double force = std::sqrt(w[0] * w[0] + w[1] * w[1] + w[2] * w[2]);
    const double way = norm(view.shift + cross(view.turn, posture_.pose(view.node).p));
    const double moment = kUncertainWay * way * force;
    if (moment > 1e-6) view.width = loosen(view.q, moment);
  }

  // The most likely wrench among those of one pure force: f . m = 0.
  void find_line(View& view) {
    double L[36], w[6];
    std::copy(view.q.information, view.q.information + 36, L);
    view.line = cholesky(L, 6, 1e-9);
    if (!view.line) return;
    std::copy(view.q.vector, view.q.vector + 6, w);
    solve_cholesky(L, 6, w);
    for (int pass = 0; pass < 3; ++pass) {
      const double g[6] = {w[3], w[4], w[5], w[0], w[1], w[2]};
      double step[6];
      std::copy(g, g + 6, step);
      solve_cholesky(L, 6, step);
      double power = 0.0, variance = 0.0;
      for (int i = 0; i < 3; ++i) power += w[i] * w[3 + i];
      for (int i = 0; i < 6; ++i) variance += g[i] * step[i];
      if (!(variance > 0.0)) break;
      if (pass == 0) view.pitch = power / std::sqrt(variance);
      for (int i = 0; i < 6; ++i) w[i] -= power / variance * step[i];
    }
    view.floor = std::max(0.0, view.q(w));
    view.wrench = {{w[0], w[1], w[2]}, {w[3], w[4], w[5]}};
    view.line = dot(view.wrench.linear, view.wrench.linear) > 1e-12;
  }

  template <class Visit>
  void entries_of(int surface, const ForceLine& line, Visit&& visit) const {
    const int node = surfaces_[surface].node;
    const Mat3& R = posture_.pose(node).R;
    surfaces_[surface].mesh.crossings(to_node(line, node), [&](const Crossing& c) {
      const Vec3 normal = R * c.normal;
      if (dot(normal, line.direction) < 0.0) visit(surface, line.at(c.t), normal, c.t);
    });
  }

  // All entries of the line into the body.
  void enter(View& view) {
    const ForceLine line = view.later(line_of(view.wrench));
    const int before = count_;
    for (int s : *view.surfaces) {
      entries_of(s, line, [&](int surface, const Vec3& point, const Vec3& normal, double) {
        if (count_ == kMost) return;
        Candidate& k = fresh(view, surface);
        k.point = point;
        k.normal = normal;
        k.fit.force = view.wrench.linear;
        fitter_.judge(view.q, view.earlier(point), normal, k.fit);
        view.steep = view.steep || k.fit.cone < kGrazing;
        view.met = true;
        if (!known(before, 1e-7)) keep();  // an edge is met twice
      });
    }
  }

  // The line misses the body or only grazes it: the best points nearby.
  void beside(View& view) {
    if (!view.met) return miss(view);
    const int own = static_cast<int>(&view - views_.data()), found = count_;
    for (int i = 0; i < found && count_ < kMost; ++i) {
      if (candidates_[i].view != own) continue;
      candidates_[count_] = candidates_[i];
      candidates_[i].fit.cone = std::numeric_limits<double>::infinity();  // replaced
      refine(view, candidates_[count_]);
      if (!known(found, kSame)) keep();
    }
  }

  Candidate& fresh(const View& view, int surface) {
    Candidate& k = candidates_[count_];
    k = Candidate{};
    k.surface = surface;
    k.view = static_cast<int>(&view - views_.data());
    return k;
  }

  // Is the candidate at hand one of those from `first` on?
  bool known(int first, double distance) const {
    const Candidate& k = candidates_[count_];
    for (int i = first; i < count_; ++i) {
      if (candidates_[i].surface == k.surface && norm(candidates_[i].point - k.point) < distance)
        return true;
    }
    return false;
  }

  void keep() {
    const double cost = candidates_[count_].fit.cost();
    if (!(cost < best_ + kWindow)) return;
    best_ = std::min(best_, cost);
    if (count_ < kMost) ++count_;
  }

  // The surface nearest to the line, and from there the best explanation nearby.
  void miss(View& view) {
    const ForceLine line = view.later(line_of(view.wrench));
    for (int s : *view.surfaces) {
      const SurfacePoint p = surfaces_[s].mesh.nearest_to_line(to_node(line, view.node), kFar);
      if (p.face < 0 || count_ == kMost) continue;
      // At an edge the normal is that of either side: what counts is the wrench alone.
      if (fitter_.free_chi2(view.q, view.earlier(to_world(p.point, view.node))) > best_ + kRelevant) continue;
      place(view, s, p.point, p.normal);
      refine(view, candidates_[count_]);
      keep();
    }
  }

  void place(const View& view, int surface, const Vec3& point, const Vec3& normal,
             double limit = std::numeric_limits<double>::infinity()) {
    Candidate& k = fresh(view, surface);
    k.point = to_world(point, view.node);
    k.normal = posture_.pose(view.node).R * normal;
    k.fit = fitter_.fit(view.q, view.earlier(k.point), k.normal, limit);
  }

  // Without a line: the best of the points spread over each link, each improved.
  void search(View& view) {
    for (int s : *view.surfaces) {
      Candidate starts[kStarts];
      int found = 0;
      for (const Sample& sample : samples_[s]) {
        if (count_ == kMost) return;
        place(view, s, sample.point, sample.normal, best_ + kRough);
        if (candidates_[count_].fit.cost() < best_ + kRough)
          found = insert(starts, found, candidates_[count_]);
      }
      for (int i = 0; i < found && count_ < kMost; ++i) {
        candidates_[count_] = starts[i];
        refine(view, candidates_[count_]);
        if (!known(0, kSame)) keep();
      }
    }
  }

  // Keeps the best few, apart from each other.
  static int insert(Candidate* starts, int found, const Candidate& k) {
    constexpr double apart = 0.04;
    for (int i = 0; i < found; ++i) {
      if (norm(starts[i].point - k.point) < apart) {
        if (k.fit.cost() < starts[i].fit.cost()) starts[i] = k;
        return found;
      }
    }
    if (found < kStarts) {
      starts[found] = k;
      return found + 1;
    }
    auto worst = std::max_element(starts, starts + found, [](const Candidate& a, const Candidate& b) {
      return a.fit.cost() < b.fit.cost();
    });
    if (k.fit.cost() < worst->fit.cost()) *worst = k;
    return found;
  }

  // Moves over the surface downhill: Gauss-Newton steps, then, where the friction cone or an edge
  // stands in the way, smaller and smaller trials around.
  void refine(const View& view, Candidate& k) {
    bool arrived = false;
    for (int i = 0; i < 8 && !arrived; ++i) {
      double H[25], g[5];
      fitter_.information(view.q, view.earlier(k.point), k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) break;
      solve_cholesky(H, 5, g);
      Vec3 s, t;
      tangents(k.normal, s, t);
      Vec3 step = g[3] * s + g[4] * t;
      const double length = norm(step);
      if (length > 0.05) step = (0.05 / length) * step;
      arrived = length < kArrived;
      if (!arrived && !try_point(view, k, k.point + step)) break;
    }
    if (arrived && k.fit.cone < 1.0) return;
    for (double radius = 0.032; radius > 1e-3; radius *= 0.5) {
      for (int round = 0; round < 3 && better_around(view, k, radius); ++round) {
      }
    }
  }

  bool better_around(const View& view, Candidate& k, double radius) {
    Vec3 s, t;
    tangents(k.normal, s, t);
    const Vec3 centre = k.point;
    bool better = false;
    for (int i = 0; i < 6; ++i) {
      const double a = 1.0471975511965976 * i;
      better |= try_point(view, k, centre + radius * (std::cos(a) * s + std::sin(a) * t));
    }
    return better;
  }

  bool try_point(const View& view, Candidate& k, const Vec3& target) {
    const Pose& X = posture_.pose(view.node);
    const SurfacePoint p =
        surfaces_[k.surface].mesh.nearest_to_point(transposed_times(X.R, target - X.p), 0.06);
    if (p.face < 0) return false;
    const Vec3 point = to_world(p.point, view.node), normal = X.R * p.normal;
    const Fit fit = fitter_.fit(view.q, view.earlier(point), normal);
    if (!(fit.cost() < k.fit.cost() - 1e-6)) return false;
    k.point = point;
    k.normal = normal;
    k.fit = fit;
    return true;
  }

  const Observer& observer_;
  const Posture& posture_;
  ForceFitter fitter_;
  std::vector<LinkSurface> surfaces_;
  std::vector<std::vector<Body>> bodies_;     // per segment
  std::vector<std::vector<Sample>> samples_;  // per surface
  std::vector<View> views_;
  std::vector<Candidate> candidates_;
  int used_ = 0, count_ = 0;
  double best_ = 0.0;
};

}  // namespace touchline
