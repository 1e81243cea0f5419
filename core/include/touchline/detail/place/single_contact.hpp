// SPDX-License-Identifier: Apache-2.0
// One contact on a segment: each explanation weighed by its posterior given the measurement, and the
// answer that follows. No allocation per sample.
// Theory: docs/theory.md, section 5.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/place/answer.hpp"
#include "touchline/detail/place/body_share.hpp"
#include "touchline/detail/place/approach.hpp"
#include "touchline/detail/place/credible_region.hpp"
#include "touchline/detail/place/explanations.hpp"

namespace touchline {

class SingleContact {
 public:
  SingleContact(const Observer& observer, const Posture& posture, const PlaceSettings& settings,
                std::vector<LinkSurface> surfaces)
      : observer_(observer),
        posture_(posture),
        settings_(settings),
        found_(observer, posture, settings, std::move(surfaces)),
        lasting_(observer.row_layout().segments, 0.0) {}

  // Searches for contacts on segment g begin anew.
  void forget(int g) { found_.forget(g); }
  // Units of work that the last search took.
  int units() const { return found_.units(); }

  // The contact on segment g, which `measurement` has read; its wrench is `lag` [s] old.
  const Answer& locate(int g, double lag, Measurement& measurement, const Ask& ask) {
    const auto mean = [&](int node) {
      return steady_mean(posture_.pose(node), posture_.twist(node), lag);
    };
    return locate(g, mean, steady_doubt(), measurement, ask);
  }

  // The same, if it is known where the bodies were when they felt it.
  const Answer& locate(int g, const Past& past, Measurement& measurement, const Ask& ask) {
    return locate(g, [&](int node) { return past.mean(node); }, remembered_doubt(), measurement, ask);
  }

  // The same, where forces of other contacts are free.
  const Answer& locate_beside_free_forces(int g, double lag, Measurement& measurement,
                                          const Ask& ask) {
    beside_free_forces_ = true;
    locate(g, lag, measurement, ask);
    beside_free_forces_ = false;
    return answer_;
  }

  // Nothing is known.
  const Answer& clear() {
    answer_.status = Status::none;
    answer_.count = answer_.rank = answer_.unknowns = 0;
    answer_.force = {kNaN, kNaN, kNaN};
    answer_.searching = false;
    return answer_;
  }

  // It has yet to be looked for: no more is known than the wrench, where there is one.
  const Answer& wait(const Measurement& measurement) {
    clear();
    answer_.searching = true;
    if (!measurement.has_wrench()) return answer_;
    const double* w = measurement.wrench();
    answer_.force = {w[0], w[1], w[2]};
    answer_.status = Status::wrench_only;
    return answer_;
  }

  const Answer& answer() const { return answer_; }

  // Gives each body the probability that the evidence for links gives it; where no candidate is on
  // it, its best patch stands for it.
  void share_out(const std::vector<BodyShare>& shares, const Measurement& measurement,
                 Answer& answer) const {
    Candidate* all = answer.candidates;
    for (const BodyShare& of : shares) {
      double here = 0.0;
      for (int i = 0; i < answer.count; ++i) here += node_of(all[i]) == of.node ? all[i].weight : 0.0;
      for (int i = 0; i < answer.count; ++i) {
        if (node_of(all[i]) == of.node) all[i].weight *= of.share / here;
      }
      if (here > 0.0 || of.share < settings_.least_told) continue;
      if (answer.count == Answer::kCandidates) {  // in place of the least likely
        std::iter_swap(all + answer.count - 1,
                       std::min_element(all, all + answer.count, [](const auto& a, const auto& b) {
                         return a.weight < b.weight;
                       }));
        --answer.count;
      }
      all[answer.count++] = patch_of(of);
    }
    std::sort(all, all + answer.count,
              [](const Candidate& a, const Candidate& b) { return a.weight > b.weight; });
    answer.body_probability = lead_with_best_body(all, all + answer.count);
    conclude(measurement, answer);
  }
  // The posterior of the place that was located last, cell by cell.
  std::vector<SurfaceCell> region() const { return CredibleRegion(found_, settings_).cells(); }
  const LinkSurfaces& surfaces() const { return found_.surfaces(); }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  static constexpr int kUnknowns = 5;  // of one contact: two of its place, three of its force

  // A steady twist and force are assumed. A past that is remembered is exact up to the first order:
  // the rest (`Mean::moment`) is that of the body's origin.
  Doubt steady_doubt() const { return {settings_.uncertain_way, 0.0, settings_.body_reach}; }
  Doubt remembered_doubt() const { return {0.0, settings_.uncertain_turn, settings_.body_reach}; }

  template <class MeanOf>
  const Answer& locate(int g, MeanOf&& mean, const Doubt& doubt, Measurement& measurement,
                       const Ask& ask) {
    clear();
    if (measurement.has_wrench()) {
      const double* w = measurement.wrench();
      answer_.force = {w[0], w[1], w[2]};
    }
    if (settings_.first_entry) {
      first_entry(g, measurement);
    } else if (measurement.has_wrench() && weak(measurement)) {
      answer_.status = Status::wrench_only;
    } else {
      found_.find(g, mean, doubt, measurement, ask);
      answer_.searching = !found_.complete();
      weigh();
      conclude(g, measurement);
      if (!measurement.lasts()) lasting_[g] = 0.0;
      if (measurement.lasts() && !ask.again && answer_.count > 0) lasting_[g] = lasting(measurement);
      answer_.lasting = lasting_[g];
    }
    return answer_;
  }

  // Too small a force to draw a line. Beside free forces it takes all rows to tell.
  bool weak(const Measurement& measurement) const {
    double C[36];
    measurement.wrench_covariance(C);
    const double size2 = dot(answer_.force, answer_.force), variance = C[0] + C[7] + C[14];
    if (beside_free_forces_) return false;
    return size2 < settings_.least_force * settings_.least_force ||
           size2 < settings_.weak_sigmas * settings_.weak_sigmas * variance;
  }

  // Posterior of each candidate: likelihood, the volume of force and surface that explains as well
  // (Laplace), and how a push comes there.
  void weigh() {
    double most = -std::numeric_limits<double>::infinity();
    for (Candidate& k : found_) {
      k.weight = -std::numeric_limits<double>::infinity();
      if (!(k.fit.cost() < found_.best() + settings_.cost_window)) continue;
      double H[25], g[5];
      const View& view = found_.view(k);
      found_.fitter().information(view.q, view.earlier(k.point), k.normal, k.fit.force, H, g);
      if (!cholesky(H, 5)) continue;
      k.weight = -0.5 * (k.fit.cost() + log_determinant(H, 5)) +
                 found_.fitter().log_prior(k.fit, graspable(k)) - view.width;
      most = std::max(most, k.weight);
      covariance_along(H, k.along);
    }
    double reached = -std::numeric_limits<double>::infinity();
    for (Candidate& k : found_) {
      if (k.weight < most - settings_.negligible) {
        k.weight = -std::numeric_limits<double>::infinity();
      } else if (!graspable(k)) {
        k.weight += approach(found_.surfaces(), k.point, k.fit.force, settings_);
      }
      reached = std::max(reached, k.weight);
    }
    double sum = 0.0;
    for (Candidate& k : found_) sum += k.weight = std::exp(k.weight - reached);
    for (Candidate& k : found_) k.weight /= sum;
  }

  // Which part of the variance of the best place is by errors that last.
  double lasting(Measurement& measurement) const {
    const Candidate& best = answer_.candidates[0];
    const View& view = found_.view(best);
    const Vec3 place = view.earlier(best.point);
    double B[36], P[25], g[5], work[25];
    found_.fitter().information(view.q, place, best.normal, best.fit.force, P, g);
    const double all = best.along[0] + best.along[2];
    if (!invert(P, 5, work) || !(all > 0.0)) return 0.0;
    measurement.lasting_information(view.node, B);
    const double part =
        ForceFitter::place_variance(B, P, place, best.normal, best.fit.force) / all;
    return std::clamp(part, 0.0, 1.0);
  }

  // The last two by two of (L L^T)^-1.
  static void covariance_along(const double* L, double* out) {
    const double a = 1.0 / L[18], b = 1.0 / L[24], c = -L[23] * a * b;
    out[0] = a * a + c * c;
    out[1] = c * b;
    out[2] = b * b;
  }

  void conclude(int g, const Measurement& measurement) {
    std::sort(found_.begin(), found_.end(),
              [](const Candidate& a, const Candidate& b) { return a.weight > b.weight; });
    if (found_.count() == 0 || !(found_.begin()->weight > 0.0)) {
      answer_.status = unexplained(g, measurement);
      return;
    }
    answer_.body_probability = lead_with_best_body(found_.begin(), found_.end());
    const Candidate& best = *found_.begin();
    const View& view = found_.view(best);
    answer_.pitch = view.pitch;
    answer_.chi2 = best.fit.chi2;
    answer_.degrees = std::max(1, measurement.size() - 5);
    spread_over_surface(best, answer_);
    copy_candidates();
    if (std::fabs(view.pitch) > settings_.pitch_limit ||
        (!graspable(best) &&
            found_.fitter().cone_cost(best.fit.cosine) > settings_.implausible_cone) ||
        best.fit.chi2 > chi2_limit(answer_.degrees, settings_.pitch_limit)) {
      answer_.status = unexplained(g, measurement);
    } else {
      conclude(measurement, answer_);
    }
  }

  void copy_candidates() {
    answer_.count = 0;
    for (const Candidate& k : found_) {
      if (answer_.count < Answer::kCandidates &&
          (answer_.count == 0 || k.weight > settings_.least_told))
        answer_.candidates[answer_.count++] = k;
    }
  }

  Candidate patch_of(const BodyShare& of) const {
    Candidate k;
    k.surface = of.surface;
    k.point = found_.surfaces().to_world(of.point, of.node);
    k.normal = found_.surfaces().turn_to_world(of.normal, of.node);
    k.fit.force = found_.surfaces().turn_to_world(of.force, of.node);
    k.fit.cosine = -dot(k.normal, k.fit.force) / std::max(norm(k.fit.force), 1e-9);
    k.radius = of.radius;
    k.weight = of.share;
    k.along[0] = k.along[2] = of.radius * of.radius;
    return k;
  }

  // All that follows from the first candidate, and from the weights.
  void conclude(const Measurement& measurement, Answer& answer) const {
    const Candidate& best = answer.candidates[0];
    spread_over_surface(best, answer);
    answer.force = best.fit.force;
    answer.rank = answer.unknowns = 0;
    const int equations = measurement.equations(node_of(best));
    if (equations <= kUnknowns) {
      answer.rank = equations;
      answer.unknowns = kUnknowns;
    }
    const bool sure = equations >= kUnknowns && !answer.searching && certain(answer);
    answer.status = sure ? Status::located : Status::ambiguous;
  }

  // What can be grasped, and what only a tool's or a handle's own sensor feels, may be loaded by a
  // moment: then its wrench is the answer.
  Status unexplained(int g, const Measurement& measurement) const {
    if (!measurement.has_wrench()) return Status::not_separable;
    const Segment& segment = observer_.layout().segments[g];
    if (segment.successors.empty() && measurement.scalars() == 0) return Status::wrench_only;
    const double limit = chi2_limit(std::max(1, measurement.size() - 6), settings_.pitch_limit);
    for (int i = 0; i < found_.views(); ++i) {
      const View& view = found_.view(i);
      const bool held = std::any_of(view.surfaces->begin(), view.surfaces->end(),
                                    [this](int s) { return found_.surfaces()[s].graspable; });
      if (held && view.least < limit) return Status::wrench_only;
    }
    return Status::not_separable;
  }

  bool graspable(const Candidate& k) const { return found_.surfaces()[k.surface].graspable; }
  int node_of(const Candidate& k) const { return found_.surfaces()[k.surface].node; }

  // Puts the best candidate of the most probable body first, and returns that body's probability.
  double lead_with_best_body(Candidate* begin, Candidate* end) const {
    double most = 0.0;
    Candidate* first = begin;
    for (Candidate* a = begin; a != end; ++a) {
      double sum = 0.0;
      for (const Candidate* b = begin; b != end; ++b)
        sum += node_of(*a) == node_of(*b) ? b->weight : 0.0;
      if (sum > most + 1e-12) {
        most = sum;
        first = a;
      }
    }
    if (begin != end) std::rotate(begin, first, first + 1);
    return std::min(most, 1.0);
  }

  // Is nearly all of the probability at one place?
  bool certain(const Answer& answer) const {
    if (answer.spread > settings_.spread_limit()) return false;
    double here = 0.0;
    for (int i = 0; i < answer.count; ++i) {
      const Candidate& k = answer.candidates[i];
      if (norm(k.point - answer.candidates[0].point) < settings_.place_radius) here += k.weight;
    }
    return here >= settings_.certain;
  }

  // Covariance of the point, which stays on its surface.
  static void spread_over_surface(const Candidate& k, Answer& answer) {
    Vec3 s, t;
    tangents(k.normal, s, t);
    for (int i = 0; i < 3; ++i) {
      for (int j = 0; j < 3; ++j) {
        const double si = component(s, i), sj = component(s, j);
        const double ti = component(t, i), tj = component(t, j);
        answer.covariance[3 * i + j] =
            k.along[0] * si * sj + k.along[1] * (si * tj + ti * sj) + k.along[2] * ti * tj;
      }
    }
    answer.spread = std::sqrt(k.along[0] + k.along[2]);
  }

  // The paper's rule: along the line of the segment's wrench, the first entry into any link.
  void first_entry(int g, const Measurement& measurement) {
    if (!measurement.has_wrench()) return;
    answer_.status = Status::wrench_only;
    const double* w = measurement.wrench();
    const Spatial wrench{answer_.force, {w[3], w[4], w[5]}};
    if (norm(wrench.linear) < 1e-9) return;
    double first = std::numeric_limits<double>::infinity();
    Candidate& k = answer_.candidates[0];
    k = Candidate{};
    found_.entries(g, line_of(wrench),
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
  const Posture& posture_;
  const PlaceSettings& settings_;
  Explanations found_;
  bool beside_free_forces_ = false;
  std::vector<double> lasting_;  // per segment: see `Answer`
  Answer answer_;
};

}  // namespace touchline
