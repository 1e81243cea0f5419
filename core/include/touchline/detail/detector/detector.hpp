// SPDX-License-Identifier: Apache-2.0
// Tells contact from noise, per segment: one or several tests at a time, each with a threshold,
// with hysteresis, a minimum duration, and a slow baseline that follows constant offsets while
// nothing touches. No allocation, lock, exception or output in `step`.
// Theory: docs/theory.md, section 4.7.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <vector>

#include "touchline/detail/detector/activity.hpp"
#include "touchline/detail/detector/baseline_posture.hpp"
#include "touchline/detail/detector/borne_out.hpp"
#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/first_look.hpp"
#include "touchline/detail/detector/friction_seen.hpp"
#include "touchline/detail/detector/motion_spread.hpp"
#include "touchline/detail/detector/noise_meter.hpp"
#include "touchline/detail/detector/row_covariance.hpp"
#include "touchline/detail/detector/row_states.hpp"
#include "touchline/detail/detector/segment_tests.hpp"
#include "touchline/detail/detector/standing.hpp"
#include "touchline/detail/detector/tuning.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

class Detector {
 public:
  // `loadable`: per row, can a contact load it? Those that none can begin no event. Empty: all can.
  Detector(const Observer& observer, std::vector<DetectionRow> rows, DetectionSettings settings,
           const DetectorTuning& tuning = {}, std::vector<char> loadable = {})
      : tuning_(tuning),
        per_trend_(1.0 / tuning.trend),
        per_fro_memory_(1.0 / tuning.fro_memory),
        observer_(observer),
        posture_(observer.tree(), observer.row_layout().joints),
        rows_(std::move(rows)),
        settings_(std::move(settings)),
        told_(observer, rows_, settings_.noise),
        activity_(observer.row_layout().joints, tuning_.activity_time),
        baseline_posture_(settings_.sum_limits.size(), observer.row_layout().joints),
        bandwidths_(of_rows([this](const DetectionRow& row) { return bandwidth_of(row); })),
        states_(rows_.size()),
        spreads_(rows_.size()),
        friction_(rows_.size()),
        friction_drift_(rows_.size(), 0.0),
        borne_out_(bandwidths_),
        residuals_(rows_.size()),
        known_(rows_.size()),
        counts_(rows_.size()),
        adapts_(rows_.size()),
        averages_(rows_.size()),
        crossed_(rows_.size()),
        shown_by_motion_(rows_.size()),
        limits_(rows_.size(), 1.0),
        contact_(rows_.size()),
        baseline_limits_(rows_.size()),
        bandwidth_lanes_(rows_.size()),
        confirmed_at_(rows_.size()),
        settled_at_(rows_.size()),
        samples_(rows_.size()),
        segments_(settings_.sum_limits.size()),
        first_(segments_.size() + 1, 0),
        meters_(bandwidths_, of_rows(least_noise), tuning_),
        trend_meters_(of_rows([this](const DetectionRow& row) {
                        return bandwidth_of(row) * per_trend_;
                      }),
                      of_rows(least_noise), tuning_),
        collision_shares_(of_rows([](const DetectionRow& row) { return row.contact / row.collision; })),
        normalized_(rows_.size(), 0.0),
        shares_(rows_.size(), 0.0),
        drift_(rows_.size(), 0.0),
        excess_(rows_.size(), 1.0),
        shown_before_(rows_.size()),
        standing_(rows_.size()),
        first_looks_(rows_.size()),
        loadable_(std::move(loadable)),
        levels_(segments_.size(), 0),
        quiet_(segments_.size(), 0.0),
        statistics_(segments_.size() * settings_.tests.size(), 0.0),
        fires_(segments_.size(), 0),
        still_(tuning_.pause) {
    loadable_.resize(rows_.size(), 1);
    for (const TestSetting& setting : settings_.tests)
      for (std::size_t g = 0; g < segments_.size(); ++g) fires_[g] |= std::isfinite(setting.limits[g]);
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      std::vector<DetectionRow> own;
      std::vector<char> own_loadable;
      for (std::size_t i = 0; i < rows_.size(); ++i) {
        if (rows_[i].segment != static_cast<int>(g)) continue;
        own.push_back(rows_[i]);
        own_loadable.push_back(loadable_[i]);
      }
      first_[g + 1] = first_[g] + own.size();
      tests_.emplace_back(observer, own, std::move(own_loadable), settings_, tuning_);
      joint_tests_ = joint_tests_ || tests_.back().used();
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      contact_[i] = rows_[i].contact;
      baseline_limits_[i] = rows_[i].baseline_limit;
      bandwidth_lanes_[i] = bandwidths_[i];
      confirmed_at_[i] = tuning_.confirm / bandwidths_[i];
      settled_at_[i] = tuning_.trend / bandwidths_[i];
    }
    slowest_.assign(segments_.size(), kAbsurd);
    for (const DetectionRow& row : rows_)
      slowest_[row.segment] = std::min(slowest_[row.segment], bandwidth_of(row));
  }

  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  // To be called after each step of the observer, with the row it wrote and the sample it took.
  void step(const double* output, const double* q, const double* qd) {
    row_ = output;
    qd_ = qd;
    gap_ = (static_cast<Health>(output[observer_.row_layout().health()]) & kGap) != 0;
    const double now = observer_.time();
    const double dt = timed_ ? std::max(0.0, now - time_) : 0.0;
    timed_ = true;
    time_ = now;
    if (dt > 0.0) follow_motion(q, qd, dt);
    for (std::size_t g = 0; g < segments_.size(); ++g) read_segment(g);
    if (dt > 0.0 && sound_) follow_friction(dt);
    borne_out_.add(residuals_, known_, dt);
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      Segment& s = segments_[g];
      s.peak = s.slow = s.sum = s.collision = s.borne = s.borne_sum = s.borne_collision = 0.0;
      if (known(g)) s.age += dt;
      for (std::size_t i = first_[g], end = first_[g + 1]; i < end; ++i) test_row(i, s);
      judge(g, dt);
      decide(g, dt);
      remember_motion(g);
    }
    follow_offsets(dt);
    if (dt > 0.0) {
      meters_.add(residuals_, known_, counts_, dt, tuning_);
      trend_meters_.add(states_.trend, known_, counts_, dt, tuning_);
    }
    if (dt > 0.0 && sound_) follow_drift(q, dt);
  }

  const std::vector<DetectionRow>& rows() const { return rows_; }
  // Per row: (residual - baseline) / contact threshold; 0 where there is no settled residual.
  const std::vector<double>& normalized() const { return normalized_; }
  // Per row: what `normalized` must exceed now, at least 1.
  const RowLanes& limits() const { return limits_; }
  // Per row: one sigma of what the model's errors may have added since the baseline [N or Nm].
  const std::vector<double>& drift() const { return drift_; }
  // Per row: how many times as large as told its noise is seen to be, at least 1.
  const std::vector<double>& excess() const { return excess_; }
  // Per row: can a contact load it?
  const std::vector<char>& loadable() const { return loadable_; }
  const std::vector<int>& levels() const { return levels_; }  // per segment
  // Per segment: over how long its baseline has been averaged [s].
  const std::vector<double>& quiet() const { return quiet_; }
  // Per segment, for each test: what is compared with its limit.
  const std::vector<double>& statistics() const { return statistics_; }
  const RowSample& sample(std::size_t row) const { return samples_[row]; }
  // The tests of a segment, and the number of its first row.
  const SegmentTests& tests(int segment) const { return tests_[segment]; }
  std::size_t first_row(int segment) const { return first_[segment]; }
  const Activity& activity() const { return activity_.activity(); }
  double baseline(int row) const { return states_.baseline[row]; }
  // What a row's load must exceed now, one sigma of its noise as seen, and what stood there when
  // observation began or rests there since a contact [N or Nm].
  double limit(int row) const { return limits_[row] * rows_[row].contact; }
  double noise(int row) const { return meters_.sigma(row); }
  double offset(int row) const { return states_.anchor[row]; }
  // How far the arm has shown that it is not as told, per row; does anything stand there now that
  // exceeds a threshold; is the noise of any row clearly larger than told?
  Standing standing(int row) const {
    Standing standing = standing_[row];
    standing.now = stands_off(row) ? states_.anchor[row] : 0.0;
    standing.drift = warmed(row) ? states_.anchor[row] - states_.origin[row] : 0.0;
    return standing;
  }
  bool stands_off() const { return offset_; }
  bool noisy() const { return noisy_; }
  double reference(int row) const { return states_.reference[row]; }
  // Over how long a row's baseline has been averaged [s].
  double known_for(int row) const { return states_.age[row]; }
  // What another detector of this arm has learned of a row, which here stands at `baseline` while
  // nothing touches: observation does not begin anew.
  void go_on_from(const Detector& other, int of, int row, double baseline) {
    states_.go_on_from(other.states_, of, row, baseline);
    spreads_[row] = other.spreads_[of];
    friction_.go_on_from(other.friction_, of, row);
    meters_.go_on_from(other.meters_, of, row);
    looks_over_ -= first_looks_[row].over();
    first_looks_[row] = other.first_looks_[of];
    looks_over_ += first_looks_[row].over();
    trend_meters_.go_on_from(other.trend_meters_, of, row);
    Segment& segment = segments_[rows_[row].segment];
    segment.age = std::max(segment.age, states_.age[row]);
    segment.off = other.segments_[other.rows_[of].segment].off;
    still_ = other.still_;
  }
  const Observer& observer() const { return observer_; }

 private:
  enum class Origin {  // what an event began with
    start,     // of observation: an offset that has yet to be seen whole
    reversal,  // only of joints that hardly move, as friction does that changes its sign
    creep,     // no faster than motions change
    push
  };
  struct Segment {
    Origin origin = Origin::start;
    double age = 0.0;     // since its first settled sample [s]
    double lasted = 0.0;  // for how long the present event has [s]
    double slow = 0.0;  // the largest share of its rows' trends
    double peak = 0.0, sum = 0.0, collision = 0.0;  // of the normalized rows
    double borne = 0.0, borne_sum = 0.0, borne_collision = 0.0;  // of what no single sample moves
    double above = 0.0, above_collision = 0.0, below = 0.0;  // for how long [s]
    double score = 0.0, borne_score = 0.0;  // of all tests, in thresholds
    double highest = 0.0;  // of the score while a test holds
    double top = 0.0;    // the largest mean of the last moments since then, in limits
    double top_wrench = 0.0;  // the same of the sensors' rows alone
    double rest = 0.0;   // for how long little has been left of it, and that has not changed [s]
    double back = 0.0;   // for how long all has been as before the offset that stands there now [s]
    double other_quiet = 0.0;  // over how long its rows' `other` has been averaged [s]
    bool in_motion = false;  // did the present event begin while the arm moved?
    bool pending = false, pending_collision = false;
    bool off = false;  // has the arm shown that it is not as told?
    bool free = true;  // of any event, at the last sample?
    double way2 = 0.0;  // of the joints since the baseline, squared [rad2]
    bool learns = false;  // and moves: what is seen of its rows counts
  };

  void follow_motion(const double* q, const double* qd, double dt) {
    double sum = 0.0;
    for (int j = 0; j < observer_.row_layout().joints; ++j) sum += std::fabs(q[j]) + std::fabs(qd[j]);
    sound_ = sum < kAbsurd;
    if (!sound_) return;
    activity_.add(qd, dt);
    still_ = activity().speed2 > tuning_.moving * tuning_.moving ? 0.0 : still_ + dt;
    since_ += dt;
    if (placed_ && since_ < tuning_.refresh) return;
    posture_.set(q, nullptr);
    tell_noise();
    if (joint_tests_)
      for (SegmentTests& tests : tests_) tests.weigh(posture_, activity_.activity());
    since_ = 0.0;
    placed_ = true;
  }

  // What the noise figures let expect in each row, in this posture.
  void tell_noise() {
    told_.evaluate_variances(posture_);
    noisy_ = false;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const std::size_t at = i * (rows_.size() + 1);
      const double K = bandwidths_[i], kept = std::min(1.0, 0.5 * K * settings_.noise.period);
      const double readings = kept * told_.reading()[at], velocities = K * K * told_.momentum()[at];
      meters_.tell(i, readings, velocities, tuning_);
      first_looks_[i].tell(readings, velocities, K, settings_.noise.period);
      trend_meters_.tell(i, (readings + kept * velocities) / (1.0 + tuning_.trend), 0.0, tuning_);
      excess_[i] = meters_.excess(i, tuning_);
      if (!meters_.contradicts(i, tuning_) || excess_[i] == 1.0) continue;  // it does not matter
      noisy_ = true;
      if (excess_[i] > standing_[i].ratio) {
        standing_[i].ratio = excess_[i];
        standing_[i].seen = meters_.sigma(i);
      }
    }
  }

  // The residuals and innovations of a segment's rows.
  void read_segment(std::size_t g) {
    const RowLayout& layout = observer_.row_layout();
    const double *settled = row_ + layout.joint_settled(), *torque = row_ + layout.segment_torque(),
                 *joint_gap = row_ + layout.joint_gap_std(),
                 *gap = row_ + layout.segment_gap_std() + 2 * g;
    double wrench[6], load[6] = {};  // innovations that no test asks for
    bool known = false, off = false;
    for (std::size_t i = first_[g], end = first_[g + 1]; i < end; ++i) {
      const DetectionRow& row = rows_[i];
      RowSample& s = samples_[i];
      if (row.component < 0) {
        s.known = settled[row.joint] > 0.0;
        s.residual = torque[row.joint];
        s.innovation = observer_.own_innovation(row.joint);
        s.gap_std = joint_gap[row.joint];
      } else {
        if (i == first_[g]) known = read_wrench(g, wrench, load);
        s.known = known;
        s.residual = wrench[row.component];
        s.innovation = load[row.component];
        s.gap_std = gap[row.component < 3 ? 0 : 1];
      }
      s.known = s.known && std::isfinite(s.residual);
      residuals_[i] = s.residual;
      known_[i] = s.known ? 1.0 : 0.0;
      off = off || states_.shown[i] > row.contact || meters_.contradicts(i, tuning_);
      if (!std::isfinite(s.innovation)) s.innovation = s.residual;  // samples were lost
    }
    Segment& segment = segments_[g];
    segment.off = off && fires_[g];
    segment.learns = segment.off && still_ < tuning_.pause;
  }

  bool shows_friction(std::size_t i) const {
    return rows_[i].component < 0 && samples_[i].known && rows_[i].seen > 0.0;
  }

  // Friction of the joints that are tested beside a force-torque sensor, which feels none of it.
  void follow_friction(double dt) {
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      if (observer_.layout().segments[g].sensor < 0) continue;
      const bool silent = placed_ && is_silent(g);
      double most = 0.0;
      for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
        if (!shows_friction(i)) continue;
        const DetectionRow& row = rows_[i];
        const double part = std::min(1.0, dt * bandwidths_[i]);
        friction_.follow(i, qd_[row.joint], part, std::min(1.0, part * per_trend_), tuning_);
        if (silent && states_.started[i] && friction_.tells(i, tuning_))
          friction_.learn(i, unexplained(i), dt, tuning_);
        most = std::max(most, friction_.shown(i, row.contact, tuning_));
      }
      for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
        if (!shows_friction(i)) continue;
        const DetectionRow& row = rows_[i];
        // A joint of which little has been seen may have as much friction as another one, or as stood
        // there when it was moving at the start.
        double other = most;
        if (states_.shown[i] > row.contact && states_.anchor[i] * friction_.way(i) < 0.0)
          other = std::max(other, std::fabs(states_.anchor[i]));
        const double own = friction_.shown(i, row.contact, tuning_);
        const double friction = std::max(own, (1.0 - friction_.sure(i, tuning_)) * other);
        friction_drift_[i] = friction * friction_.turned(i);
      }
    }
  }

  // What a joint's row has that no contact explains of which the sensor shows no more than it does: one
  // inboard of the joint does not load it, one outboard by what the sensor shows.
  double unexplained(std::size_t i) const {
    const std::size_t first = first_[rows_[i].segment];
    const int sensor = observer_.layout().segments[rows_[i].segment].sensor;
    double w[6] = {};
    for (std::size_t k = first; rows_[k].component >= 0; ++k)
      w[rows_[k].component] = samples_[k].residual - states_.baseline[k];
    const Pose& X = posture_.pose(observer_.sensors()[sensor].node);
    const Spatial shown = wrench_to_parent(X, touchline::load(w));
    double outboard = samples_[i].residual - states_.baseline[i];
    const double inboard = outboard;
    for (int node : observer_.joints()[rows_[i].joint].nodes)
      outboard -= dot(posture_.subspace(node), shown);
    if (inboard * outboard <= 0.0) return 0.0;
    return std::fabs(inboard) < std::fabs(outboard) ? inboard : outboard;
  }

  // Does the sensor of a segment feel nothing?
  bool is_silent(std::size_t g) const {
    bool any = false;
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (rows_[i].component < 0) continue;
      if (!samples_[i].known || !states_.started[i]) return false;
      any = true;
      const double off = samples_[i].residual - states_.baseline[i];
      if (std::fabs(off) > limits_[i] * rows_[i].contact) return false;
    }
    return any;
  }

  bool read_wrench(std::size_t g, double* wrench, double* innovation) const {
    const RowLayout& layout = observer_.row_layout();
    const int sensor = observer_.layout().segments[g].sensor;
    if (sensor < 0 || !(row_[layout.segment_settled() + g] > 0.0)) {
      std::fill_n(wrench, 6, std::nan(""));
      std::fill_n(innovation, 6, std::nan(""));
      return false;
    }
    const Pose X = observer_.sensor_pose(sensor);
    store(wrench_to_child(X, load(row_ + layout.segment_wrench() + 6 * g)), wrench);
    if (joint_tests_)
      store(wrench_to_child(X, load(row_ + layout.segment_innovation() + 6 * g)), innovation);
    return true;
  }

  template <class Number>
  std::vector<double> of_rows(Number&& number) const {
    std::vector<double> all;
    for (const DetectionRow& row : rows_) all.push_back(number(row));
    return all;
  }
  static double least_noise(const DetectionRow& row) {
    return row.contact / std::max(row.seen, 1.0);
  }
  double bandwidth_of(const DetectionRow& row) const {
    if (row.component < 0) return observer_.joints()[row.joint].bandwidth;
    return observer_.sensors()[observer_.layout().segments[row.segment].sensor].bandwidth;
  }

  void test_row(std::size_t i, Segment& segment) {
    const DetectionRow& row = rows_[i];
    RowSample& sample = samples_[i];
    normalized_[i] = shares_[i] = 0.0;
    if (!sample.known) return;
    if (!states_.started[i]) states_.begin(i, sample.residual);
    const double baseline = states_.baseline[i];
    sample.offset = baseline;
    sample.reference = states_.reference[i];
    sample.referred = states_.referred[i];
    const double spread = shown_by_motion_[i] =
        std::max(segment.learns && row.seen > 0.0 ? spreads_[i].limit(tuning_) : 0.0,
                 tuning_.friction_margin * friction_drift_[i]);
    const double limit = limits_[i] = largest_noise(i, spread) / row.contact;
    const double normalized = normalized_[i] = (sample.residual - baseline) / row.contact;
    const double x = normalized / limit;
    const double share = shares_[i] = std::fabs(x);
    if (loadable_[i] == 0) return;
    segment.peak = std::max(segment.peak, share);
    if (still_ >= tuning_.pause) segment.slow = std::max(segment.slow, slow_share(i));
    const double borne = (borne_out_.value(i) - baseline) / (row.contact * limit);
    const double borne_share = std::fabs(borne);
    segment.borne = std::max(segment.borne, borne_share);
    if (!(spread > row.contact)) {
      segment.sum += x * x;
      segment.borne_sum += borne * borne;
    }
    const double least = collision_shares_[i];
    segment.collision = std::max(segment.collision, share * least);
    segment.borne_collision = std::max(segment.borne_collision, borne_share * least);
  }

  // What lasts of a row, in what the noise of its trend lets expect. Noise of velocities is nearly
  // white in the residual and dies out in the trend, so that this finds weak loads that last. Of an
  // arm that stands: of one that moves the model's errors are larger than noise.
  double slow_share(std::size_t i) const {
    const DetectionRow& row = rows_[i];
    if (row.seen <= 0.0 || !fires_[row.segment] || samples_[i].gap_std > 0.0) return 0.0;
    const double baseline = states_.baseline[i];
    const double now = samples_[i].residual - baseline, mean = states_.trend[i] - baseline;
    if (now * mean <= 0.0) return 0.0;
    const double noise = trend_meters_.limit(i, row.seen, first_looks_[i].ratio(), tuning_);
    const double limit = std::max({row.contact, noise, shown_by_motion_[i]});
    return std::min(std::fabs(now), std::fabs(mean)) / limit;
  }

  // What a row's load must exceed now [N or Nm]: the larger of its threshold and of what noise and
  // the model's errors bring. Noise is as told in this posture and as seen, errors as a calibration
  // has found them. It has met some postures and speeds; in others both are larger.
  double largest_noise(std::size_t i, double spread) const {
    const DetectionRow& row = rows_[i];
    double most = row.contact;
    if (row.seen > 0.0) {
      const double noise = meters_.limit(i, row.seen, first_looks_[i].ratio(), tuning_);
      const double variance = row.slow.moving_variance(activity());
      const double error = variance > 0.0 ? row.seen * std::sqrt(variance) : 0.0;
      most = std::max(most, error > 0.0 ? std::hypot(noise, error) : noise);
    }
    most = std::max(most, spread);
    const double gap = samples_[i].gap_std;
    return gap > 0.0 ? std::hypot(most, tuning_.gap_sigmas * gap) : most;
  }

  // May offsets be followed: is nothing felt, or only by what has been an offset since?
  bool adapts(std::size_t g) const {
    return levels_[g] == 0 ? !segments_[g].pending : segments_[g].peak < settings_.times.release;
  }

  // The statistics of all tests, and the largest in thresholds.
  void judge(std::size_t g, double dt) {
    Segment& s = segments_[g];
    if (joint_tests_ && placed_) {
      double most = std::numeric_limits<double>::infinity();
      for (const TestSetting& setting : settings_.tests) {
        if (setting.test == Test::cusum) most = tuning_.cusum_most * setting.limits[g];
      }
      tests_[g].step(samples_.data() + first_[g], dt, gap_, adapts(g), activity_.activity(), most);
    }
    s.score = s.borne_score = 0.0;
    for (std::size_t t = 0; t < settings_.tests.size(); ++t) {
      const TestSetting& setting = settings_.tests[t];
      double& statistic = statistics_[g * settings_.tests.size() + t];
      const double sum = std::sqrt(s.sum / settings_.sum_limits[g]);
      const bool rows = setting.test == Test::rows;
      statistic = rows      ? std::max({s.peak, s.slow, sum})
                  : placed_ ? tests_[g].statistic(setting.test)
                            : 0.0;
      s.score = std::max(s.score, statistic / setting.limits[g]);
      const double borne_sum = std::sqrt(s.borne_sum / settings_.sum_limits[g]);
      const double borne = rows ? std::max({s.borne, s.slow, borne_sum}) : statistic;
      s.borne_score = std::max(s.borne_score, borne / setting.limits[g]);
    }
  }

  void decide(std::size_t g, double dt) {
    Segment& s = segments_[g];
    if (is_joined(g)) {  // what there was is an offset, and the push is its own event
      come_to_rest(g);
      s.lasted = 0.0;
      s.in_motion = true;
      return;
    }
    const bool quiet = levels_[g] == 0 && !s.pending;
    const bool may_begin = s.score > 1.0 || s.collision > 1.0 || (s.off && still_ < tuning_.pause);
    if (quiet && may_begin) s.origin = origin(g, dt);
    // What creeps may be over its limit a moment before a push is: that has no before.
    const bool recent = s.lasted < tuning_.trend / slowest_[g];
    const bool other = s.origin == Origin::reversal || (s.origin == Origin::creep && recent);
    if ((!quiet || may_begin) && other && pushed(g)) s.origin = Origin::push;
    advance(s.score > 1.0, dt, s.pending, s.above);
    s.highest = s.pending ? std::max(s.highest, s.score) : 0.0;
    advance(s.collision > 1.0, dt, s.pending_collision, s.above_collision);
    // What motion shows soon exceeds no limit; it need not fall below a part of it.
    const double release = own_doing(g) ? 1.0 : settings_.times.release;
    s.below = lasting(s.score < release, dt, s.below);
    if (lasts(g, s.pending, s.above, s.score, s.borne_score)) levels_[g] = std::max(levels_[g], 1);
    if (lasts(g, s.pending_collision, s.above_collision, s.collision, s.borne_collision)) levels_[g] = 2;
    if (levels_[g] == 0) {
      s.top = s.top_wrench = s.rest = s.back = s.below = s.lasted = 0.0;
      s.in_motion = still_ < tuning_.pause;
      return;
    }
    s.lasted += dt;
    s.top = std::max(s.top, lately(g));
    s.top_wrench = std::max(s.top_wrench, lately(g, Rows::wrench));
    s.rest = lasting((may_rest(g) && steady(g)) || only_joints_left(g), dt, s.rest);
    if (s.below >= settings_.times.hold) levels_[g] = 0;
    const double least = tuning_.rest / slowest_[g];
    if (levels_[g] > 0 &&
        s.rest >= (stands() ? least : std::max(least, tuning_.rest_moving))) come_to_rest(g);
    s.back = lasting(stands() && is_back(g) && steady(g), dt, s.back);
    if (levels_[g] > 0 && s.back >= std::max(least, tuning_.rest_moving)) go_back(g);
  }

  // Has a test held for long enough, not by one sample alone, and not by noise that has yet to be
  // seen? Where a test need not last, its threshold is one of calibration, which has met all that.
  bool lasts(std::size_t g, bool pending, double duration, double score, double borne) const {
    if (!pending || duration < settings_.times.min_duration) return false;
    if (settings_.times.min_duration <= 0.0) return true;
    const Segment& s = segments_[g];
    const bool barely = s.highest < tuning_.barely && s.off && still_ < tuning_.pause;
    if (barely &&
        duration < tuning_.trend / slowest_[g]) return false;  // an error of the model passes
    if (young(g)) return score > (looked_at(g) ? tuning_.alone : tuning_.unseen);
    return score > tuning_.alone || borne > 1.0;
  }

  // Is too little seen of a segment to know its noise?
  bool young(std::size_t g) const {
    return segments_[g].age < tuning_.confirm / slowest_[g] || !looked_at(g);
  }

  // Have the first moments shown whether there is more noise in a segment than is told?
  bool looked_at(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i)
      if (samples_[i].known && !first_looks_[i].ready(tuning_)) return false;
    return true;
  }

  // For how long something has held, but for single samples of noise.
  double lasting(bool holds, double dt, double duration) const {
    return holds ? duration + dt : std::max(0.0, duration - tuning_.spike * dt);
  }

  bool known(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i)
      if (samples_[i].known) return true;
    return false;
  }

  // By how much a row has changed within the last moments, and what motions change it by at most in them
  // [N or Nm]. One that is known anew has no last moments: its mean is of before it was lost.
  double quick(std::size_t i) const {
    return states_.known[i] > 0.0 ? std::fabs(samples_[i].residual - states_.trend[i]) : 0.0;
  }
  double creep(std::size_t i) const {
    return tuning_.creep_share * std::fabs(states_.trend[i] - states_.baseline[i]);
  }

  // What an event that begins now would have begun with.
  Origin origin(std::size_t g, double dt) const {
    if (segments_[g].age < tuning_.start / slowest_[g] +
        tuning_.start_samples * dt) return Origin::start;
    bool slow = true, creeps = true;
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (shares_[i] < std::min(1.0, segments_[g].peak)) continue;
      slow = slow && rows_[i].component < 0 &&
          std::fabs(qd_[rows_[i].joint]) < tuning_.reversal_speed;
      creeps = creeps && quick(i) < creep(i);
    }
    return slow ? Origin::reversal : creeps ? Origin::creep : Origin::push;
  }

  // Has a sensor's wrench stepped over its limit? Friction in joints, whichever moves them, does not
  // load a sensor: what began with joints that hardly move is a push after all. So is what began while
  // the sensor was lost, if it shows a load when it is known again.
  bool pushed(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (rows_[i].component < 0 || std::fabs(normalized_[i]) < limits_[i]) continue;
      if (!(states_.known[i] > 0.0) || quick(i) >= creep(i)) return true;
    }
    return false;
  }

  // Does a sensor's wrench change faster than motions do? That is not learned as one of their errors.
  bool steps(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (rows_[i].component < 0 || !samples_[i].known) continue;
      if (quick(i) > std::max(rows_[i].contact, creep(i))) return true;
    }
    return false;
  }

  // Does a push join what most likely is the arm's own doing, or what only joints have felt, of an arm
  // in motion that is not as told? A sensor's wrench then steps by more than its limit. What lasts for
  // less than the mean of the last moments has no before.
  bool is_joined(std::size_t g) const {
    const Segment& s = segments_[g];
    if (levels_[g] == 0 || !moved_off(g)) return false;
    if (s.top_wrench > 1.0 && (s.origin == Origin::push || !own_doing(g))) return false;
    if (s.lasted < tuning_.trend / slowest_[g]) return false;
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (counts(i, Rows::wrench) && quick(i) > limits_[i] * rows_[i].contact) return true;
    }
    return false;
  }

  // Is what is felt of a segment most likely the arm's own doing: an error of its model in motion?
  bool own_doing(std::size_t g) const {
    const Segment& s = segments_[g];
    return s.off && still_ < tuning_.pause && (s.origin != Origin::push || s.lasted > tuning_.hand);
  }

  // May what the last moments have of a contact be friction or an error of the model? Only if it is
  // little of the contact's peak. An arm that stands must have shown that it is not as told. Of one
  // that moves, by itself and not by the contact alone, hardly anything may be left. Two contacts
  // against each other leave more.
  bool may_rest(std::size_t g) const {
    const Segment& s = segments_[g];
    const bool little = s.origin == Origin::start || lately(g) < tuning_.little * s.top;
    if (!little || !(s.off || s.in_motion)) return false;
    return stands() ? s.off : lately(g) < std::max(tuning_.barely, tuning_.trace * s.top);
  }

  // Has the arm shown that it is not as told, and does it move, or has it since the event began?
  bool moved_off(std::size_t g) const {
    const Segment& s = segments_[g];
    return s.off && (s.in_motion || still_ < tuning_.pause);
  }

  // Does nothing of a contact load the segment's sensors any more, of such an arm? What its joints
  // then have is friction that has changed meanwhile: no contact that clamps the arm loses its load on
  // the sensors at once and keeps that on the joints.
  bool only_joints_left(std::size_t g) const {
    return moved_off(g) && segments_[g].top_wrench > 1.0 &&
           lately(g, Rows::wrench) < settings_.times.release && steady(g, Rows::wrench);
  }

  bool stands() const { return activity().speed2 < tuning_.standing * tuning_.standing; }

  // Which rows of a segment: all, or those that its sensor's wrench has.
  enum class Rows { all, wrench };
  bool counts(std::size_t i, Rows which) const {
    return samples_[i].known && (which == Rows::all || rows_[i].component >= 0);
  }

  // The mean of the last moments, in limits: the largest of a segment's rows.
  double lately(std::size_t g, Rows which = Rows::all) const {
    double most = 0.0;
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (!counts(i, which)) continue;
      const double off = states_.trend[i] - states_.baseline[i];
      most = std::max(most, std::fabs(off) / (limits_[i] * rows_[i].contact));
    }
    return most;
  }

  // Has no row of the segment changed of late by what would matter?
  bool steady(std::size_t g, Rows which = Rows::all) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      const double most = settings_.times.release * limits_[i] * rows_[i].contact;
      if (counts(i, which) && quick(i) > most) return false;
    }
    return true;
  }

  // What the last moments have of a row is an offset from now on.
  void rest(std::size_t i) {
    const double trend = states_.trend[i];
    states_.baseline[i] = states_.anchor[i] = states_.origin[i] = states_.reference[i] = trend;
    states_.shown[i] = std::max(states_.shown[i], std::fabs(trend));
    states_.age[i] = states_.referred[i] = settled_at_[i];
    friction_.rest(i);
  }

  // What is left of a contact and does not change rests there: an offset from now on. What stood
  // there before is remembered, unless what is remembered stood there for longer.
  void come_to_rest(std::size_t g) {
    const bool longer = quiet_[g] > segments_[g].other_quiet;
    if (longer) segments_[g].other_quiet = quiet_[g];
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      if (longer) states_.other[i] = {states_.baseline[i], states_.anchor[i], states_.shown[i]};
      rest(i);
    }
    end_event(g);
  }

  // Is all of the segment as it was before the offset that stands there now? That was a contact
  // then, of which nothing is left: one that was held, or there when observation began.
  bool is_back(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      const double most = settings_.times.release * limits_[i] * rows_[i].contact;
      if (!samples_[i].known || std::fabs(states_.trend[i] - states_.other[i].baseline) > most)
        return false;
    }
    return true;
  }

  void go_back(std::size_t g) {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
      rest(i);
      states_.anchor[i] = states_.origin[i] = states_.other[i].anchor;
      states_.shown[i] = states_.other[i].shown;
    }
    end_event(g);
  }

  void end_event(std::size_t g) {
    quiet_[g] = tuning_.trend / slowest_[g];
    levels_[g] = 0;
    Segment& s = segments_[g];
    s.pending = s.pending_collision = false;
    s.above = s.above_collision = s.below = s.top = s.top_wrench = s.rest = s.back = 0.0;
  }

  // For how long a test has held without a break.
  static void advance(bool holds, double dt, bool& pending, double& duration) {
    duration = holds && pending ? duration + dt : 0.0;
    pending = holds;
  }

  // Does more than a threshold stand on a row of an arm that has shown that it is not as told?
  bool stands_off(std::size_t i) const {
    return std::min(std::fabs(states_.anchor[i]), states_.shown[i]) > rows_[i].contact;
  }

  // Has what stands on a row drifted by more than a threshold?
  bool warmed(std::size_t i) const {
    return std::fabs(states_.anchor[i] - states_.origin[i]) > rows_[i].contact;
  }

  // Follows what stands on all rows: side by side, but for what happens to few of them and rarely.
  void follow_offsets(double dt) {
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      const double adapts_now = adapts(g) ? 1.0 : 0.0, felt = levels_[g] > 0 ? 1.0 : 0.0,
                   quiet = felt > 0.0 || segments_[g].pending ? 0.0 : 1.0;
      for (std::size_t i = first_[g], end = first_[g + 1]; i < end; ++i) {
        adapts_[i] = adapts_now;
        counts_[i] = quiet;
      }
    }
    const bool confirmed = follow_trends(dt);
    const bool looking = dt > 0.0 && looks_over_ < rows_.size();
    const bool stopped = still_ >= tuning_.pause && still_ - dt < tuning_.pause;
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      const Segment& segment = segments_[g];
      const bool felt = levels_[g] > 0;
      const bool learns = segment.learns && dt > 0.0 && (felt ? own_doing(g) : !steps(g));
      const bool rests = stopped && segment.off;
      const bool usual = !(confirmed || looking || learns || felt || rests || segment.pending);
      for (std::size_t i = first_[g], end = first_[g + 1]; i < end; ++i) {
        averages_[i] = known_[i];
        if (usual || !samples_[i].known) continue;
        if (crossed_[i] > 0.0) confirm_start(i);
        if (learns && rows_[i].seen > 0.0) {
          spreads_[i].add(samples_[i].residual - states_.baseline[i], segment.way2, dt, felt, tuning_);
          shown_by_motion_[i] = std::max(shown_by_motion_[i], spreads_[i].limit(tuning_));
        }
        if (looking) look(i);
        if (rests && !felt && rows_[i].seen > 0.0) rest(i);
        // In the first moments what noise beyond the told one can bring is averaged, too: one sample of
        // it is no baseline.
        const bool noise = first_looks_[i].ratio() > 1.0 && young(g) && segment.score < tuning_.unseen;
        if (felt || (segment.pending && !noise)) averages_[i] = 0.0;
      }
    }
    offset_ = follow_baselines(dt);
    follow_ways(dt);
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      for (std::size_t i = first_[g + 1]; i-- > first_[g];) {
        if (!(averages_[i] > 0.0)) continue;
        quiet_[g] = states_.age[i];
        break;
      }
    }
  }

  // The means of the last moments and the references. Noise is measured while nothing is felt, and of
  // what is felt where it goes to and fro more often within the filter's memory than a hand can.
  // Returns whether what stood at the start of a row is to be confirmed: `crossed_` tells of which.
  bool follow_trends(double dt) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    Lanes any = zero;
    for (std::size_t i = 0; i < known_.size(); i += kLanes) {
      const Lanes known = known_.at(i), value = residuals_.at(i), bandwidth = bandwidth_lanes_.at(i);
      const Lanes before = states_.trend.at(i);
      const Lanes from = states_.known.at(i) > zero ? before : value;
      const Lanes part = dt * bandwidth * per_trend_;
      const Lanes trend = from + (value - from) * (part < one ? part : one);
      states_.trend.put(i, known > zero ? trend : before);
      states_.known.put(i, known);
      const Lanes seconds = states_.seconds.at(i), later = seconds + dt, end = confirmed_at_.at(i);
      Lanes crossed = seconds < end ? one : zero;
      crossed = later < end ? zero : crossed;
      crossed = known > zero ? crossed : zero;
      crossed_.put(i, crossed);
      any = any + crossed;
      states_.seconds.put(i, known > zero ? later : seconds);
      // Running means first, low-passes once they have seen enough.
      const Lanes adapts = known * adapts_.at(i), most = all_lanes(tuning_.reference);
      const Lanes referred = states_.referred.at(i), more = referred + dt;
      const Lanes span = most < more ? most : more, share = dt / span;
      const Lanes reference = states_.reference.at(i);
      const Lanes moved = reference + (value - reference) * (share < one ? share : one);
      states_.referred.put(i, adapts > zero ? span : referred);
      const Lanes followed = span > zero ? moved : reference;
      states_.reference.put(i, adapts > zero ? followed : reference);
      if (dt > 0.0) meter_noise(i, value - trend, dt * bandwidth * per_fro_memory_);
    }
    for (int k = 0; k < kLanes; ++k) {
      if (lane(any, k) > 0.0) return true;
    }
    return false;
  }

  // Of rows from i on, that are off their trends by so much; `forgets`: what part of their turns.
  void meter_noise(std::size_t i, const Lanes& off, const Lanes& forgets) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const Lanes known = known_.at(i), side = states_.side.at(i), turns = states_.turns.at(i);
    const Lanes most = tuning_.fro * limits_.at(i) * contact_.at(i);
    const Lanes keep = one - forgets, on = off * side;
    const Lanes more = off > zero ? one : -one;
    Lanes now = turns * (zero < keep ? keep : zero);
    now = now + (on < -most ? one : zero);
    Lanes next = off > most ? more : side;
    next = off < -most ? more : next;
    states_.turns.put(i, known > zero ? now : turns);
    states_.side.put(i, known > zero ? next : side);
    const Lanes counts = counts_.at(i);
    counts_.put(i, now > all_lanes(tuning_.fro_turns) ? one : counts);
  }

  // The baselines of the rows that are averaged, and what stands there. Returns whether that is more
  // than a threshold, or has drifted by more, on any row.
  bool follow_baselines(double dt) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const Lanes longest = all_lanes(settings_.times.baseline);
    const double warming = std::min(1.0, dt / tuning_.warming);
    Lanes off = zero;
    for (std::size_t i = 0; i < known_.size(); i += kLanes) {
      const Lanes averages = averages_.at(i), value = residuals_.at(i), contact = contact_.at(i);
      const Lanes age = states_.age.at(i), older = age + dt, tau = longest < older ? longest : older;
      states_.age.put(i, averages > zero ? older : age);
      const Lanes baseline = states_.baseline.at(i), anchor = states_.anchor.at(i),
                  origin = states_.origin.at(i);
      const Lanes part = dt / tau;
      const Lanes next = baseline + (value - baseline) * (part < one ? part : one);
      const Lanes told = baseline_limits_.at(i), shown = shown_by_motion_.at(i);
      const Lanes most = told < shown ? shown : told;
      const Lanes now = within(next, anchor - most, anchor + most);
      // No hand rises as slowly as a sensor warms up.
      const Lanes farthest = tuning_.warming_most * contact;
      const Lanes warmed =
          within(anchor + (now - anchor) * warming, origin - farthest, origin + farthest);
      const Lanes settling = settled_at_.at(i);
      const Lanes does = tau > zero ? averages : zero;
      const Lanes next_anchor = older < settling ? now : warmed;
      const Lanes next_origin = older < settling ? now : origin;
      const Lanes stands = does > zero ? next_anchor : anchor;
      const Lanes began = does > zero ? next_origin : origin;
      states_.baseline.put(i, does > zero ? now : baseline);
      states_.anchor.put(i, stands);
      states_.origin.put(i, began);
      const Lanes size = larger(stands, -stands), most_shown = states_.shown.at(i);
      const Lanes least = most_shown < size ? most_shown : size, drift = stands - began;
      off = off + (least > contact ? one : zero) + (larger(drift, -drift) > contact ? one : zero);
    }
    for (int k = 0; k < kLanes; ++k) {
      if (lane(off, k) > 0.0) return true;
    }
    return false;
  }
  static double sq(double x) { return x * x; }

  // What the joints did while the baselines were averaged.
  void follow_ways(double dt) {
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      if (observer_.layout().segments[g].sensor < 0) continue;
      for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
        const double tau = std::min(states_.age[i], settings_.times.baseline);
        if (rows_[i].component < 0 && averages_[i] > 0.0 && tau > 0.0)
          friction_.average(i, std::min(1.0, dt / tau));
      }
    }
  }
  static Lanes within(const Lanes& x, const Lanes& low, const Lanes& high) {
    const Lanes below = high < x ? high : x;
    return x < low ? low : below;
  }

  // The first moments of a row's noise.
  void look(std::size_t i) {
    if (first_looks_[i].over()) return;
    first_looks_[i].add(samples_[i].residual, tuning_);
    if (first_looks_[i].over()) ++looks_over_;
  }

  // What stood there at the first sample may be a rest of settling, or of an arm that is set going.
  // It shows that the arm is not as told only if it still stands there a while later.
  void confirm_start(std::size_t i) {
    const double trend = states_.trend[i], anchor = states_.anchor[i];
    const double least = std::min(std::fabs(trend), std::fabs(anchor));
    const double most = std::max(std::fabs(trend), std::fabs(anchor));
    if (!(trend * anchor > 0.0 && most < tuning_.alike * least)) return;
    states_.shown[i] = std::max(states_.shown[i], least);
    if (least > rows_[i].contact) standing_[i].start = std::copysign(least, anchor);
  }

  // What motion had shown before an event, as the event begins.
  void remember_motion(std::size_t g) {
    Segment& s = segments_[g];
    const bool free = levels_[g] == 0 && !s.pending;
    for (std::size_t i = first_[g]; s.free && !free && i < first_[g + 1]; ++i)
      shown_before_[i] = shown_by(i);
    s.free = free;
  }
  MotionSpread::Shown shown_by(std::size_t i) const {
    return spreads_[i].beyond(meters_.sigma(i), tuning_);
  }

  // Is any row of a segment lost that was known before? Its baseline stays where it was averaged.
  bool any_lost(std::size_t g) const {
    for (std::size_t i = first_[g]; i < first_[g + 1]; ++i)
      if (states_.started[i] != 0 && !samples_[i].known) return true;
    return false;
  }

  // Drifts of the rows, from where the arm was while the baselines were averaged. Of one that is not
  // as told at least what motion had shown before the present event.
  void follow_drift(const double* q, double dt) {
    for (std::size_t g = 0; g < segments_.size(); ++g) {
      if (levels_[g] == 0 && !segments_[g].pending && quiet_[g] > 0.0 && !any_lost(g)) {
        const double tau = std::min(quiet_[g], settings_.times.baseline);
        baseline_posture_.average(g, q, std::min(1.0, dt / tau));
      }
      Segment& segment = segments_[g];
      segment.way2 = baseline_posture_.distance2(g, q);
      const DriftShares shares(activity(), segment.way2, tuning_);
      const double way2 = std::min(segment.way2, sq(tuning_.drift_farthest));
      const bool moved = moved_off(g), free = levels_[g] == 0 && !segment.pending;
      for (std::size_t i = first_[g]; i < first_[g + 1]; ++i) {
        const double shown = moved && rows_[i].seen > 0.0
                                 ? (free ? shown_by(i) : shown_before_[i]).at(way2, tuning_)
                                 : 0.0;
        const double friction = sq(tuning_.friction_doubt * friction_drift_[i]);
        drift_[i] = std::sqrt(std::max({drifted(rows_[i], activity(), shares), shown, friction}));
      }
    }
  }

  DetectorTuning tuning_;
  double per_trend_, per_fro_memory_;  // inverse: divisions per row and sample are dear
  const Observer& observer_;
  Posture posture_;
  const double *row_ = nullptr, *qd_ = nullptr;
  std::vector<DetectionRow> rows_;
  DetectionSettings settings_;
  RowCovariance told_;
  ActivityMeter activity_;
  BaselinePosture baseline_posture_;
  std::vector<double> bandwidths_;  // per row: of its filter [rad/s]
  RowStates states_;
  std::vector<MotionSpread> spreads_;  // per row
  FrictionSeen friction_;
  std::vector<double> friction_drift_;  // per row: what friction may have added since the baseline
  BorneOut borne_out_;
  // Of the sample: residuals, whether they are known and count as noise.
  RowLanes residuals_, known_, counts_;
  // Of the sample: may references be followed; are baselines averaged; is the start to be confirmed;
  // what motion alone shows [N or Nm]; what `normalized` must exceed.
  RowLanes adapts_, averages_, crossed_, shown_by_motion_, limits_;
  // Of the robot: thresholds, how far baselines may go [N or Nm]; bandwidths [rad/s]; when the start
  // is confirmed, until when what stands there is averaged [s].
  RowLanes contact_, baseline_limits_, bandwidth_lanes_, confirmed_at_, settled_at_;
  std::size_t looks_over_ = 0;  // rows of which the first moments are over
  std::vector<RowSample> samples_;
  std::vector<Segment> segments_;
  std::vector<double> slowest_;     // per segment: the least bandwidth of its rows [rad/s]
  std::vector<std::size_t> first_;  // per segment: its first row; they stand together
  std::vector<SegmentTests> tests_;
  NoiseMeter meters_, trend_meters_;  // of the residuals, of their trends
  std::vector<double> collision_shares_;  // per row: its threshold, in those of a collision
  std::vector<double> normalized_, shares_;  // in thresholds; the size of that, in limits
  std::vector<double> drift_, excess_;
  std::vector<MotionSpread::Shown> shown_before_;  // per row: what motion had shown before an event
  std::vector<Standing> standing_;  // per row
  std::vector<FirstLook> first_looks_;  // per row
  std::vector<char> loadable_;  // per row: can a contact load it?
  std::vector<int> levels_;
  std::vector<double> quiet_, statistics_;
  std::vector<char> fires_;  // per segment: can a test fire, or are statistics all that is asked for?
  double time_ = 0.0, since_ = 0.0;
  double still_;  // for how long the arm has stood [s]
  bool timed_ = false, placed_ = false, gap_ = false, joint_tests_ = false, sound_ = false;
  bool offset_ = false, noisy_ = false;
};

}  // namespace touchline
