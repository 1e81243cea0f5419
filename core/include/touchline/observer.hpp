// SPDX-License-Identifier: Apache-2.0
// The extended momentum observer (Iskandar et al., ICRA 2021, eqs. 11-18) without matrices: the
// generalized momentum of a sensor's locked virtual joint is the spatial momentum of everything
// outboard of it. No allocation, lock, exception or output in `step` and `run`.
#pragma once

#include <algorithm>
#include <array>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/channels.hpp"
#include "touchline/clock.hpp"
#include "touchline/filter.hpp"
#include "touchline/health.hpp"
#include "touchline/layout.hpp"
#include "touchline/projections.hpp"
#include "touchline/row.hpp"
#include "touchline/signals.hpp"
#include "touchline/terms.hpp"
#include "touchline/tree.hpp"

namespace touchline {

// One sample as the robot reports it: q, qd, tau have one number per joint, wrench six per sensor;
// NaN where not measured.
struct Sample {
  double time;
  const double *q, *qd, *tau, *wrench;
};

class Observer {
 public:
  Observer(Tree tree, std::vector<JointRow> joints, std::vector<SensorRow> sensors,
           Method method = Method::segment,
           Discretization discretization = Discretization::automatic)
      : tree_(std::move(tree)),
        joints_(std::move(joints)),
        sensors_(std::move(sensors)),
        layout_(tree_, joints_, sensors_),
        channels_(layout_, joints_, sensors_, method, discretization),
        terms_(tree_, layout_, joints_, sensors_, local_rows()),
        packed_(tree_, layout_, joints_, sensors_, local_rows()),
        projections_(layout_, terms_.at()),
        row_{count(joints_), count(sensors_), count(layout_.segments)},
        writer_(row_, layout_, sensors_, method),
        frames_((kLanes + 1) * terms_.at().width(), 0.0),
        poses_(sensors_.size()),
        packed_q_(2 * joints_.size()),
        output_(row_.width(), kNaN) {
    for (int i = 0; i < kLanes; ++i) ahead_[i] = frames_.data() + i * terms_.at().width();
    before_ = frames_.data() + kLanes * terms_.at().width();
  }
  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;

  // Takes one sample; returns a row of `row_layout().width()` numbers, valid until the next call.
  const double* step(double time, const double* q, const double* qd, const double* tau,
                     const double* wrench) {
    terms_.evaluate(q, qd, ahead_.data());
    advance({time, q, qd, tau, wrench}, ahead_[0], output_.data(), output_.data());
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
    clock_ = Clock{};
    forget();
  }

  const RowLayout& row_layout() const { return row_; }
  const Layout& layout() const { return layout_; }
  const Tree& tree() const { return tree_; }
  const std::vector<double>& output() const { return output_; }
  double time() const { return now_.time; }  // of the last accepted sample
  const Pose& sensor_pose(int s) const { return poses_[s]; }
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

  void forget() {
    channels_.balances.forget();
    channels_.filters.forget();
    now_ = Instant{};
    started_ = false;
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
    const double* now = before_;
    const double* earlier = terms;
    channels_.balances.begin(now_);
    channels_.filters.begin(now_);
    for (int j = 0; j < row_.joints; ++j) take_joint(j, sample, now, health);
    for (int s = 0; s < row_.sensors; ++s) take_sensor(s, sample.wrench + 6 * s, now, health);
    for (int g = 0; g < row_.segments; ++g) take_segment(g);
    channels_.balances.balance();
    projections_.project(channels_, earlier, now);
    decide();
    channels_.filters.run();
    writer_.write(channels_, now_, poses_, health, out);
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
    now_ = {sample.time, now_.time, clock_.max_gap()};
    return true;
  }

  Health judge_state(const Sample& sample) const {
    Health health = judge_all(sample.q, row_.joints) | judge_all(sample.qd, row_.joints);
    constexpr double tolerance = 0.01;  // rad or m: encoders and hard stops differ by less
    bool outside = false;
    for (int j = 0; j < row_.joints; ++j) {
      outside |= sample.q[j] < joints_[j].lower - tolerance;
      outside |= sample.q[j] > joints_[j].upper + tolerance;
    }
    return outside ? health | kModelLimit : health;
  }

  void take_joint(std::size_t j, const Sample& sample, const double* terms, Health& health) {
    const JointRow& joint = joints_[j];
    Balances& balances = channels_.balances;
    const std::size_t group = channels_.joint(j);
    const Health own = joint.measured() ? judge(sample.tau[j]) : kMissing;
    if (joint.measured()) health |= own;
    if (own != 0) return balances.skip(group);
    const double tau = read_torque(joint, sample.tau[j], sample.qd[j], health);
    balances.take(group, now_);
    // With its whole model taken out by the driver, the reading is minus the external torque.
    const bool model = joint.compensated == Compensated::model;
    *balances.p(group) = model ? 0.0 : terms[terms_.at().joint_momentum() + j];
    *balances.u(group) = model ? tau : tau - terms[terms_.at().joint_bias() + j];
  }

  void take_sensor(std::size_t s, const double* logged, const double* terms, Health& health) {
    const SensorRow& sensor = sensors_[s];
    Balances& balances = channels_.balances;
    const std::size_t group = channels_.sensor(s);
    const bool local = channels_.kind(s) == Channels::SensorFilter::local;
    const double* block = terms + terms_.at().sensor(s);
    poses_[s] = {load_rotation(block + TermsLayout::kRotation),
                 load_vector(block + TermsLayout::kPosition)};
    Health own = 0;
    const Spatial reading = read_wrench(
        sensor, poses_[s].R, load_rotation(block + TermsLayout::kLogRotation), logged, own);
    health |= own;
    if ((own & (kMissing | kNonFinite)) != 0) {
      if (!now_.in_reach(balances.group(group).time)) health |= kSensorExcluded;
      balances.skip(group);
      if (local) balances.skip(channels_.local(s));
      return;
    }
    balances.take(group, now_);
    const Spatial weight =
        sensor.gravity_compensated ? Spatial{} : load(block + TermsLayout::kWeight);
    std::copy_n(block + TermsLayout::kMomentum, 6, balances.p(group));
    store(wrench_to_parent(poses_[s], reading) + weight, balances.u(group));
    if (local) take_local(s, reading, block);
  }

  // The sensor's row in its own frame.
  void take_local(std::size_t s, const Spatial& reading, const double* block) {
    const std::size_t group = channels_.local(s);
    channels_.balances.take(group, now_);
    std::copy_n(block + TermsLayout::kLocalMomentum, 6, channels_.balances.p(group));
    store(reading - load(block + TermsLayout::kLocalBias), channels_.balances.u(group));
  }

  // A segment's momentum and load: those of its sensor without those of the next ones outboard.
  void take_segment(std::size_t g) {
    const Segment& segment = layout_.segments[g];
    Balances& balances = channels_.balances;
    bool usable = segment.sensor >= 0 && sensor_balance(segment.sensor).present;
    for (int t : segment.successors) usable = usable && sensor_balance(t).present;
    const std::size_t group = channels_.segment(g);
    if (!usable) return balances.skip(group);
    balances.take(group, now_);
    double *p = balances.p(group), *u = balances.u(group);
    std::copy_n(balances.p(channels_.sensor(segment.sensor)), 6, p);
    std::copy_n(balances.u(channels_.sensor(segment.sensor)), 6, u);
    for (int t : segment.successors) {
      const double *pt = balances.p(channels_.sensor(t)), *ut = balances.u(channels_.sensor(t));
      for (int i = 0; i < 6; ++i) p[i] -= pt[i];
      for (int i = 0; i < 6; ++i) u[i] -= ut[i];
    }
  }
  const Balances::Group& sensor_balance(std::size_t s) const {
    return channels_.balances.group(channels_.sensor(s));
  }

  // What each filter does with this sample.
  void decide() {
    for (int j = 0; j < row_.joints; ++j) {
      if (joints_[j].torque == Torque::from) {
        decide_source(j);
      } else {
        decide_joint(j);
      }
    }
    for (int g = 0; g < row_.segments; ++g)
      follow(channels_.segment_filter(g), channels_.segment(g));
    for (int s = 0; s < row_.sensors; ++s) {
      const Channels::SensorFilter kind = channels_.kind(s);
      if (kind == Channels::SensorFilter::none) continue;
      const bool local = kind == Channels::SensorFilter::local;
      follow(channels_.sensor_filter(s), local ? channels_.local(s) : channels_.sensor(s));
    }
  }

  void follow(std::size_t filter, std::size_t balance) {
    const Balances::Group& group = channels_.balances.group(balance);
    std::copy_n(channels_.balances.e(balance), group.count, channels_.filters.input(filter));
    channels_.filters.follow(filter, group, now_);
  }

  void decide_joint(std::size_t j) {
    const std::size_t balance = channels_.joint(j);
    follow(channels_.external(j), balance);
    // All that touches the joint's own segment; all that touches between it and the sensor inboard.
    const auto &outboard = layout_.outboard_sensors[j], &inboard = layout_.inboard_sensors[j];
    subtract(channels_.own(j), balance, outboard);
    if (!inboard.empty()) subtract(channels_.parity(j), balance, inboard);
  }

  // Filters the difference of a joint's innovation and what sensors' innovations explain of it.
  void subtract(std::size_t filter, std::size_t balance, const std::vector<Projection>& pairs) {
    const Balances::Group& joint = channels_.balances.group(balance);
    const double e = *channels_.balances.e(balance) - projections_.sum(pairs);
    *channels_.filters.input(filter) = e;
    const bool begun = joint.fresh;
    channels_.filters.act(filter, decide(filter, joint.present, begun, joint.regular, pairs), now_);
  }

  // A joint without a torque sensor: what the named sensors' loads do to it.
  void decide_source(std::size_t j) {
    const auto& pairs = layout_.source_sensors[j];
    const std::size_t filter = channels_.external(j);
    const double e = projections_.sum(pairs);
    const Action action = decide(filter, true, true, true, pairs);
    *channels_.filters.input(filter) = e;
    channels_.balances.set_e(channels_.joint(j), action == Action::filter ? e : kNaN);
    channels_.filters.act(filter, action, now_);
  }

  // Innovations are compared only where all of them span the interval from the sample before.
  Action decide(std::size_t filter, bool present, bool fresh, bool regular,
                const std::vector<Projection>& pairs) const {
    for (const Projection& pair : pairs) {
      const Balances::Group& sensor = sensor_balance(pair.sensor);
      present = present && sensor.present;
      regular = regular && sensor.regular;
    }
    if (!present) return Action::absent;
    if (!fresh || !now_.in_reach(channels_.filters.group(filter).time)) return Action::restart;
    return regular ? Action::filter : Action::hold;
  }

  const Tree tree_;
  const std::vector<JointRow> joints_;
  const std::vector<SensorRow> sensors_;
  const Layout layout_;
  Channels channels_;
  Terms<double> terms_;
  Terms<Lanes> packed_;
  Projections projections_;
  const RowLayout row_;
  const RowWriter writer_;
  std::vector<double> frames_;           // terms of the sample before and of those at work
  std::array<double*, kLanes> ahead_{};
  double* before_ = nullptr;
  std::vector<Pose> poses_;              // of the sensors in world
  std::vector<Lanes> packed_q_;          // positions, then velocities
  std::vector<double> output_;
  Clock clock_;
  Instant now_;
  bool started_ = false;
};

}  // namespace touchline
