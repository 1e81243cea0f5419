// SPDX-License-Identifier: Apache-2.0
// Which link it is that joint torques speak of: the step that a touch has made in them, fitted as a
// whole, and each link weighed over all of its surface. Friction and errors of the model are no white
// noise that many samples take away: one step is one look. No allocation per sample; the walk over the
// surfaces is spread over samples.
// Theory: docs/theory.md, section 5.9.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/localizer/settings.hpp"
#include "touchline/detail/place/approach.hpp"
#include "touchline/detail/place/body_share.hpp"
#include "touchline/detail/place/link_surfaces.hpp"
#include "touchline/detail/place/measurement.hpp"
#include "touchline/detail/place/resting_torques.hpp"
#include "touchline/detail/place/surface_evidence.hpp"

namespace touchline {

class LinkEvidence {
 public:
  // `torque_error`: of gains, as a part of the load; `period` [s] of samples. All references stay
  // the caller's.
  LinkEvidence(const Observer& observer, const LinkSurfaces& surfaces,
               const LocalizerSettings& settings, double torque_error, double period)
      : observer_(observer),
        surfaces_(surfaces),
        settings_(settings),
        crosstalk_(settings.crosstalk * torque_error),
        period_(period),
        segment_(torque_segment()),
        posture_(observer.tree(), observer.row_layout().joints),
        evidence_(settings_),
        resting_(observer.row_layout().joints, settings) {
    const std::size_t n = observer.row_layout().joints;
    for (std::vector<double>* v : {&mean_, &q_, &walked_, &step_}) v->resize(n);
    covariance_.resize(n * n);
    design_.resize(n * 7);
    joints_.reserve(n);
    areas_.resize(surfaces.all().size());
    if (segment_ < 0) return;
    found_.resize(surfaces.bodies(segment_).size());
    shares_.resize(found_.size());
    sums_.resize(found_.size());
    body_areas_.resize(found_.size());
    for (std::size_t b = 0; b < surfaces.bodies(segment_).size(); ++b) {
      for (int s : surfaces.bodies(segment_)[b].surfaces) {
        const int count = static_cast<int>(surfaces.samples(s).size());
        for (int i = 0; i < count; ++i) patches_.push_back({static_cast<int>(b), s, i});
        for (const Triangle& t : surfaces[s].mesh.triangles())
          areas_[s] += 0.5 * norm(cross(t.ab, t.ac)) / std::max(count, 1);
        body_areas_[b] += count * areas_[s];
      }
    }
    const double samples = std::max(1.0, std::ceil(settings.walk / period));
    each_ = static_cast<std::size_t>(std::ceil(static_cast<double>(patches_.size()) / samples));
  }

  // The only segment that is felt by joint torques alone; -1: there is none.
  int segment() const { return segment_; }

  // Takes a sample [row of the observer] in which nothing touches the segment.
  void rest(const double* row, double time) {
    if (segment_ >= 0) resting_.take(row + observer_.row_layout().segment_torque(), time);
  }

  // A touch begins.
  void begin() {
    resting_.end();
    weight_ = peak_ = 0.0;
    known_ = walking_ = false;
    ++revision_;
  }

  // Takes a sample of the touch, which `measurement` has read. `searched`: has a place been searched
  // for in it? Then half the time is left.
  void take(const double* row, const double* q, const Measurement& measurement, bool searched) {
    if (!resting_.known()) return;
    add(row + observer_.row_layout().segment_torque(), q);
    if (!walking_ && changed()) start(measurement);
    if (walking_) walk(searched ? (each_ + 1) / 2 : each_);
  }

  // Has a walk been finished since the touch began?
  bool known() const { return known_; }
  const std::vector<BodyShare>& shares() const { return shares_; }  // of all bodies
  int revision() const { return revision_; }                        // changes with them

 private:
  static constexpr double kNone = -std::numeric_limits<double>::infinity();
  // Of the way to where two bodies are alike, no unit: rounding must not decide which is the first.
  static constexpr double kShort = 0.95;
  static constexpr std::size_t kExplains = 2;  // looks, by the time it takes

  struct Patch {
    int body, surface, sample;
  };

  int torque_segment() const {
    const auto& segments = observer_.layout().segments;
    const int last = static_cast<int>(segments.size()) - 1;
    return last >= 0 && segments[last].sensor < 0 ? last : -1;
  }

  // The mean of the step and of the posture, of samples that are not much weaker than those before. An
  // arm that yields springs back when a push ends: what is left speaks of another posture and no touch.
  void add(const double* torque, const double* q) {
    double square = 0.0, way = 0.0;
    for (std::size_t j = 0; j < mean_.size(); ++j) {
      step_[j] = std::isfinite(torque[j]) ? torque[j] - resting_.mean(j) : 0.0;
      square += step_[j] * step_[j];
      if (weight_ > 0.0) way = std::max(way, std::fabs(q[j] - q_[j]));
    }
    const double kept = std::max(0.0, 1.0 - period_ / settings_.step_memory);
    peak_ = std::max(kept * peak_, square);
    if (square < settings_.strong_share * settings_.strong_share * peak_) return;
    weight_ *= kept * std::exp(-way / settings_.turned);
    weight_ += square;
    const double part = weight_ > 0.0 ? square / weight_ : 1.0;
    for (std::size_t j = 0; j < mean_.size(); ++j) {
      mean_[j] += part * (step_[j] - mean_[j]);
      q_[j] += part * (q[j] - q_[j]);
    }
  }

  bool changed() const {
    if (!known_) return true;
    double change = 0.0, all = 0.0;
    for (std::size_t j = 0; j < mean_.size(); ++j) {
      change += (mean_[j] - walked_[j]) * (mean_[j] - walked_[j]);
      all += mean_[j] * mean_[j];
    }
    return change > settings_.changed * settings_.changed * all;
  }

  void start(const Measurement& measurement) {
    rows_ = measurement.size();
    if (measurement.has_wrench() || rows_ == 0 || rows_ > static_cast<int>(mean_.size())) return;
    measurement_ = &measurement;
    joints_.clear();
    double largest = 0.0;
    for (int i = 0; i < rows_; ++i) {
      const int j = measurement.joint(i);
      if (j < 0) return;
      joints_.push_back(j);
      largest = std::max(largest, std::fabs(mean_[j]));
    }
    walked_ = mean_;
    posture_.set(q_.data(), nullptr);
    measurement.covariance(covariance_.data());
    for (int i = 0; i < rows_; ++i) {
      for (int k = 0; k <= i; ++k)
        covariance_[i * rows_ + k] +=
            resting_.scatter(std::max(joints_[i], joints_[k]), std::min(joints_[i], joints_[k]));
      const double offset = settings_.offset_doubt * resting_.mean(joints_[i]);
      covariance_[i * (rows_ + 1)] += crosstalk_ * crosstalk_ * largest * largest + offset * offset;
    }
    if (!cholesky(covariance_.data(), rows_, 1e-15)) return;
    std::fill(sums_.begin(), sums_.end(), 0.0);
    best_ = kNone;
    next_ = 0;
    body_ = -1;
    walking_ = true;
  }

  // Goes on for so many looks.
  void walk(std::size_t looks) {
    for (std::size_t k = 0; k < looks && next_ < patches_.size();) k += look(patches_[next_++]);
    if (next_ < patches_.size()) return;
    walking_ = false;
    double all = 0.0, even = 0.0;
    for (std::size_t b = 0; b < sums_.size(); ++b) {
      all += sums_[b];
      if (sums_[b] > 0.0) even += sums_[b] / body_areas_[b];
    }
    if (!(all > 0.0)) return;
    const double way = toward_links(all, even);
    for (std::size_t b = 0; b < sums_.size(); ++b) {
      if (sums_[b] > 0.0) shares_[b] = found_[b];
      shares_[b].node = surfaces_.bodies(segment_)[b].node;
      shares_[b].share = by_area(b, all) + way * (by_link(b, even) - by_area(b, all));
    }
    known_ = true;
    ++revision_;
  }

  // The probability of a body if any area is touched alike, and if any link is. `all`, `even`: the sum
  // of the evidence, and of its means over links.
  double by_area(std::size_t b, double all) const { return sums_[b] / all; }
  double by_link(std::size_t b, double even) const {
    return sums_[b] > 0.0 ? sums_[b] / body_areas_[b] / even : 0.0;
  }

  // Hands may choose a point of the arm, any area alike, or first a link, any link alike. How far from
  // the one to the other the body that areas name is least sure, and yet the first.
  double toward_links(double all, double even) const {
    std::size_t top = 0;
    for (std::size_t b = 1; b < sums_.size(); ++b) top = sums_[b] > sums_[top] ? b : top;
    const double loss = by_area(top, all) - by_link(top, even);
    if (!(loss > 0.0)) return 0.0;
    double way = 1.0;
    for (std::size_t b = 0; b < sums_.size(); ++b) {
      const double gain = by_link(b, even) - by_area(b, all) + loss;
      if (b != top && gain > 0.0)
        way = std::min(way, kShort * (by_area(top, all) - by_area(b, all)) / gain);
    }
    return way;
  }

  // What the rows say of a contact on the body of `node`.
  void weigh(int node) {
    double* d = design_.data();
    for (int i = 0; i < rows_; ++i) {
      measurement_->subspace(i, posture_, node, d + 7 * i);
      d[7 * i + 6] = walked_[joints_[i]];
    }
    for (int k = 0; k < 7; ++k) solve_lower(covariance_.data(), rows_, d + k, 7);
    quadratic_ = Quadratic{};
    for (int i = 0; i < rows_; ++i) {
      const double* line = d + 7 * i;
      for (int a = 0; a < 6; ++a) {
        for (int b = 0; b < 6; ++b) quadratic_.information[6 * a + b] += line[a] * line[b];
        quadratic_.vector[a] += line[a] * line[6];
      }
      quadratic_.constant += line[6] * line[6];
    }
  }

  // How many looks it counts: its evidence is an integral where it explains.
  std::size_t look(const Patch& patch) {
    const int node = surfaces_.bodies(segment_)[patch.body].node;
    if (patch.body != body_) {
      body_ = patch.body;
      weigh(node);
    }
    const SurfaceSample& sample = surfaces_.samples(patch.surface)[patch.sample];
    const Pose& X = posture_.pose(node);
    const double area = areas_[patch.surface], radius = std::sqrt(area / 12.0);
    const bool grasped = surfaces_[patch.surface].graspable;
    const double scale = std::log(area);
    const SurfaceEvidence::Explained e =
        evidence_.at(quadratic_, X.R * sample.point + X.p, X.R * sample.normal, grasped, radius,
                     best_ - settings_.negligible_patch - scale);
    double value = e.log_evidence + scale;
    if (!(value > best_ - settings_.negligible_patch)) return 1;
    const Vec3 force = transposed_times(X.R, e.force);
    if (!grasped) {  // as the arm stands now: other links may be in the way
      value += approach(surfaces_, surfaces_.to_world(sample.point, node),
                        surfaces_.turn_to_world(force, node), settings_);
    }
    if (value > best_) {
      if (best_ > kNone) {
        for (double& sum : sums_) sum *= std::exp(best_ - value);
      }
      best_ = value;
    }
    const double weight = std::exp(value - best_);
    BodyShare& found = found_[patch.body];
    if (sums_[patch.body] == 0.0 || value > found.share)
      found = {node, patch.surface, value, sample.point, sample.normal, force, radius};
    sums_[patch.body] += weight;
    return kExplains;
  }

  const Observer& observer_;
  const LinkSurfaces& surfaces_;
  const LocalizerSettings& settings_;
  const Measurement* measurement_ = nullptr;
  double crosstalk_, period_;
  int segment_;
  Posture posture_;
  SurfaceEvidence evidence_;
  RestingTorques resting_;

  std::vector<Patch> patches_;  // of all bodies, body by body
  std::vector<double> areas_;   // of one patch, by surface [m2]
  std::vector<double> body_areas_;  // of all patches of a body [m2]
  std::size_t each_ = 0;        // patches in a sample

  // The step [Nm] and the posture, as means.
  std::vector<double> mean_, q_, step_;
  double weight_ = 0.0, peak_ = 0.0;  // the sum of squares, and the largest of late [Nm2]

  // The walk at hand: the step that it weighs, the rows, and what has been found.
  std::vector<double> walked_, covariance_, design_, sums_;  // the covariance: its factor
  std::vector<int> joints_;
  std::vector<BodyShare> found_, shares_;  // `share` of the first: log of the evidence
  Quadratic quadratic_;
  std::size_t next_ = 0;
  int rows_ = 0, body_ = -1, revision_ = 0;
  double best_ = kNone;
  bool walking_ = false, known_ = false;
};

}  // namespace touchline
