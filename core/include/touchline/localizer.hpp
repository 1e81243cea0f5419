// SPDX-License-Identifier: Apache-2.0
// Where each segment is touched, and where each event is, from all its samples. No allocation per
// sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <vector>

#include "touchline/event_place.hpp"
#include "touchline/single_contact.hpp"

namespace touchline {

class Localizer {
 public:
  Localizer(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise,
            std::vector<LinkSurface> surfaces, LocalizerSettings settings)
      : observer_(observer),
        settings_(settings),
        period_(noise.period),
        measurement_(observer, std::move(tests), std::move(noise)),
        single_(observer, measurement_.posture(), settings_, std::move(surfaces)),
        following_(observer.row_layout().segments) {
    for (Following& f : following_) f.q.resize(observer.row_layout().joints, kNaN);
  }

  Localizer(const Localizer&) = delete;
  Localizer& operator=(const Localizer&) = delete;

  const std::vector<LinkSurface>& surfaces() const { return single_.surfaces().all(); }
  // The posterior of the place that was located last, cell by cell.
  std::vector<SurfaceCell> region() const { return single_.region(); }
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

  // The configuration of the sample, and for how long the baseline of each segment has been
  // averaged; `qd` and `quiet` may be null.
  void set_state(const double* q, const double* qd, const double* quiet) {
    measurement_.set_state(q, qd, quiet);
  }

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
    if (!measurement_.read(g, row, normalized)) return single_.clear();
    return single_.locate(g, lag, measurement_);
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
    const Answer& answer = single_.answer();
    const bool explained =
        answer.status == Status::located || answer.status == Status::ambiguous;
    if (!f.event.open(static_cast<int>(answer.status), explained)) return;
    for (int i = 0; i < answer.count; ++i) {
      const Candidate& k = answer.candidates[i];
      f.event.add(k.surface, single_.surfaces().to_node(k.point, surfaces()[k.surface].node), k.weight,
                  k.along[0] + k.along[2], settings_.place_radius);
    }
    f.event.close(explained ? answer.spread * answer.spread : kNaN);
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
    const bool sharp = event.variance() < settings_.spread_limit() * settings_.spread_limit();
    return here >= settings_.certain && sharp ? Status::located : Status::ambiguous;
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

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

  const Observer& observer_;
  LocalizerSettings settings_;
  double period_;
  Measurement measurement_;
  SingleContact single_;
  std::vector<Following> following_;  // per segment
};

}  // namespace touchline
