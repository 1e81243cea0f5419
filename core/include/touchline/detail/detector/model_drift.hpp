// SPDX-License-Identifier: Apache-2.0
// What errors of the model have added to rows since their baselines were averaged: an error that a
// baseline has taken out comes back as the arm moves on. Also what motion alone has shown of it. No
// allocation after construction.
// Theory: docs/theory.md, section 4.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/detector/activity.hpp"
#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/friction_seen.hpp"
#include "touchline/detail/detector/motion_spread.hpp"
#include "touchline/detail/detector/noise_meter.hpp"
#include "touchline/detail/detector/row_offsets.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/segment_levels.hpp"
#include "touchline/detail/detector/tuning.hpp"

namespace touchline {

// Where the arm was while the baseline of a segment was averaged.
class BaselinePosture {
 public:
  BaselinePosture(std::size_t segments, std::size_t joints)
      : joints_(joints), mean_(segments * joints, 0.0) {}

  // The baseline takes a sample with the weight `gain`.
  void average(std::size_t segment, const double* q, double gain) {
    double* mean = mean_.data() + segment * joints_;
    for (std::size_t j = 0; j < joints_; ++j) mean[j] += gain * (q[j] - mean[j]);
  }

  // Sum of squares of the joints' ways since [rad2].
  double distance2(std::size_t segment, const double* q) const {
    const double* mean = mean_.data() + segment * joints_;
    double sum = 0.0;
    for (std::size_t j = 0; j < joints_; ++j) sum += (q[j] - mean[j]) * (q[j] - mean[j]);
    return sum;
  }

 private:
  std::size_t joints_;
  std::vector<double> mean_;  // per segment: joint positions
};

// Which share of the constant part of the model's errors comes back `way2` [rad2] away from where the
// baseline was averaged. That part is what an arm leaves on its way through ordinary motion. Weight
// changes with the pose, about in proportion to the way as far as `drift_farthest`. In a joint's own
// torque there is friction, too, all of which comes with motion.
struct DriftShares {
  DriftShares(const Activity& activity, double way2, const DetectorTuning& t)
      : of_wrench(std::min(way2, t.drift_farthest * t.drift_farthest) / (t.drift_way * t.drift_way)),
        of_torque(std::max(of_wrench,
                           std::min(1.0, activity.speed2 / (t.drift_speed * t.drift_speed)))) {}
  double of_wrench, of_torque;
};

// Variance of what the model's errors have added to a row since its baseline.
inline double drifted(const DetectionRow& row, const Activity& activity, const DriftShares& shares) {
  const double share = row.component < 0 ? shares.of_torque : shares.of_wrench;
  const double constant = row.drift.constant;
  return row.drift.variance(activity) + (share - 1.0) * constant * constant;
}

class ModelDrift {
 public:
  // All that is handed over stays the caller's. `longest`: time constant of the baselines [s].
  ModelDrift(const DetectorRows& rows, std::size_t joints, double longest, const DetectorTuning& tuning)
      : rows_(rows),
        longest_(longest),
        tuning_(tuning),
        posture_(rows.segments(), joints),
        lately_(rows.segments(), joints),
        spreads_(rows.size()),
        shown_before_(rows.size()),
        way2_(rows.segments(), 0.0),
        was_quiet_(rows.segments(), 1),
        is_off_(rows.segments(), 0),
        lately_share_(rows.segments(), 0.0),
        drift_(rows.size(), 0.0) {}

  // Row i is so far off its baseline [N or Nm] for a time dt [s] of motion. While that `begins` to
  // show it is learned quickly.
  void learn(std::size_t i, double off, double dt, bool begins) {
    spreads_[i].add(off, way2_[rows_[i].segment], dt, begins, tuning_);
  }
  // What motion alone hardly exceeds [N or Nm].
  double shown(std::size_t i) const { return spreads_[i].limit(tuning_); }

  // As an event begins, what motion had shown before is remembered; `noise`: of the residuals.
  void remember(std::size_t g, bool quiet, const NoiseMeter& noise) {
    if (was_quiet_[g] != 0 && !quiet)
      for (const std::size_t i : rows_.of(g)) shown_before_[i] = beyond(i, noise);
    was_quiet_[g] = quiet ? 1 : 0;
  }

  // The drifts of the rows at posture q. Of an arm that is not as told at least what motion had shown
  // before the present event.
  void follow(const SegmentLevels& levels, const RowOffsets& offsets, const FrictionSeen& friction,
              const NoiseMeter& noise, const Activity& activity, const double* q, double dt) {
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      const bool quiet = levels.is_quiet(g);
      if (quiet && offsets.quiet()[g] > 0.0 && !is_any_lost(g, offsets)) {
        const double tau = std::min(offsets.quiet()[g], longest_);
        posture_.average(g, q, std::min(1.0, dt / tau));
        const double referred = offsets.referred(rows_.first(g));
        if (referred > 0.0) lately_.average(g, q, std::min(1.0, dt / referred));
      }
      way2_[g] = posture_.distance2(g, q);
      const DriftShares shares(activity, way2_[g], tuning_);
      const double way2 = std::min(way2_[g], tuning_.drift_farthest * tuning_.drift_farthest);
      const bool moved = levels.has_moved_off(g);
      if (quiet) is_off_[g] = moved ? 1 : 0;
      lately_share_[g] = is_off_[g] != 0 ? nearness(way2_[g], lately_.distance2(g, q)) : 0.0;
      for (const std::size_t i : rows_.of(g)) {
        const double shown = moved && rows_[i].seen > 0.0
                                 ? (quiet ? beyond(i, noise) : shown_before_[i]).at(way2, tuning_)
                                 : 0.0;
        const double come = tuning_.friction_doubt * friction.added(i);
        drift_[i] = std::sqrt(std::max({drifted(rows_[i], activity, shares), shown, come * come}));
      }
    }
  }

  // Per row: one sigma of it [N or Nm].
  const std::vector<double>& drift() const { return drift_; }
  // Places take an offset between the baseline of row i and its reference: of the latter so much. A model
  // errs now about as it did where the arm was near to what it is, so both count by the inverse squares of
  // the ways since. Only on an arm in motion that is not as told, and of a sensor: friction in joints
  // comes at once, however near.
  double lately_share(std::size_t i) const {
    return rows_.of_wrench(i) ? lately_share_[rows_[i].segment] : 0.0;
  }
  void go_on_from(const ModelDrift& other, std::size_t of, std::size_t i) {
    spreads_[i] = other.spreads_[of];
  }

 private:
  MotionSpread::Shown beyond(std::size_t i, const NoiseMeter& noise) const {
    return spreads_[i].beyond(noise.sigma(i), tuning_);
  }

  // Which part of an offset is of what lies the way `near2` off, if the rest lies `far2` off [rad2].
  static double nearness(double far2, double near2) {
    const double sum = far2 + near2;
    return sum > 0.0 ? far2 / sum : 0.0;
  }

  // Is any row of a segment lost that was known before? Its baseline stays where it was averaged.
  bool is_any_lost(std::size_t g, const RowOffsets& offsets) const {
    for (const std::size_t i : rows_.of(g))
      if (offsets.started(i) && !rows_.samples[i].known) return true;
    return false;
  }

  const DetectorRows& rows_;
  double longest_;
  const DetectorTuning& tuning_;
  BaselinePosture posture_, lately_;  // of the baselines, of the references
  std::vector<MotionSpread> spreads_;               // per row
  std::vector<MotionSpread::Shown> shown_before_;   // per row: before the present event
  std::vector<double> way2_;      // per segment: of the joints since the baseline, squared [rad2]
  std::vector<char> was_quiet_;   // per segment: at the last sample
  std::vector<char> is_off_;      // per segment: has it moved and is not as told, before an event?
  std::vector<double> lately_share_;  // per segment: see there
  std::vector<double> drift_;     // per row
};

}  // namespace touchline
