// SPDX-License-Identifier: Apache-2.0
// Where a segment is touched: each explanation weighed by its posterior given the wrench, the joint
// rows and their covariance; and where an event is, from all its samples. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "touchline/event_place.hpp"
#include "touchline/explanations.hpp"

namespace touchline {

enum class Status { none = 0, located = 1, ambiguous = 2, not_separable = 3, wrench_only = 4 };

struct Answer {
  static constexpr int kCandidates = 8;
  Status status = Status::none;
  int count = 0;                      // of candidates
  Candidate candidates[kCandidates];  // the most probable body's best first
  double body_probability = 0.0;
  Vec3 force;
  double covariance[9] = {};  // of the first candidate's point
  double spread = 0.0;        // root of its trace
  double pitch = 0.0;         // in standard deviations
  double chi2 = 0.0;
  int degrees = 0;  // of freedom of chi2
};

class Localizer {
 public:
  Localizer(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise,
            std::vector<LinkSurface> surfaces, LocalizerSettings settings)
      : observer_(observer),
        settings_(settings),
        period_(noise.period),
        measurement_(observer, std::move(tests), std::move(noise)),
        found_(observer, measurement_, settings_, std::move(surfaces)),
        following_(observer.row_layout().segments) {
    for (Following& f : following_) f.q.resize(observer.row_layout().joints, kNaN);
  }

  Localizer(const Localizer&) = delete;
  Localizer& operator=(const Localizer&) = delete;

  const std::vector<LinkSurface>& surfaces() const { return found_.surfaces(); }
  const Measurement& measurement() const { return measurement_; }

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

  // The configuration of the sample; `qd` may be null.
  void set_state(const double* q, const double* qd) { measurement_.set_state(q, qd); }

  // Covariance (6, 6) of a segment's wrench; false where it has none.
  bool wrench_covariance(int g, const double* row, double* out) {
    if (!measurement_.read(g, row, nullptr) || !measurement_.has_wrench()) return false;
    measurement_.wrench_covariance(out);
    return true;
  }

  // The contact on segment g, from the observer's row and the detector's normalized rows (or null).
  // A wrench that has been steady for a while is as old as its filter, 1 / K.
  const Answer& locate(int g, const double* row, const double* normalized) {
    return locate(g, row, normalized, steady_lag(g));
  }

  // The same within an event. What a filtered wrench w speaks of is older by
  //   int K exp(-K a) a w(t - a) da / int K exp(-K a) w(t - a) da,
  // so that a second filter in series tells its age, also while the force grows.
  const Answer& locate_next(int g, const double* row, const double* normalized, double time) {
    Following& f = following_[g];
    const double* w = row + observer_.row_layout().segment_wrench() + 6 * g;
    const Vec3 force{w[0], w[1], w[2]};
    const double size2 = dot(force, force);
    if (!(size2 > 0.0)) return locate(g, row, normalized, 0.0);
    const double keep = std::exp(-bandwidth(g) * std::max(0.0, time - f.time));
    f.twice = keep * f.twice + (1.0 - keep) * force;
    f.time = time;
    const double age = std::clamp(dot(f.twice, force) / size2, 0.0, 2.0);
    return locate(g, row, normalized, age * steady_lag(g));
  }

  const Answer& locate(int g, const double* row, const double* normalized, double lag) {
    answer_.status = Status::none;
    answer_.count = 0;
    answer_.force = {kNaN, kNaN, kNaN};
    if (!measurement_.read(g, row, normalized)) return answer_;
    if (measurement_.has_wrench()) {
      const double* w = measurement_.wrench();
      answer_.force = {w[0], w[1], w[2]};
    }
    if (settings_.first_entry) {
      first_entry(g);
    } else if (measurement_.has_wrench() && weak()) {
      answer_.status = Status::wrench_only;
    } else {
      found_.find(g, lag, measurement_);
      weigh();
      conclude(g);
    }
    return answer_;
  }

  // Notes whether segment g is touched; true when its event has just ended.
  bool enter(int g, bool touched, double time) {
    Following& f = following_[g];
    if (touched && !f.touched) {
      f.event.restart();
      f.twice = {};
      f.time = time;
    }
    const bool ended = f.touched && !touched;
    f.touched = touched;
    return ended;
  }

  // Adds the answer at hand to the event on segment g, at `time` [s] and joint positions `q`.
  void remember(int g, const double* normalized, double time, const double* q) {
    Following& f = following_[g];
    const double strength = measurement_.strength(g, normalized);
    if (!f.event.begin_sample(strength, time, 0.5 * period_ * bandwidth(g))) return;
    std::copy(q, q + f.q.size(), f.q.begin());
    const bool explained =
        answer_.status == Status::located || answer_.status == Status::ambiguous;
    if (!f.event.open(static_cast<int>(answer_.status), explained)) return;
    for (int i = 0; i < answer_.count; ++i) {
      const Candidate& k = answer_.candidates[i];
      f.event.add(k.surface, found_.to_node(k.point, node_of(k)), k.weight,
                  k.along[0] + k.along[2], settings_.place_radius);
    }
    f.event.close(explained ? answer_.spread * answer_.spread : kNaN);
  }

  // The event on segment g with its places weighed, those of the most probable body first.
  EventPlace& conclude_event(int g) {
    following_[g].event.conclude([this](int surface) { return surfaces()[surface].node; });
    return following_[g].event;
  }
  // Joint positions at the time of the event's position.
  const std::vector<double>& event_q(int g) const { return following_[g].q; }

  Status event_status(int g) const {
    const EventPlace& event = following_[g].event;
    if (event.count() == 0 || event.mostly_unexplained())
      return static_cast<Status>(event.frequent(3, 4));
    double here = 0.0;
    for (int i = 0; i < event.count(); ++i) {
      const Place &a = event.place(0), &b = event.place(i);
      if (a.surface == b.surface && norm(a.point - b.point) < settings_.place_radius)
        here += b.share;
    }
    const bool sharp = event.variance() < spread_limit() * spread_limit();
    return here >= settings_.certain && sharp ? Status::located : Status::ambiguous;
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kNegligible = 10.0;  // of the log posterior, below the best

  struct Following {
    EventPlace event;
    bool touched = false;
    std::vector<double> q;  // at the time of the event's position
    Vec3 twice;             // the force, filtered twice
    double time = 0.0;      // of the last sample
  };

  double steady_lag(int g) const {
    return observer_.layout().segments[g].sensor >= 0 ? 1.0 / bandwidth(g) : 0.0;
  }

  double bandwidth(int g) const {
    const int sensor = observer_.layout().segments[g].sensor;
    if (sensor >= 0) return observer_.sensors()[sensor].bandwidth;
    double least = std::numeric_limits<double>::infinity();
    for (const JointRow& joint : observer_.joints()) least = std::min(least, joint.bandwidth);
    return least;
  }

  // Too small a force to draw a line.
  bool weak() const {
    double C[36];
    measurement_.wrench_covariance(C);
    const double size2 = dot(answer_.force, answer_.force);
    return size2 < settings_.least_force * settings_.least_force ||
           size2 < 16.0 * (C[0] + C[7] + C[14]);
  }

  // Posterior of each candidate: likelihood, the volume of force and surface that explains as well
  // (Laplace), and how a push comes there.
  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (Candidate& k : found_) {
      k.weight = -std::numeric_limits<double>::infinity();
      if (!(k.fit.cost() < found_.best() + Explanations::kWindow)) continue;
      double H[25], g[5];
      const View& view = found_.view(k);
      found_.fitter().information(view.q, view.earlier(k.point), k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) continue;
      k.weight = -0.5 * (k.fit.cost() + log_determinant(H, 5)) +
                 std::log(std::max(k.fit.cosine, 0.02)) - view.width;
      most = std::max(most, k.weight);
      covariance_along(H, k.along);
    }
    double reached = -std::numeric_limits<double>::infinity();
    for (Candidate& k : found_) {
      if (k.weight < most - kNegligible) {
        k.weight = -std::numeric_limits<double>::infinity();
      } else {
        k.weight += reachable(k);
      }
      reached = std::max(reached, k.weight);
    }
    double sum = 0.0;
    for (Candidate& k : found_) sum += k.weight = std::exp(k.weight - reached);
    for (Candidate& k : found_) k.weight /= sum;
  }

  // The last two by two of (L L^T)^-1.
  static void covariance_along(const double* L, double* out) {
    const double a = 1.0 / L[18], b = 1.0 / L[24], c = -L[23] * a * b;
    out[0] = a * a + c * c;
    out[1] = c * b;
    out[2] = b * b;
  }

  // Log of the plausibility that a push arrives at a point along its force: not from inside
  // another link, and hardly through a narrow gap.
  double reachable(const Candidate& k) const {
    const double size = norm(k.fit.force);
    if (size == 0.0) return 0.0;
    const ForceLine line{k.point, (1.0 / size) * k.fit.force};
    double nearest = -std::numeric_limits<double>::infinity();
    bool inside = false;
    for (const LinkSurface& surface : surfaces()) {
      const ForceLine local = found_.to_node(line, surface.node);
      surface.mesh.crossings(local, [&](const Crossing& c) {
        if (c.t > -1e-6 || c.t <= nearest) return;
        nearest = c.t;
        inside = dot(c.normal, local.direction) < 0.0;
      });
    }
    if (inside) return std::max(-6.0, nearest / 3e-3);
    return 2.0 * std::log(std::clamp(-nearest / settings_.finger, 0.1, 1.0));
  }

  void conclude(int g) {
    std::sort(found_.begin(), found_.end(),
              [](const Candidate& a, const Candidate& b) { return a.weight > b.weight; });
    if (found_.count() == 0 || !(found_.begin()->weight > 0.0)) {
      answer_.status = unexplained(g);
      return;
    }
    lead_with_best_body();
    const Candidate& best = *found_.begin();
    const View& view = found_.view(best);
    answer_.pitch = view.pitch;
    answer_.chi2 = best.fit.chi2;
    answer_.degrees = std::max(1, measurement_.size() - 5);
    spread_over_surface(best);
    copy_candidates();
    if (std::fabs(view.pitch) > settings_.pitch_limit ||
        found_.fitter().cone_cost(best.fit.cosine) > 16.0 ||
        best.fit.chi2 > chi2_limit(answer_.degrees, settings_.pitch_limit)) {
      answer_.status = unexplained(g);
    } else {
      answer_.force = best.fit.force;
      answer_.status = certain() ? Status::located : Status::ambiguous;
    }
  }

  void copy_candidates() {
    answer_.count = 0;
    for (const Candidate& k : found_) {
      if (answer_.count < Answer::kCandidates && (answer_.count == 0 || k.weight > 1e-3))
        answer_.candidates[answer_.count++] = k;
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

  int node_of(const Candidate& k) const { return surfaces()[k.surface].node; }

  void lead_with_best_body() {
    double most = 0.0;
    Candidate* first = found_.begin();
    for (Candidate& a : found_) {
      double sum = 0.0;
      for (const Candidate& b : found_) sum += node_of(a) == node_of(b) ? b.weight : 0.0;
      if (sum > most + 1e-12) {
        most = sum;
        first = &a;
      }
    }
    answer_.body_probability = std::min(most, 1.0);
    std::rotate(found_.begin(), first, first + 1);
  }

  double spread_limit() const { return 4.0 * settings_.place_radius; }

  // Is nearly all of the probability at one place?
  bool certain() {
    if (answer_.spread > spread_limit()) return false;
    double here = 0.0;
    for (const Candidate& k : found_) {
      if (norm(k.point - found_.begin()->point) < settings_.place_radius) here += k.weight;
    }
    return here >= settings_.certain;
  }

  // Covariance of the point, which stays on its surface.
  void spread_over_surface(const Candidate& k) {
    Vec3 s, t;
    tangents(k.normal, s, t);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const double si = component(s, i), sj = component(s, j);
        const double ti = component(t, i), tj = component(t, j);
        answer_.covariance[3 * i + j] =
            k.along[0] * si * sj + k.along[1] * (si * tj + ti * sj) + k.along[2] * ti * tj;
      }
    }
    answer_.spread = std::sqrt(k.along[0] + k.along[2]);
  }

  // Beyond it lies as much of chi2 as of a normal variable beyond `sigmas` (Wilson-Hilferty).
  static double chi2_limit(int degrees, double sigmas) {
    const double n = degrees, c = 2.0 / (9.0 * n);
    return n * std::pow(1.0 - c + sigmas * std::sqrt(c), 3);
  }

  // The paper's rule: along the line of the segment's wrench, the first entry into any link.
  void first_entry(int g) {
    if (!measurement_.has_wrench()) return;
    answer_.status = Status::wrench_only;
    const double* w = measurement_.wrench();
    const Spatial wrench{answer_.force, {w[3], w[4], w[5]}};
    if (norm(wrench.linear) < 1e-9) return;
    double first = std::numeric_limits<double>::infinity();
    Candidate& k = answer_.candidates[0];
    k = Candidate{};
    found_.entries(g, Explanations::line_of(wrench),
                   [&](int surface, const Vec3& point, const Vec3& normal, double t) {
                     if (t >= first) return;
                     first = t;
                     k.surface = surface;
                     k.point = point;
                     k.normal = normal;
                   });
    if (!std::isfinite(first)) return;
    k.weight = answer_.body_probability = 1.0;
    answer_.count = 1;
    answer_.status = Status::located;
    answer_.spread = answer_.pitch = answer_.chi2 = kNaN;
    answer_.degrees = 0;
    std::fill(answer_.covariance, answer_.covariance + 9, kNaN);
  }

  const Observer& observer_;
  LocalizerSettings settings_;
  double period_;
  Measurement measurement_;
  Explanations found_;
  std::vector<Following> following_;  // per segment
  Answer answer_;
};

}  // namespace touchline
