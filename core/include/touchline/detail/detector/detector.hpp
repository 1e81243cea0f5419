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
#include "touchline/detail/detector/borne_out.hpp"
#include "touchline/detail/detector/calm_values.hpp"
#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/first_look.hpp"
#include "touchline/detail/detector/friction_seen.hpp"
#include "touchline/detail/detector/model_drift.hpp"
#include "touchline/detail/detector/noise_meter.hpp"
#include "touchline/detail/detector/row_covariance.hpp"
#include "touchline/detail/detector/row_offsets.hpp"
#include "touchline/detail/detector/rows.hpp"
#include "touchline/detail/detector/segment_levels.hpp"
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
        observer_(observer),
        settings_(std::move(settings)),
        rows_(observer, std::move(rows), settings_.sum_limits.size(), settings_.noise.period),
        posture_(observer.tree(), observer.row_layout().joints),
        told_(observer, rows_.all(), settings_.noise),
        motion_(observer.row_layout().joints, tuning_),
        offsets_(rows_, settings_.times.baseline, tuning_),
        friction_(observer, rows_, offsets_, tuning_),
        levels_(rows_, motion_, settings_.times, tuning_, offsets_, friction_),
        drift_(rows_, observer.row_layout().joints, settings_.times.baseline, tuning_),
        borne_out_(rows_.bandwidths),
        calm_(rows_, tuning_),
        meters_(rows_.bandwidths, rows_.numbers(least_noise), tuning_),
        trend_meters_(slower(rows_.bandwidths, tuning_.trend), rows_.numbers(least_noise), tuning_),
        first_looks_(rows_.size()),
        collision_shares_(rows_.numbers([](const DetectionRow& row) { return row.contact / row.collision; })),
        adapts_(rows_.size()),
        counts_(rows_.size()),
        averages_(rows_.size()),
        shown_by_motion_(rows_.size()),
        ages_(rows_.segments(), 0.0),
        fires_(rows_.segments(), 0),
        scores_(rows_.segments()),
        excess_(rows_.size(), 1.0),
        standing_(rows_.size()),
        loadable_(std::move(loadable)),
        statistics_(rows_.segments() * settings_.tests.size(), 0.0),
        placing_(rows_.size(), 0.0),
        known_for_(rows_.segments(), 0.0) {
    loadable_.resize(rows_.size(), 1);
    for (const TestSetting& setting : settings_.tests)
      for (std::size_t g = 0; g < fires_.size(); ++g) fires_[g] |= std::isfinite(setting.limits[g]);
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      std::vector<DetectionRow> own;
      std::vector<char> own_loadable;
      for (const std::size_t i : rows_.of(g)) {
        own.push_back(rows_[i]);
        own_loadable.push_back(loadable_[i]);
      }
      tests_.emplace_back(observer, own, std::move(own_loadable), settings_, tuning_);
      joint_tests_ = joint_tests_ || tests_.back().used();
    }
  }

  Detector(const Detector&) = delete;
  Detector& operator=(const Detector&) = delete;

  // To be called after each step of the observer, with the row it wrote and the sample it took.
  void step(const double* output, const double* q, const double* qd) {
    row_ = output;
    gap_ = (static_cast<Health>(output[observer_.row_layout().health()]) & kGap) != 0;
    const double now = observer_.time();
    const double dt = timed_ ? std::max(0.0, now - time_) : 0.0;
    timed_ = true;
    time_ = now;
    if (dt > 0.0) follow_motion(q, qd, dt);
    for (std::size_t g = 0; g < rows_.segments(); ++g) read_segment(g, qd);
    if (dt > 0.0 && sound_) {
      const auto untouched = [&](std::size_t g) {
        return levels_.is_quiet(g) || levels_.is_own_doing(g);
      };
      friction_.follow(placed_ ? &posture_ : nullptr, loadable_, untouched, dt);
    }
    borne_out_.add(rows_.residuals, rows_.known, dt);
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      if (rows_.any_known(g)) ages_[g] += dt;
      judge(g, dt);
      levels_.decide(g, scores_[g], dt);
      drift_.remember(g, levels_.is_quiet(g), meters_);
    }
    follow_offsets(dt);
    if (dt > 0.0) {
      calm_.add(offsets_.trends(), counts_, [&](std::size_t g) { return levels_.is_quiet(g); });
      meters_.add(calm_.values(), calm_.known(), calm_.counts(), dt, tuning_);
      trend_meters_.add(calm_.trends(), calm_.known(), calm_.counts(), dt, tuning_);
    }
    if (dt > 0.0 && sound_)
      drift_.follow(levels_, offsets_, friction_, meters_, activity(), q, dt);
    tell_places();
  }

  const std::vector<DetectionRow>& rows() const { return rows_.all(); }
  // Per row: (residual - baseline) / contact threshold; 0 where there is no settled residual.
  const std::vector<double>& normalized() const { return rows_.normalized; }
  // Per row: what `normalized` must exceed now, at least 1.
  const RowLanes& limits() const { return rows_.limits; }
  // Per row: one sigma of what the model's errors may have added since the baseline [N or Nm].
  const std::vector<double>& drift() const { return drift_.drift(); }
  // For places, which may take another offset: per row (residual - offset) / contact threshold; per
  // segment over how long that offset has been averaged [s].
  const std::vector<double>& placing() const { return placing_; }
  const std::vector<double>& quiet_of_places() const { return known_for_; }
  // Per row: how many times as large as told its noise is seen to be, at least 1.
  const std::vector<double>& excess() const { return excess_; }
  // Per row: can a contact load it?
  const std::vector<char>& loadable() const { return loadable_; }
  const std::vector<int>& levels() const { return levels_.levels(); }  // per segment
  // Does any row of segment g exceed its limit?
  bool is_over(std::size_t g) const { return scores_[g].peak > 1.0; }
  // Is what is felt of segment g most likely the arm's own doing: an error of its model in motion? May it be?
  bool is_own_doing(std::size_t g) const { return levels_.is_own_doing(g); }
  bool may_be_own_doing(std::size_t g) const { return levels_.may_be_own_doing(g); }
  // Per segment: over how long its baseline has been averaged [s].
  const std::vector<double>& quiet() const { return offsets_.quiet(); }
  // Per segment, for each test: what is compared with its limit.
  const std::vector<double>& statistics() const { return statistics_; }
  const RowSample& sample(std::size_t row) const { return rows_.samples[row]; }
  // The tests of a segment, and the number of its first row.
  const SegmentTests& tests(int segment) const { return tests_[segment]; }
  std::size_t first_row(int segment) const { return rows_.first(segment); }
  const Activity& activity() const { return motion_.activity(); }
  double baseline(int row) const { return offsets_.baseline(row); }
  // How far the arm has shown that it is not as told, per row; does anything stand there now that
  // exceeds a threshold; is the noise of any row clearly larger than told?
  Standing standing(int row) const {
    Standing standing = standing_[row];
    standing.now = offsets_.stands_off(row) ? offsets_.anchor(row) : 0.0;
    standing.drift = offsets_.warmed(row);
    return standing;
  }
  bool stands_off() const { return offset_; }
  // Does any wrench stand off? What gains do to the arm's own weight is such an offset.
  bool wrench_stands_off() const {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (rows_.of_wrench(i) && std::fabs(offsets_.baseline(i)) > tuning_.doubtful * rows_.limit(i))
        return true;
    }
    return false;
  }
  bool noisy() const { return noisy_; }
  double reference(int row) const { return offsets_.reference(row); }
  // Over how long a row's baseline has been averaged [s].
  double known_for(int row) const { return offsets_.age(row); }
  // What another detector of this arm has learned of a row, which here stands at `baseline` while
  // nothing touches: observation does not begin anew.
  void go_on_from(const Detector& other, int of, int row, double baseline) {
    offsets_.go_on_from(other.offsets_, of, row, baseline);
    drift_.go_on_from(other.drift_, of, row);
    friction_.go_on_from(other.friction_, of, row);
    meters_.go_on_from(other.meters_, of, row);
    trend_meters_.go_on_from(other.trend_meters_, of, row);
    looks_over_ -= first_looks_[row].over();
    first_looks_[row] = other.first_looks_[of];
    looks_over_ += first_looks_[row].over();
    double& age = ages_[rows_[row].segment];
    age = std::max(age, offsets_.age(row));
    motion_.go_on_from(other.motion_);
    levels_.expect_errors(rows_[row].segment);
  }
  const Observer& observer() const { return observer_; }

 private:
  static double least_noise(const DetectionRow& row) {
    return row.contact / std::max(row.seen, 1.0);
  }
  static std::vector<double> slower(std::vector<double> bandwidths, double times) {
    for (double& bandwidth : bandwidths) bandwidth *= 1.0 / times;
    return bandwidths;
  }

  void follow_motion(const double* q, const double* qd, double dt) {
    double sum = 0.0;
    for (int j = 0; j < observer_.row_layout().joints; ++j) sum += std::fabs(q[j]) + std::fabs(qd[j]);
    sound_ = sum < kAbsurd;
    if (!sound_) return;
    motion_.add(qd, dt);
    since_ += dt;
    if (placed_ && since_ < tuning_.refresh) return;
    posture_.set(q, nullptr);
    tell_noise();
    if (joint_tests_)
      for (SegmentTests& tests : tests_) tests.weigh(posture_, activity());
    since_ = 0.0;
    placed_ = true;
  }

  // What the noise figures let expect in each row, in this posture.
  void tell_noise() {
    told_.evaluate_variances(posture_);
    noisy_ = false;
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const std::size_t at = i * (rows_.size() + 1);
      const double K = rows_.bandwidths[i], kept = std::min(1.0, 0.5 * K * settings_.noise.period);
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
  void read_segment(std::size_t g, const double* qd) {
    const RowLayout& layout = observer_.row_layout();
    const double *settled = row_ + layout.joint_settled(), *torque = row_ + layout.segment_torque(),
                 *joint_gap = row_ + layout.joint_gap_std(),
                 *gap = row_ + layout.segment_gap_std() + 2 * g;
    double wrench[6], load[6] = {};  // innovations that no test asks for
    bool known = false, off = false;
    for (const std::size_t i : rows_.of(g)) {
      const DetectionRow& row = rows_[i];
      RowSample& s = rows_.samples[i];
      if (row.component < 0) {
        s.known = settled[row.joint] > 0.0;
        s.residual = torque[row.joint];
        s.innovation = observer_.own_innovation(row.joint);
        s.gap_std = joint_gap[row.joint];
        s.slowest = least_speed(s.speed, qd[row.joint]);
        s.speed = qd[row.joint];
      } else {
        if (i == rows_.first(g)) known = read_wrench(g, wrench, load);
        s.known = known;
        s.residual = wrench[row.component];
        s.innovation = load[row.component];
        s.gap_std = gap[row.component < 3 ? 0 : 1];
      }
      s.known = s.known && std::isfinite(s.residual);
      rows_.residuals[i] = s.residual;
      rows_.known[i] = s.known ? 1.0 : 0.0;
      off = off || offsets_.shown(i) > row.contact || meters_.contradicts(i, tuning_);
      if (!std::isfinite(s.innovation)) s.innovation = s.residual;  // samples were lost
    }
    rows_.off[g] = (off || friction_.has_turned(g)) && fires_[g];
  }

  // The least size of a speed on its way from one sample to the next: what begins between two samples may
  // have begun with it.
  static double least_speed(double before, double now) {
    return before * now < 0.0 ? 0.0 : std::min(std::fabs(now), std::fabs(before));
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

  // Has the arm shown that a segment is not as told, and moves? Then what is seen of its rows counts.
  bool learns(std::size_t g) const { return rows_.off[g] != 0 && motion_.moves(); }

  // How much has been seen of a segment's noise? The first moments show whether there is more than told.
  Seen seen(std::size_t g) const {
    if (looks_over_ < rows_.size()) {
      for (const std::size_t i : rows_.of(g))
        if (rows_.samples[i].known && !first_looks_[i].ready(tuning_)) return Seen::little;
    }
    return ages_[g] < tuning_.confirm / rows_.slowest(g) ? Seen::some : Seen::enough;
  }

  // What the rows of a segment share in its scores.
  struct RowScore {
    double slow = 0.0;                         // the largest share of its rows' trends
    double sum = 0.0;                          // of the squares of all shares
    double borne = 0.0, borne_sum = 0.0;  // the largest, and the sum, of what no single sample moves
  };

  void test_row(std::size_t i, bool learns, SegmentScore& score, RowScore& rows) {
    const DetectionRow& row = rows_[i];
    RowSample& sample = rows_.samples[i];
    rows_.normalized[i] = rows_.shares[i] = 0.0;
    if (!sample.known) return;
    if (!offsets_.started(i)) offsets_.begin(i, sample.residual);
    const double baseline = offsets_.baseline(i);
    sample.offset = baseline;
    sample.reference = offsets_.reference(i);
    sample.referred = offsets_.referred(i);
    const double spread = shown_by_motion_[i] =
        std::max(learns && row.seen > 0.0 ? drift_.shown(i) : 0.0,
                 tuning_.friction_margin * friction_.added(i));
    const double limit = rows_.limits[i] = largest_noise(i, spread) / row.contact;
    const double normalized = rows_.normalized[i] = (sample.residual - baseline) / row.contact;
    const double x = normalized / limit;
    const double share = rows_.shares[i] = std::fabs(x);
    if (loadable_[i] == 0) return;
    score.peak = std::max(score.peak, share);
    if (!motion_.moves()) rows.slow = std::max(rows.slow, slow_share(i));
    const double borne = (borne_out_.value(i) - baseline) / (row.contact * limit);
    const double borne_share = std::fabs(borne);
    rows.borne = std::max(rows.borne, borne_share);
    if (!(spread > row.contact)) {
      rows.sum += x * x;
      rows.borne_sum += borne * borne;
    }
    const double least = collision_shares_[i];
    score.collision = std::max(score.collision, share * least);
    score.borne_collision = std::max(score.borne_collision, borne_share * least);
  }

  // What lasts of a row, in what the noise of its trend lets expect. Noise of velocities is nearly
  // white in the residual and dies out in the trend, so that this finds weak loads that last. Of an
  // arm that stands: of one that moves the model's errors are larger than noise.
  double slow_share(std::size_t i) const {
    const DetectionRow& row = rows_[i];
    if (row.seen <= 0.0 || !fires_[row.segment] || rows_.samples[i].gap_std > 0.0) return 0.0;
    const double now = rows_.samples[i].residual - offsets_.baseline(i), mean = offsets_.lasting(i);
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
    const double gap = rows_.samples[i].gap_std;
    return gap > 0.0 ? std::hypot(most, tuning_.gap_sigmas * gap) : most;
  }

  // The statistics of all tests, and the largest in thresholds.
  void judge(std::size_t g, double dt) {
    SegmentScore& s = scores_[g] = {};
    RowScore rows;
    const bool moves_off = learns(g);
    for (const std::size_t i : rows_.of(g)) test_row(i, moves_off, s, rows);
    s.age = ages_[g];
    s.seen = seen(g);
    if (joint_tests_ && placed_) {
      double most = std::numeric_limits<double>::infinity();
      for (const TestSetting& setting : settings_.tests) {
        if (setting.test == Test::cusum) most = tuning_.cusum_most * setting.limits[g];
      }
      tests_[g].step(&rows_.samples[rows_.first(g)], dt, gap_, levels_.adapts(g, s.peak), activity(),
                     most);
    }
    for (std::size_t t = 0; t < settings_.tests.size(); ++t) {
      const TestSetting& setting = settings_.tests[t];
      double& statistic = statistics_[g * settings_.tests.size() + t];
      const double sum = std::sqrt(rows.sum / settings_.sum_limits[g]);
      const bool of_rows = setting.test == Test::rows;
      statistic = of_rows   ? std::max({s.peak, rows.slow, sum})
                  : placed_ ? tests_[g].statistic(setting.test)
                            : 0.0;
      s.score = std::max(s.score, statistic / setting.limits[g]);
      const double borne_sum = std::sqrt(rows.borne_sum / settings_.sum_limits[g]);
      const double borne = of_rows ? std::max({rows.borne, rows.slow, borne_sum}) : statistic;
      s.borne = std::max(s.borne, borne / setting.limits[g]);
    }
  }

  // Follows what stands on all rows: side by side, but for what happens to few of them and rarely.
  void follow_offsets(double dt) {
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      const double adapts = levels_.adapts(g, scores_[g].peak) ? 1.0 : 0.0,
                   quiet = levels_.is_quiet(g) ? 1.0 : 0.0;
      for (const std::size_t i : rows_.of(g)) {
        adapts_[i] = adapts;
        counts_[i] = quiet;
      }
    }
    const bool confirmed = offsets_.follow_trends(adapts_, counts_, dt);
    const bool looking = dt > 0.0 && looks_over_ < rows_.size();
    const bool stopped = motion_.has_stopped(dt);
    for (std::size_t g = 0; g < rows_.segments(); ++g) {
      const bool felt = levels_.is_felt(g), pending = levels_.is_pending(g);
      const bool begins = levels_.is_beginning(g);
      const bool learns_now =
          learns(g) && dt > 0.0 && (felt ? begins : !levels_.steps(g));
      const bool rests = stopped && rows_.off[g] != 0;
      const bool usual = !(confirmed || looking || learns_now || felt || begins || rests || pending);
      for (const std::size_t i : rows_.of(g)) {
        averages_[i] = rows_.known[i];
        if (usual || !rows_.samples[i].known) continue;
        if (offsets_.is_to_confirm(i)) confirm_start(i);
        if (learns_now && rows_[i].seen > 0.0) {
          drift_.learn(i, rows_.samples[i].residual - offsets_.baseline(i), dt, begins);
          shown_by_motion_[i] = std::max(shown_by_motion_[i], drift_.shown(i));
        }
        if (looking) look(i);
        if (rests && !felt && rows_[i].seen > 0.0) {
          offsets_.rest(i);
          friction_.rest(i);
        }
        // In the first moments what noise beyond the told one can bring is averaged, too: one sample of
        // it is no baseline.
        const bool noise = first_looks_[i].ratio() > 1.0 && seen(g) != Seen::enough &&
                           scores_[g].score < tuning_.unseen;
        if (felt || begins || (pending && !noise)) averages_[i] = 0.0;
      }
    }
    offset_ = offsets_.follow_baselines(averages_, shown_by_motion_, dt);
    friction_.average(averages_, dt);
  }

  // What places are found from.
  void tell_places() {
    known_for_ = offsets_.quiet();
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      placing_[i] = rows_.normalized[i];
      const double share = drift_.lately_share(i);
      if (!rows_.samples[i].known || !(share > 0.0)) continue;
      placing_[i] -= share * (offsets_.reference(i) - offsets_.baseline(i)) / rows_[i].contact;
      double& known_for = known_for_[rows_[i].segment];
      known_for = std::min(known_for, offsets_.referred(i));
    }
  }

  // The first moments of a row's noise.
  void look(std::size_t i) {
    if (first_looks_[i].over()) return;
    // Third differences of slow samples are reached by hands: there the first few are all.
    const bool enough = calm_.is_late(rows_[i].segment) && first_looks_[i].ready(tuning_);
    if (enough) first_looks_[i].end();
    if (!enough) first_looks_[i].add(rows_.samples[i].residual, tuning_);
    if (first_looks_[i].over()) ++looks_over_;
  }

  void confirm_start(std::size_t i) {
    const double stood = offsets_.confirm(i);
    if (stood != 0.0) standing_[i].start = stood;
  }

  DetectorTuning tuning_;
  const Observer& observer_;
  DetectionSettings settings_;
  DetectorRows rows_;
  Posture posture_;
  RowCovariance told_;
  ActivityMeter motion_;
  RowOffsets offsets_;
  FrictionSeen friction_;
  SegmentLevels levels_;
  ModelDrift drift_;
  BorneOut borne_out_;
  CalmValues calm_;
  NoiseMeter meters_, trend_meters_;  // of the residuals, of their trends
  std::vector<FirstLook> first_looks_;  // per row
  std::size_t looks_over_ = 0;          // rows of which the first moments are over
  std::vector<double> collision_shares_;  // per row: its threshold, in those of a collision
  // Of the sample, per row: may references be followed; does it count as noise; are baselines averaged;
  // what motion alone shows [N or Nm].
  RowLanes adapts_, counts_, averages_, shown_by_motion_;
  std::vector<double> ages_;  // per segment: since its first settled sample [s]
  std::vector<char> fires_;   // per segment: can a test fire, or are statistics all that is asked for?
  std::vector<SegmentScore> scores_;  // per segment: of the sample
  std::vector<SegmentTests> tests_;   // per segment
  std::vector<double> excess_;
  std::vector<Standing> standing_;  // per row
  std::vector<char> loadable_;      // per row: can a contact load it?
  std::vector<double> statistics_;
  std::vector<double> placing_, known_for_;  // for places, see `placing`
  const double* row_ = nullptr;
  double time_ = 0.0, since_ = 0.0;
  bool timed_ = false, placed_ = false, gap_ = false, joint_tests_ = false, sound_ = false;
  bool offset_ = false, noisy_ = false;
};

}  // namespace touchline
