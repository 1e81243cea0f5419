// SPDX-License-Identifier: Apache-2.0
// The extended momentum observer (Iskandar et al., ICRA 2021, eqs. 11-18) without matrices: the
// generalized momentum of a sensor's locked virtual joint is the spatial momentum of everything
// outboard of it. No allocation, lock, exception or output in `step` and `run`.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/model/tree.hpp"
#include "touchline/detail/observer/channels.hpp"
#include "touchline/detail/observer/clock.hpp"
#include "touchline/detail/observer/filter.hpp"
#include "touchline/detail/observer/health.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/projections.hpp"
#include "touchline/detail/observer/readings.hpp"
#include "touchline/detail/observer/row.hpp"
#include "touchline/detail/observer/signals.hpp"
#include "touchline/detail/observer/terms.hpp"
#include "touchline/detail/observer/tuning.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class Observer {
 public:
  Observer(Tree tree, std::vector<JointRow> joints, std::vector<SensorRow> sensors,
           Method method = Method::segment,
           Discretization discretization = Discretization::automatic,
           const ObserverTuning& tuning = {})
      : tree_(std::move(tree)),
        joints_(std::move(joints)),
        sensors_(std::move(sensors)),
        layout_(tree_, joints_, sensors_),
        channels_(layout_, joints_, sensors_, method, discretization, tuning),
        terms_(tree_, layout_, joints_, sensors_, local_rows()),
        packed_(tree_, layout_, joints_, sensors_, local_rows()),
        projections_(layout_, terms_.at()),
        torques_(joints_),
        wrenches_(sensors_.begin(), sensors_.end()),
        row_{count(joints_), count(sensors_), count(layout_.segments)},
        writer_(row_, terms_.at(), layout_, sensors_, method),
        frames_((kLanes + 1) * terms_.at().width(), 0.0),
        packed_q_(2 * joints_.size()),
        sensor_present_(sensors_.size(), 0),
        output_(row_.width(), kNaN),
        clock_(tuning) {
    for (int i = 0; i < kLanes; ++i) ahead_[i] = frames_.data() + i * terms_.at().width();
    before_ = frames_.data() + kLanes * terms_.at().width();
    const double tolerance = tuning.limit_tolerance;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      lower_.push_back(joints_[j].lower - tolerance);
      upper_.push_back(joints_[j].upper + tolerance);
      find_projections(j);
    }
  }
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;

  // Takes one sample; returns a row of `row_layout().width()` numbers, valid until the next call.
  const double* step(double time, const double* q, const double* qd, const double* tau,
                     const double* wrench) {
    return step({time, q, qd, tau, wrench});
  }
  const double* step(const Sample& sample) {
    terms_.evaluate(sample.q, sample.qd, ahead_.data());
    advance(sample, ahead_[0], output_.data(), output_.data());
    return output_.data();
  }

  // Takes N samples, whose signals stand one after the other in each array; writes N rows and
  // calls `each(row)` after each. The numbers are those of `step`, to the last bit.
  template <class Each>
  void run(std::size_t samples, const double* time, const double* q, const double* qd,
           const double* tau, const double* wrench, double* out, Each&& each) {
    const std::size_t n = joints_.size(), w = 6 * sensors_.size(), width = output_.size();
    const double* last = output_.data();
    for (std::size_t i = 0; i < samples; ++i) {
      const std::size_t k = i % kLanes;
      if (k == 0) look_ahead(samples - i, q + i * n, qd + i * n);
      advance({time[i], q + i * n, qd + i * n, tau + i * n, wrench + i * w}, ahead_[k], last, out);
      each(static_cast<const double*>(out));
      last = out;
      out += width;
    }
    if (samples > 0) std::copy_n(last, width, output_.begin());
  }

  void run(std::size_t samples, const double* time, const double* q, const double* qd,
           const double* tau, const double* wrench, double* out) {
    run(samples, time, q, qd, tau, wrench, out, [](const double*) {});
  }

  // Forgets everything: the next sample starts anew.
  void reset() {
    clock_.forget();
    forget();
  }

  const RowLayout& row_layout() const { return row_; }
  const Layout& layout() const { return layout_; }
  const Tree& tree() const { return tree_; }
  const std::vector<JointRow>& joints() const { return joints_; }
  const std::vector<SensorRow>& sensors() const { return sensors_; }
  const std::vector<double>& output() const { return output_; }
  double time() const { return now_.time; }  // of the last accepted sample
  // Steps in time beyond this [s] are gaps.
  double max_gap() const { return clock_.usual_step(); }
  // Of sensor s in world, at the last accepted sample.
  Pose sensor_pose(int s) const {
    return load_pose(before_ + terms_.at().sensor(s) + TermsLayout::kPose);
  }
  // External torque that contacts on its own segment put on joint j, mean over the last interval,
  // not filtered; 0 where it is not known.
  double own_innovation(std::size_t j) const { return channels_.filters.input(channels_.own(j))[0]; }
  // The model's terms alone, for a state of its own.
  Terms<double>& terms() { return terms_; }

 private:
  template <class T>
  static int count(const std::vector<T>& v) {
    return static_cast<int>(v.size());
  }

  std::vector<char> local_rows() const {
    std::vector<char> local;
    for (std::size_t s = 0; s < sensors_.size(); ++s)
      local.push_back(channels_.kind(s) == Channels::SensorFilter::local);
    return local;
  }

  void find_projections(std::size_t j) {
    const auto &inboard = layout_.inboard_sensors[j], &outboard = layout_.outboard_sensors[j];
    const bool own = joints_[j].measured(), parity = own && !inboard.empty();
    inboard_.push_back(parity ? projections_.at(inboard[0]) : projections_.unknown());
    outboard_.push_back(!own              ? projections_.unknown()
                        : outboard.empty() ? projections_.zero()
                                           : projections_.at(outboard[0]));
    if (own && outboard.size() > 1) forks_.push_back(j);
    if (parity && inboard.size() > 1) branches_.push_back(j);
    if (joints_[j].torque == Torque::from) sources_.push_back(j);
  }

  void forget() {
    channels_.balances.forget();
    channels_.filters.forget();
    now_ = Instant{};
    started_ = steady_ = false;
  }

  // The terms of the next samples, side by side if there are enough of them.
  void look_ahead(std::size_t left, const double* q, const double* qd) {
    const std::size_t n = joints_.size();
    if (left < kLanes) {
      for (std::size_t k = 0; k < left; ++k)
        terms_.evaluate(q + k * n, qd + k * n, ahead_.data() + k);
      return;
    }
    for (std::size_t j = 0; j < n; ++j) {
      for (int k = 0; k < kLanes; ++k) {
        set_lane(packed_q_[j], k, q[k * n + j]);
        set_lane(packed_q_[n + j], k, qd[k * n + j]);
      }
    }
    packed_.evaluate(packed_q_.data(), packed_q_.data() + n, ahead_.data());
  }

  // The sequential part of a step. `terms`: those of the sample, exchanged for room for others;
  // `last`: the row before, which stays where a sample is refused.
  void advance(const Sample& sample, double*& terms, const double* last, double* out) {
    Health health = 0;
    if (!accept(sample, health, last, out)) return;
    std::swap(terms, before_);
    const double *now = before_, *earlier = terms;
    const std::size_t joint = channels_.joint(0), sensor = channels_.sensor(0);
    channels_.balances.begin(now_);
    channels_.filters.begin(now_);
    const bool complete = read(sample, now, health);
    // As long as all signals are there at all samples, nothing needs to be kept by channel.
    const bool usual = now_.usual(now_.before);
    const bool steady = steady_ && complete && usual && !channels_.filters.doubtful();
    if (!steady) {
      if (!usual && now_.before == now_.before) health |= kGap;
      book(health);
      if (channels_.balances.bridged()) compare_loads(earlier, now);
    }
    channels_.balances.balance();
    if (!steady) channels_.balances.blank();
    projections_.project(earlier, now, channels_.balances.e(sensor));
    compare(channels_.balances.e(joint));
    if (!steady) channels_.decide(now_);
    channels_.filters.run();
    writer_.write(channels_, now_, steady, now, health, out);
  }

  // Is the sample one to go on with? If not, the row is written.
  bool accept(const Sample& sample, Health& health, const double* last, double* out) {
    const Clock::Verdict verdict = clock_.take(sample.time, health);
    if (verdict == Clock::Verdict::refused) {
      if (last != out) std::copy_n(last, output_.size(), out);
      writer_.write_health(health, out);
      return false;
    }
    if (verdict == Clock::Verdict::set_back) forget();
    const Health state = judge_state(sample);
    health |= state;
    if ((state & (kMissing | kNonFinite)) != 0) {
      writer_.write_nothing(health | (started_ ? 0 : kSettling), out);
      return false;
    }
    started_ = true;
    now_ = {sample.time, now_.time, clock_.period(), clock_.usual_step()};
    return true;
  }

  Health judge_state(const Sample& sample) const {
    const Health health = judge_all(sample.q, lower_.size()) | judge_all(sample.qd, lower_.size());
    if (health != 0) return health;
    bool inside = true;
    for (std::size_t j = 0; j < lower_.size(); ++j)
      inside &= (sample.q[j] >= lower_[j]) & (sample.q[j] <= upper_[j]);
    return inside ? 0 : kModelLimit;
  }

  // Fills the rows of the balances; returns whether all signals are usable.
  bool read(const Sample& sample, const double* terms, Health& health) {
    Balances& balances = channels_.balances;
    const TermsLayout& at = terms_.at();
    std::copy_n(terms + at.joint_momentum(), at.joints, balances.p(channels_.joint(0)));
    bool complete = torques_.read(sample.tau, sample.qd, terms + at.joint_bias(),
                                  balances.u(channels_.joint(0)), health);
    for (std::size_t s = 0; s < at.sensors; ++s) {
      Health own = 0;
      read_sensor(s, sample.wrench + 6 * s, terms + at.sensor(s), own);
      sensor_present_[s] = (own & (kMissing | kNonFinite)) == 0;
      complete &= sensor_present_[s] != 0;
      health |= own;
    }
    for (int g = 0; g < row_.segments; ++g) {
      if (layout_.segments[g].sensor >= 0) read_segment(g);
    }
    return complete;
  }

  void read_sensor(std::size_t s, const double* logged, const double* terms, Health& health) {
    Balances& balances = channels_.balances;
    const Pose pose = load_pose(terms + TermsLayout::kPose);
    const Spatial reading = wrenches_[s].read(
        logged, pose.R, load_rotation(terms + TermsLayout::kLogRotation), health);
    const Spatial weight =
        sensors_[s].gravity_compensated ? Spatial{} : load(terms + TermsLayout::kWeight);
    std::copy_n(terms + TermsLayout::kMomentum, 6, balances.p(channels_.sensor(s)));
    store(wrench_to_parent(pose, reading) + weight, balances.u(channels_.sensor(s)));
    if (channels_.kind(s) != Channels::SensorFilter::local) return;
    std::copy_n(terms + TermsLayout::kLocalMomentum, 6, balances.p(channels_.local(s)));
    store(reading - load(terms + TermsLayout::kLocalBias), balances.u(channels_.local(s)));
  }

  // A segment's momentum and load: those of its sensor without those of the next ones outboard.
  void read_segment(std::size_t g) {
    const Segment& segment = layout_.segments[g];
    Balances& balances = channels_.balances;
    double *p = balances.p(channels_.segment(g)), *u = balances.u(channels_.segment(g));
    std::copy_n(balances.p(channels_.sensor(segment.sensor)), 6, p);
    std::copy_n(balances.u(channels_.sensor(segment.sensor)), 6, u);
    for (int t : segment.successors) {
      const double *pt = balances.p(channels_.sensor(t)), *ut = balances.u(channels_.sensor(t));
      for (int i = 0; i < 6; ++i) p[i] -= pt[i];
      for (int i = 0; i < 6; ++i) u[i] -= ut[i];
    }
  }

  // Not the usual step: who has values, since when, and who not.
  void book(Health& health) {
    if (steady_) {
      channels_.balances.catch_up(now_);
      channels_.filters.catch_up(now_);
    }
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const bool lost = !now_.usual(channels_.balances.group(channels_.sensor(s)).time);
      if (!sensor_present_[s] && lost) health |= kSensorExcluded;
    }
    steady_ = channels_.book(torques_.present(), sensor_present_, now_);
  }

  // How much the known loads of all filters have changed over a gap.
  void compare_loads(const double* earlier, const double* now) {
    channels_.balances.compare_loads();
    projections_.project(earlier, now, channels_.balances.e(channels_.sensor(0)));
    compare(channels_.balances.e(channels_.joint(0)));
    channels_.filters.take_load_changes();
  }

  // The inputs of all filters, from the innovations of all balances.
  void compare(double* e) {
    Filters& filters = channels_.filters;
    const double* projected = projections_.values();
    for (std::size_t j : sources_) e[j] = sum(layout_.source_sensors[j]);
    double* external = filters.input(channels_.external(0));
    double *own = filters.input(channels_.own(0)), *parity = filters.input(channels_.parity(0));
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      external[j] = e[j];
      own[j] = e[j] - projected[outboard_[j]];
      parity[j] = e[j] - projected[inboard_[j]];
    }
    for (std::size_t j : forks_) own[j] = e[j] - sum(layout_.outboard_sensors[j]);
    for (std::size_t j : branches_)  // what loads the sensor, but neither the joint nor its segment
      parity[j] += sum(layout_.inboard_sensors[j]) - projected[inboard_[j]];
    std::copy_n(channels_.balances.e(channels_.segment(0)), 6 * row_.segments,
                filters.input(channels_.segment_filter(0)));
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const Channels::SensorFilter kind = channels_.kind(s);
      if (kind == Channels::SensorFilter::none) continue;
      const bool local = kind == Channels::SensorFilter::local;
      std::copy_n(channels_.balances.e(local ? channels_.local(s) : channels_.sensor(s)), 6,
                  filters.input(channels_.sensor_filter(s)));
    }
  }

  double sum(const std::vector<Projection>& pairs) const {
    double total = 0.0;
    for (const Projection& pair : pairs) total += projections_.values()[projections_.at(pair)];
    return total;
  }

  const Tree tree_;
  const std::vector<JointRow> joints_;
  const std::vector<SensorRow> sensors_;
  const Layout layout_;
  Channels channels_;
  Terms<double> terms_;
  Terms<Lanes> packed_;
  Projections projections_;
  JointReadings torques_;
  std::vector<SensorReading> wrenches_;
  std::vector<double> lower_, upper_;  // limits of the joints, with some tolerance
  const RowLayout row_;
  RowWriter writer_;
  std::vector<double> frames_;  // terms of the sample before and of those at work
  std::array<double*, kLanes> ahead_{};
  double* before_ = nullptr;
  std::vector<Lanes> packed_q_;  // positions, then velocities
  std::vector<char> sensor_present_;
  // Joints that are read from sensors; with several sensors outboard; with some on other branches.
  std::vector<std::size_t> sources_, forks_, branches_;
  std::vector<std::size_t> outboard_, inboard_;   // per joint: where its projections stand
  std::vector<double> output_;
  Clock clock_;
  Instant now_;
  bool started_ = false, steady_ = false;
};

}  // namespace touchline
