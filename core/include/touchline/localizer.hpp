// SPDX-License-Identifier: Apache-2.0
// Where a segment is touched: all entries of the line of force action into all its links, the
// nearest surface where the line misses, sampled points where there is no line; each weighed by
// its posterior given the wrench, the joint rows and their covariance. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "touchline/hypothesis.hpp"
#include "touchline/measurement.hpp"
#include "touchline/mesh.hpp"

namespace touchline {

enum class Status { none = 0, located = 1, ambiguous = 2, not_separable = 3, wrench_only = 4 };

// The surface of one link, in the frame of the node that carries it.
struct LinkSurface {
  int node;
  Mesh mesh;
};

struct Candidate {
  int surface = -1;  // index of the link's surface
  Vec3 point, normal;
  Fit fit;
  int view = 0;         // of the localizer's bodies
  double weight = 0.0;  // log of the posterior, then the probability
};

struct Answer {
  Status status = Status::none;
  int count = 0;            // of candidates, best first
  double body_probability = 0.0;
  Vec3 point, force;
  double covariance[9] = {};  // of the point
  double pitch = 0.0;         // in standard deviations
  double chi2 = 0.0;
  int degrees = 0;            // of freedom of chi2
  static constexpr int kCandidates = 8;
  Candidate candidates[kCandidates];
};

class Localizer {
 public:
  Localizer(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise,
            std::vector<LinkSurface> surfaces, LocalizerSettings settings)
      : observer_(observer),
        settings_(settings),
        fitter_(settings_),
        measurement_(observer, std::move(tests), std::move(noise)),
        surfaces_(std::move(surfaces)) {
    for (int g = 0; g < observer.row_layout().segments; ++g) bodies_.push_back(bodies_of(g));
    std::size_t most = 0;
    for (const auto& bodies : bodies_) most = std::max(most, bodies.size());
    views_.resize(most);
    candidates_.resize(kMost);
    for (std::size_t i = 0; i < surfaces_.size(); ++i) sample(surfaces_[i]);
  }

  Localizer(const Localizer&) = delete;
  Localizer& operator=(const Localizer&) = delete;

  const std::vector<LinkSurface>& surfaces() const { return surfaces_; }
  const Tree& tree() const { return measurement_.tree(); }

  // Sizes of what the methods below take.
  std::size_t joints() const { return observer_.row_layout().joints; }
  std::size_t segments() const { return observer_.row_layout().segments; }
  std::size_t tests() const { return measurement_.tests(); }
  std::size_t width() const { return observer_.row_layout().width(); }

  // Throws unless arrays of these sizes belong to this robot.
  void expect(int segment, std::size_t row, std::size_t normalized, std::size_t q,
              std::size_t qd) const {
    if (segment < 0 || static_cast<std::size_t>(segment) >= segments())
      throw std::invalid_argument("there is no such segment");
    if (row != width() || normalized != tests() || q != joints() || qd != joints())
      throw std::invalid_argument("an array has a size that does not belong to this robot");
  }

  // Covariance (6, 6) of a segment's wrench; false where it has none.
  bool wrench_covariance(int g, const double* row, double* out) {
    if (!measurement_.read(g, row, nullptr) || !measurement_.has_wrench()) return false;
    measurement_.wrench_covariance(out);
    return true;
  }

  // The configuration of the sample; `qd` may be null.
  void set_state(const double* q, const double* qd) { measurement_.set_state(q, qd); }

  // The contact on segment g, from the observer's row and the detector's normalized rows (or null).
  const Answer& locate(int g, const double* row, const double* normalized) {
    answer_.status = Status::none;
    answer_.count = 0;
    count_ = 0;
    if (!measurement_.read(g, row, normalized)) return answer_;
    if (settings_.first_entry) return first_entry(g);
    if (measurement_.has_wrench() && weak()) {
      answer_.status = Status::wrench_only;
      return answer_;
    }
    view_bodies(g);
    gather();
    weigh();
    conclude(g);
    return answer_;
  }

 private:
  static constexpr int kMost = 192, kSamples = 128, kStarts = 3;
  static constexpr double kWindow = 50.0;  // of chi2: beyond it an explanation weighs nothing

  struct Body {
    int node;
    std::vector<int> surfaces;
  };
  // What the measurements say if the contact is on this body.
  struct View {
    const Body* body = nullptr;
    Quadratic q;
    bool line = false;        // is there a line of force action?
    double floor = 0.0;       // chi2 that no point of the body goes below
    double pitch = 0.0;
    Spatial wrench;           // the pure force that explains best
    bool hit = false;
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
    for (int n = node; n >= 0; n = tree().nodes()[n].parent) {
      for (std::size_t g = 0; g < segments.size(); ++g) {
        if (segments[g].sensor >= 0 && observer_.sensors()[segments[g].sensor].node == n)
          return static_cast<int>(g);
      }
      moves = moves || tree().nodes()[n].kind != NodeKind::fixed;
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

  bool weak() {
    double C[36];
    measurement_.wrench_covariance(C);
    const double* w = measurement_.wrench();
    const double variance = C[0] + C[7] + C[14];
    const double size2 = w[0] * w[0] + w[1] * w[1] + w[2] * w[2];
    return size2 < settings_.least_force * settings_.least_force || size2 < 16.0 * variance;
  }

  void view_bodies(int g) {
    used_ = 0;
    for (const Body& body : bodies_[g]) {
      View& view = views_[used_++];
      view = View{};
      view.body = &body;
      view.q = measurement_.quadratic(body.node);
      find_line(view);
    }
    std::sort(views_.begin(), views_.begin() + used_,
              [](const View& a, const View& b) { return a.floor < b.floor; });
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

  static Line line_of(const Spatial& w) {
    const double size2 = dot(w.linear, w.linear);
    return {(1.0 / size2) * cross(w.linear, w.angular), (1.0 / std::sqrt(size2)) * w.linear};  // (19)
  }

  Line to_node(const Line& line, int node) const {
    const Pose& X = tree().state(node).pose;
    return {transposed_times(X.R, line.origin - X.p), transposed_times(X.R, line.direction)};
  }
  Vec3 to_world(const Vec3& p, int node) const {
    const Pose& X = tree().state(node).pose;
    return X.R * p + X.p;
  }

  void gather() {
    best_ = std::numeric_limits<double>::infinity();
    for (int i = 0; i < used_; ++i) {
      if (views_[i].line && views_[i].floor < best_ + kWindow) enter(views_[i]);
    }
    for (int i = 0; i < used_; ++i) {
      View& view = views_[i];
      if (view.hit || view.floor >= best_ + kWindow) continue;
      if (view.line) miss(view);
      if (!measurement_.has_wrench()) search(view);
    }
  }

  // All entries of the line into the body.
  void enter(View& view) {
    const Line line = line_of(view.wrench);
    for (int s : view.body->surfaces) {
      const int node = view.body->node, before = count_;
      const Pose& X = tree().state(node).pose;
      surfaces_[s].mesh.crossings(to_node(line, node), [&](const Crossing& c) {
        const Vec3 normal = X.R * c.normal;
        if (dot(normal, line.direction) >= 0.0 || count_ == kMost) return;
        Candidate& k = candidates_[count_];
        k.surface = s;
        k.point = line.at(c.t);
        for (int i = before; i < count_; ++i) {  // an edge is met twice
          if (norm(candidates_[i].point - k.point) < 1e-7) return;
        }
        k.normal = normal;
        k.fit.force = view.wrench.linear;
        fitter_.judge(view.q, k.point, normal, k.fit);
        k.view = static_cast<int>(&view - views_.data());
        if (k.fit.cone < 4.0) view.hit = true;
        if (std::isfinite(k.fit.cone)) keep();
      });
    }
  }

  void keep() {
    best_ = std::min(best_, candidates_[count_].fit.cost());
    if (count_ < kMost) ++count_;
  }

  // The surface nearest to the line, and from there the best explanation nearby.
  void miss(View& view) {
    const Line line = line_of(view.wrench);
    for (int s : view.body->surfaces) {
      const SurfacePoint p = surfaces_[s].mesh.nearest_to_line(to_node(line, view.body->node));
      if (p.face < 0 || count_ == kMost) continue;
      place(view, s, p);
      Candidate& k = candidates_[count_];
      if (k.fit.chi2 > best_ + kWindow) continue;
      refine(view, k);
      if (k.fit.cost() < best_ + kWindow) keep();
    }
  }

  void place(const View& view, int surface, const SurfacePoint& p) {
    Candidate& k = candidates_[count_];
    k.surface = surface;
    k.point = to_world(p.point, view.body->node);
    k.normal = tree().state(view.body->node).pose.R * p.normal;
    k.fit = fitter_.fit(view.q, k.point, k.normal);
    k.view = static_cast<int>(&view - views_.data());
  }

  // Without a line: the best of the points spread over each link, each improved.
  void search(View& view) {
    for (int s : view.body->surfaces) {
      Candidate starts[kStarts];
      int found = 0;
      for (const Sample& sample : samples_[s]) {
        if (count_ == kMost) return;
        place(view, s, {0.0, 0, sample.point, sample.normal});
        found = insert(starts, found, candidates_[count_]);
      }
      for (int i = 0; i < found && count_ < kMost; ++i) {
        candidates_[count_] = starts[i];
        refine(view, candidates_[count_]);
        if (candidates_[count_].fit.cost() < best_ + kWindow && !known(s)) keep();
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

  bool known(int surface) const {
    for (int i = 0; i < count_; ++i) {
      if (candidates_[i].surface == surface &&
          norm(candidates_[i].point - candidates_[count_].point) < 5e-3)
        return true;
    }
    return false;
  }

  // Moves over the surface downhill: Gauss-Newton steps, then smaller and smaller trials around.
  void refine(const View& view, Candidate& k) {
    for (int i = 0; i < 6; ++i) {
      double H[25], g[5];
      fitter_.information(view.q, k.point, k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) break;
      solve_cholesky(H, 5, g);
      Vec3 s, t;
      tangents(k.normal, s, t);
      Vec3 step = g[3] * s + g[4] * t;
      const double length = norm(step);
      if (length < 1e-5) break;
      if (length > 0.03) step = (0.03 / length) * step;
      if (!try_point(view, k, k.point + step)) break;
    }
    for (double radius = 0.016; radius > 1e-3; radius *= 0.5) {
      for (int round = 0; round < 4 && better_around(view, k, radius); ++round) {
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
    const Pose& X = tree().state(view.body->node).pose;
    const SurfacePoint p =
        surfaces_[k.surface].mesh.nearest_to_point(transposed_times(X.R, target - X.p), 0.05);
    if (p.face < 0) return false;
    const Vec3 point = to_world(p.point, view.body->node), normal = X.R * p.normal;
    const Fit fit = fitter_.fit(view.q, point, normal);
    if (!(fit.cost() < k.fit.cost() - 1e-6)) return false;
    k.point = point;
    k.normal = normal;
    k.fit = fit;
    return true;
  }

  // Log posterior of each candidate: likelihood, the volume of force and surface that explains as
  // well (Laplace), and how a push comes there.
  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (int i = 0; i < count_; ++i) {
      Candidate& k = candidates_[i];
      const View& view = views_[k.view];
      k.weight = -std::numeric_limits<double>::infinity();
      if (k.fit.cost() > best_ + kWindow) continue;
      double H[25], g[5];
      fitter_.information(view.q, k.point, k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) continue;
      k.weight = -0.5 * k.fit.cost() - 0.5 * log_determinant(H, 5) +
                 std::log(std::max(k.fit.cosine, 0.02)) + reachable(k);
      most = std::max(most, k.weight);
    }
    double sum = 0.0;
    for (int i = 0; i < count_; ++i) {
      candidates_[i].weight = std::exp(candidates_[i].weight - most);
      sum += candidates_[i].weight;
    }
    for (int i = 0; i < count_; ++i) candidates_[i].weight /= sum;
  }

  // Log of the plausibility that a push arrives at a point along its force: not from inside
  // another link, and hardly through a narrow gap.
  double reachable(const Candidate& k) const {
    const double size = norm(k.fit.force);
    if (size == 0.0) return 0.0;
    const Line line{k.point, (1.0 / size) * k.fit.force};
    double nearest = -std::numeric_limits<double>::infinity();
    bool inside = false;
    for (const LinkSurface& surface : surfaces_) {
      surface.mesh.crossings(to_node(line, surface.node), [&](const Crossing& c) {
        if (c.t > -1e-6 || c.t <= nearest) return;
        nearest = c.t;
        inside = dot(tree().state(surface.node).pose.R * c.normal, line.direction) < 0.0;
      });
    }
    if (inside) return std::max(-6.0, nearest / 3e-3);
    return std::log(std::clamp(-nearest / settings_.finger, 0.05, 1.0));
  }

  void conclude(int g) {
    std::sort(candidates_.begin(), candidates_.begin() + count_,
              [](const Candidate& a, const Candidate& b) { return a.weight > b.weight; });
    if (count_ == 0 || !(candidates_[0].weight > 0.0)) {
      answer_.status = unexplained(g);
      return;
    }
    lead_with_best_body();
    const Candidate& best = candidates_[0];
    answer_.count = std::min<int>(count_, Answer::kCandidates);
    std::copy(candidates_.begin(), candidates_.begin() + answer_.count, answer_.candidates);
    answer_.point = best.point;
    answer_.force = best.fit.force;
    const View& view = views_[best.view];
    answer_.pitch = view.pitch;
    answer_.chi2 = best.fit.chi2;
    answer_.degrees = std::max(1, measurement_.size() - 5);
    const double spread = spread_of(view, best);
    const double cone = fitter_.cone_cost(best.fit.cosine);
    if (std::fabs(view.pitch) > settings_.pitch_limit || cone > 16.0 ||
        best.fit.chi2 > chi2_limit(answer_.degrees, settings_.pitch_limit)) {
      answer_.status = unexplained(g);
    } else {
      answer_.status = certain(spread) ? Status::located : Status::ambiguous;
    }
  }

  // A tool or a handle may be loaded by a moment: then its wrench is the answer.
  Status unexplained(int g) const {
    const Segment& segment = observer_.layout().segments[g];
    const bool end = segment.sensor >= 0 && segment.successors.empty();
    return end && measurement_.has_wrench() && measurement_.scalars() == 0
               ? Status::wrench_only
               : Status::not_separable;
  }

  void lead_with_best_body() {
    double most = 0.0;
    int first = 0;
    for (int i = 0; i < count_ && candidates_[i].weight > 0.0; ++i) {
      double sum = 0.0;
      for (int j = 0; j < count_; ++j) {
        if (surfaces_[candidates_[j].surface].node == surfaces_[candidates_[i].surface].node)
          sum += candidates_[j].weight;
      }
      if (sum > most + 1e-12) {
        most = sum;
        first = i;
      }
    }
    answer_.body_probability = std::min(most, 1.0);
    std::rotate(candidates_.begin(), candidates_.begin() + first, candidates_.begin() + first + 1);
  }

  // Is nearly all of the probability at one place?
  bool certain(double spread) const {
    if (spread > 4.0 * settings_.place_radius) return false;
    double here = 0.0;
    for (int i = 0; i < count_; ++i) {
      const Vec3 d = candidates_[i].point - candidates_[0].point;
      if (norm(d) < settings_.place_radius) here += candidates_[i].weight;
    }
    return here >= settings_.certain;
  }

  // Covariance of the point along its surface; returns the root of the trace.
  double spread_of(const View& view, const Candidate& k) {
    double H[25], g[5];
    fitter_.information(view.q, k.point, k.normal, k.fit.force, H, g);
    std::fill(answer_.covariance, answer_.covariance + 9, 0.0);
    if (!cholesky(H, 5)) return std::numeric_limits<double>::infinity();
    Vec3 along[2];
    tangents(k.normal, along[0], along[1]);
    double trace = 0.0;
    for (int a = 0; a < 2; ++a) {
      double e[5] = {0, 0, 0, a == 0 ? 1.0 : 0.0, a == 1 ? 1.0 : 0.0};
      solve_cholesky(H, 5, e);
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) {
          for (int b = 0; b < 2; ++b)
            answer_.covariance[3 * i + j] +=
                component(along[a], i) * e[3 + b] * component(along[b], j);
        }
      }
      trace += e[3 + a];
    }
    return std::sqrt(trace);
  }

  // Beyond it lies as much of chi2 as of a normal variable beyond `sigmas` (Wilson-Hilferty).
  static double chi2_limit(int degrees, double sigmas) {
    const double n = degrees, c = 2.0 / (9.0 * n);
    return n * std::pow(1.0 - c + sigmas * std::sqrt(c), 3);
  }

  // The paper's rule: along the line of the segment's wrench, the first entry into any link.
  const Answer& first_entry(int g) {
    if (!measurement_.has_wrench()) return answer_;
    answer_.status = Status::wrench_only;
    const double* w = measurement_.wrench();
    const Spatial wrench{{w[0], w[1], w[2]}, {w[3], w[4], w[5]}};
    const double size = norm(wrench.linear);
    if (size < 1e-9) return answer_;
    const Line line = line_of(wrench);
    double first = std::numeric_limits<double>::infinity();
    Candidate& k = answer_.candidates[0];
    for (const Body& body : bodies_[g]) {
      for (int s : body.surfaces) {
        surfaces_[s].mesh.crossings(to_node(line, body.node), [&](const Crossing& c) {
          const Vec3 normal = tree().state(body.node).pose.R * c.normal;
          if (c.t >= first || dot(normal, line.direction) >= 0.0) return;
          first = c.t;
          k.surface = s;
          k.point = line.at(c.t);
          k.normal = normal;
        });
      }
    }
    if (!std::isfinite(first)) return answer_;
    k.fit.force = wrench.linear;
    k.weight = answer_.body_probability = 1.0;
    answer_.count = 1;
    answer_.status = Status::located;
    answer_.point = k.point;
    answer_.force = wrench.linear;
    std::fill(answer_.covariance, answer_.covariance + 9, std::nan(""));
    return answer_;
  }

  const Observer& observer_;
  LocalizerSettings settings_;
  ForceFitter fitter_;
  Measurement measurement_;
  std::vector<LinkSurface> surfaces_;
  std::vector<std::vector<Body>> bodies_;  // per segment
  std::vector<std::vector<Sample>> samples_;  // per surface
  std::vector<View> views_;
  std::vector<Candidate> candidates_;
  Answer answer_;
  int used_ = 0, count_ = 0;
  double best_ = 0.0;
};

}  // namespace touchline
