// SPDX-License-Identifier: Apache-2.0
// The extended momentum observer (Iskandar et al., ICRA 2021, eqs. 11-18) without matrices: the
// generalized momentum of a sensor's locked virtual joint is the spatial momentum of everything
// outboard of it. No allocation, lock, exception or output in `step`.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/filter.hpp"
#include "touchline/health.hpp"
#include "touchline/layout.hpp"
#include "touchline/signals.hpp"
#include "touchline/tree.hpp"

namespace touchline {

// `segment` filters the momentum of each segment in world axes: no ghost contact in motion.
// `paper` filters each residual in its own sensor frame and subtracts afterwards (18).
enum class Method { segment, paper };

// Where each output stands in a row of numbers, for n joints, k sensors and m segments.
struct RowLayout {
  int joints, sensors, segments;
  int tau_ext() const { return 0; }
  int segment_torque() const { return joints; }
  int parity() const { return 2 * joints; }
  int joint_innovation() const { return 3 * joints; }
  int sensor_wrench() const { return 4 * joints; }
  int segment_wrench() const { return sensor_wrench() + 6 * sensors; }
  int segment_innovation() const { return segment_wrench() + 6 * segments; }
  int joint_settled() const { return segment_innovation() + 6 * segments; }
  int segment_settled() const { return joint_settled() + joints; }
  int health() const { return segment_settled() + segments; }
  int width() const { return health() + 1; }
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
        row_{count(joints_), count(sensors_), count(layout_.segments)},
        method_(method),
        bandwidths_(discretization),
        joint_channels_(joints_.size()),
        sensor_channels_(sensors_.size()),
        segment_channels_(layout_.segments.size()),
        output_(row_.width(), kNaN) {
    for (int j = 0; j < row_.joints; ++j) {
      const int handle = bandwidths_.add(joints_[j].bandwidth);
      JointChannel& c = joint_channels_[j];
      c.external.bandwidth = c.own.bandwidth = c.parity.bandwidth = handle;
      c.subspaces.resize(joints_[j].nodes.size());
    }
    for (int s = 0; s < row_.sensors; ++s) {
      const int handle = bandwidths_.add(sensors_[s].bandwidth);
      sensor_channels_[s].total.bandwidth = sensor_channels_[s].local.bandwidth = handle;
      const int segment = layout_.segment_of_sensor[s];
      if (segment >= 0) segment_channels_[segment].filter.bandwidth = handle;
    }
  }

  Observer(const Observer&) = delete;
  Observer& operator=(const Observer&) = delete;

  // Takes one sample as the robot reports it: q, qd, tau have one number per joint, wrench six per
  // sensor; NaN where not measured. Returns a row of `row_layout().width()` numbers.
  const double* step(double time, const double* q, const double* qd, const double* tau,
                     const double* wrench) {
    Health health = 0;
    if (!accept_time(time, health)) {
      write_health(health);
      return output_.data();
    }
    const Health state = judge_state(q, qd);
    health |= state;
    if ((state & (kMissing | kNonFinite)) != 0) {
      std::fill(output_.begin(), output_.end(), kNaN);
      std::fill_n(output_.begin() + row_.joint_settled(), row_.joints + row_.segments, 0.0);
      write_health(health | (started_ ? 0 : kSettling));
      return output_.data();
    }
    started_ = true;
    ++now_.index;
    tree_.update(q, qd);
    for (int s = 0; s < row_.sensors; ++s) step_sensor(s, wrench + 6 * s, health);
    for (int g = 0; g < row_.segments; ++g) step_segment(g);
    for (int j = 0; j < row_.joints; ++j) step_joint(j, qd[j], tau[j], health);
    write(health);
    return output_.data();
  }

  // Forgets everything: the next sample starts anew.
  void reset() {
    // A balance with no sample behind it restarts the filters that follow it.
    for (JointChannel& c : joint_channels_) c.index = c.balance.index = -1;
    for (SensorChannel& c : sensor_channels_) c.total_balance.index = c.local_balance.index = -1;
    for (SegmentChannel& c : segment_channels_) c.balance.index = -1;
    now_ = Instant{};
    period_ = 0.0;
    started_ = timed_ = false;
  }

  const RowLayout& row_layout() const { return row_; }
  const Layout& layout() const { return layout_; }
  const Tree& tree() const { return tree_; }
  Tree& tree() { return tree_; }
  const std::vector<JointRow>& joints() const { return joints_; }
  const std::vector<SensorRow>& sensors() const { return sensors_; }
  const std::vector<double>& output() const { return output_; }
  double time() const { return now_.time; }

  // The wrench of segment g [N, Nm] in the frame of the sensor it begins at.
  Spatial local_segment_wrench(int g) const {
    const int sensor = layout_.segments[g].sensor;
    return wrench_to_child(tree_.state(sensors_[sensor].node).pose, segment_wrench_[g]);
  }

  // Momentum and n-bar (11, 12) of joint j; the tree must be up to date.
  void joint_terms(int j, double qd, double& p, double& n) const {
    p = n = 0.0;
    for (int node : joints_[j].nodes) {
      const NodeState& s = tree_.state(node);
      p += dot(s.subspace, s.momentum);
      n += dot(s.subspace, cross_force(s.twist, s.momentum) - tree_.gravity_wrench(node));
    }
    p += joints_[j].rotor_inertia * qd;
  }

  // Momentum and n-bar (11, 12) of sensor s, in the sensor's frame.
  void sensor_terms(int s, Spatial& p, Spatial& n) const {
    const int node = sensors_[s].node;
    const NodeState& state = tree_.state(node);
    p = wrench_to_child(state.pose, state.momentum);
    n = wrench_to_child(state.pose,
                        cross_force(state.twist, state.momentum) - tree_.gravity_wrench(node));
  }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kGapPeriods = 3.5;  // up to three samples may be lost

  struct JointChannel {
    Balance<double> balance;
    LowPass<double> external;  // all of the joint's external torque
    LowPass<double> own;       // without what the next sensors outboard see
    LowPass<double> parity;    // without what the sensor inboard sees
    std::vector<Spatial> subspaces;  // at the last instant, for the mean over an interval
    long index = -1;                 // of that instant
  };
  struct SensorChannel {
    bool usable = false;
    Spatial reading;  // in the sensor frame
    Balance<Spatial> total_balance, local_balance;  // world and sensor frame
    LowPass<Spatial> total, local;
  };
  struct SegmentChannel {
    Balance<Spatial> balance;
    LowPass<Spatial> filter;
  };

  template <class T>
  static int count(const std::vector<T>& v) {
    return static_cast<int>(v.size());
  }

  bool accept_time(double time, Health& health) {
    if (!std::isfinite(time)) {
      health |= kBadTime;
      return false;
    }
    if (timed_) {
      const double dt = time - now_.time;
      const double limit = kGapPeriods * period_;
      if (dt <= 0.0 && (dt >= -limit || period_ == 0.0)) {
        health |= kBadTime;
        return false;
      }
      if (dt < 0.0) {  // the clock was set back: begin anew at the new time
        reset();
        health |= kBadTime;
      } else if (period_ == 0.0) {
        period_ = dt;
      } else {
        if (dt > limit) health |= kGap;
        // Tends to the median whatever the jitter, and soon follows another rate.
        period_ *= dt > limit ? 1.25 : dt > period_ ? 1.05 : 1.0 / 1.05;
      }
    }
    now_.max_gap = period_ > 0.0 ? kGapPeriods * period_ : kInfinity;
    if ((health & kGap) != 0) now_.max_gap = 0.0;
    now_.time = time;
    timed_ = true;
    return true;
  }

  Health judge_state(const double* q, const double* qd) const {
    Health health = 0;
    constexpr double tolerance = 0.01;  // rad or m: encoders and hard stops differ by less
    for (int j = 0; j < row_.joints; ++j) {
      health |= judge(q[j]) | judge(qd[j]);
      if (q[j] < joints_[j].lower - tolerance || q[j] > joints_[j].upper + tolerance)
        health |= kModelLimit;
    }
    return health;
  }

  void step_sensor(int s, const double* logged, Health& health) {
    const SensorRow& sensor = sensors_[s];
    SensorChannel& c = sensor_channels_[s];
    Health own = 0;
    c.reading = read_wrench(sensor, tree_, logged, own);
    c.usable = (own & (kMissing | kNonFinite)) == 0;
    health |= own;
    if (!c.usable) {
      c.total_balance.skip();
      c.local_balance.skip();
      if (now_.time - c.total_balance.time > now_.max_gap) health |= kSensorExcluded;
    } else {
      const NodeState& node = tree_.state(sensor.node);
      const Spatial weight =
          sensor.gravity_compensated ? Spatial{} : tree_.gravity_wrench(sensor.node);
      const Spatial known = wrench_to_parent(node.pose, c.reading) + weight;
      c.total_balance.observe(node.momentum, known, now_);
      const Spatial moving = known - cross_force(node.twist, node.momentum);
      c.local_balance.observe(wrench_to_child(node.pose, node.momentum),
                              wrench_to_child(node.pose, moving), now_);
    }
    follow(c.total, c.total_balance, now_, bandwidths_);
    follow(c.local, c.local_balance, now_, bandwidths_);
  }

  void step_segment(int g) {
    const Segment& segment = layout_.segments[g];
    SegmentChannel& c = segment_channels_[g];
    bool usable = segment.sensor >= 0 && sensor_channels_[segment.sensor].usable;
    for (int t : segment.successors) usable = usable && sensor_channels_[t].usable;
    if (!usable) {
      c.balance.skip();
    } else {
      Spatial p = sensor_channels_[segment.sensor].total_balance.p;
      Spatial u = sensor_channels_[segment.sensor].total_balance.u;
      for (int t : segment.successors) {
        p = p - sensor_channels_[t].total_balance.p;
        u = u - sensor_channels_[t].total_balance.u;
      }
      c.balance.observe(p, u, now_);
    }
    follow(c.filter, c.balance, now_, bandwidths_);
  }

  void step_joint(int j, double qd, double logged, Health& health) {
    const JointRow& joint = joints_[j];
    JointChannel& c = joint_channels_[j];
    c.external.present = c.own.present = c.parity.present = false;
    c.balance.skip();
    if (joint.measured()) {
      const Health own = judge(logged);
      health |= own;
      if (own == 0) {
        observe_joint(j, qd, read_torque(joint, logged, qd, health));
        follow(c.external, c.balance, now_, bandwidths_);
        step_own(j);
        step_parity(j);
      }
    } else if (joint.torque == Torque::from) {
      step_from(j);
    }
    for (std::size_t i = 0; i < joint.nodes.size(); ++i)
      c.subspaces[i] = tree_.state(joint.nodes[i]).subspace;
    c.index = now_.index;
  }

  void observe_joint(int j, double qd, double tau) {
    const JointRow& joint = joints_[j];
    Balance<double>& balance = joint_channels_[j].balance;
    if (joint.compensated == Compensated::model) {  // the reading is minus the external torque
      balance.observe(0.0, tau, now_);
      return;
    }
    double p, n;
    joint_terms(j, qd, p, n);
    if (joint.compensated == Compensated::gravity) {
      for (int node : joint.nodes)
        n += dot(tree_.state(node).subspace, tree_.gravity_wrench(node));
    }
    balance.observe(p, tau - n, now_);
  }

  // Do the innovations of joint j and sensor s span the same interval, from the last sample on?
  bool comparable(int j, int s) const {
    const Balance<double>& a = joint_channels_[j].balance;
    const Balance<Spatial>& b = sensor_channels_[s].total_balance;
    return a.fresh && b.fresh && a.dt == b.dt && joint_channels_[j].index == now_.index - 1;
  }

  // One difference of innovations, each projected at its instant, and then filtered.
  void step_difference(LowPass<double>& filter, const Balance<double>& balance, double projected,
                       bool same_interval) {
    filter.present = balance.anchored;
    if (!balance.fresh || filter.stale(now_)) {
      filter.restart(now_);
    } else if (same_interval) {
      filter.step(balance.e - projected, now_, balance.dt, bandwidths_);
    }
  }

  // The torque by contacts on the joint's own segment.
  void step_own(int j) {
    JointChannel& c = joint_channels_[j];
    double projected = 0.0;
    bool same = true;
    for (const Projection& pair : layout_.outboard_sensors[j]) {
      const SensorChannel& sensor = sensor_channels_[pair.sensor];
      if (!sensor.usable) return;
      same = same && comparable(j, pair.sensor);
      projected += dot(mean_subspace(j, pair.which), sensor.total_balance.e);
    }
    step_difference(c.own, c.balance, projected, same);
  }

  // Zero unless something touches between the joint and the sensor inboard of it.
  void step_parity(int j) {
    const int s = layout_.inboard_sensor[j];
    if (s < 0 || !sensor_channels_[s].usable) return;
    JointChannel& c = joint_channels_[j];
    step_difference(c.parity, c.balance,
                    dot(mean_subspace(j, 0), sensor_channels_[s].total_balance.e),
                    comparable(j, s));
  }

  // A joint without a torque sensor: what the named sensors' loads do to it.
  void step_from(int j) {
    JointChannel& c = joint_channels_[j];
    Balance<double>& balance = c.balance;
    balance.e = 0.0;
    balance.anchored = true;
    balance.fresh = c.index == now_.index - 1;
    for (const Projection& pair : layout_.source_sensors[j]) {
      const SensorChannel& sensor = sensor_channels_[pair.sensor];
      if (!sensor.usable) {
        balance.skip();
        break;
      }
      balance.fresh = balance.fresh && sensor.total_balance.fresh;
      balance.dt = sensor.total_balance.dt;
      balance.e += dot(mean_subspace(j, pair.which), sensor.total_balance.e);
    }
    follow(c.external, balance, now_, bandwidths_);
  }

  // The joint's subspace over the last interval, at second order.
  Spatial mean_subspace(int j, int which) const {
    return 0.5 * (joint_channels_[j].subspaces[which] +
                  tree_.state(joints_[j].nodes[which]).subspace);
  }

  void write_health(Health health) { output_[row_.health()] = static_cast<double>(health); }

  void write(Health health) {
    compose_segments();
    bool settled = true;
    for (int j = 0; j < row_.joints; ++j) settled = write_joint(j) && settled;
    for (int s = 0; s < row_.sensors; ++s) write_sensor(s);
    for (int g = 0; g < row_.segments; ++g) settled = write_segment(g) && settled;
    write_health(health | (settled ? 0 : kSettling));
  }

  bool write_joint(int j) {
    const JointChannel& c = joint_channels_[j];
    double* out = output_.data();
    out[row_.tau_ext() + j] = c.external.present ? c.external.value : kNaN;
    out[row_.segment_torque() + j] = c.own.present ? c.own.value : kNaN;
    out[row_.parity() + j] = c.parity.present ? c.parity.value : kNaN;
    out[row_.joint_innovation() + j] = c.balance.fresh ? c.balance.e : kNaN;
    const bool settled = c.external.settled(now_, bandwidths_);
    out[row_.joint_settled() + j] = settled ? 1.0 : 0.0;
    return settled || !c.external.present;
  }

  void compose_segments() {
    for (int g = 0; g < row_.segments; ++g) {
      const Segment& segment = layout_.segments[g];
      segment_present_[g] = segment_channels_[g].filter.present;
      segment_wrench_[g] = segment_channels_[g].filter.value;
      if (method_ == Method::segment || !segment_present_[g]) continue;
      segment_wrench_[g] = paper_wrench(segment.sensor);  // (18)
      for (int t : segment.successors)
        segment_wrench_[g] = segment_wrench_[g] - paper_wrench(t);
    }
  }

  Spatial paper_wrench(int s) const {
    return wrench_to_parent(tree_.state(sensors_[s].node).pose, sensor_channels_[s].local.value);
  }

  // Sum of the segments outboard of sensor s; false if one of them is not known.
  bool sum_segments(int s, Spatial& sum) const {
    const int g = layout_.segment_of_sensor[s];
    if (!segment_present_[g]) return false;
    sum = sum + segment_wrench_[g];
    for (int t : layout_.segments[g].successors) {
      if (!sum_segments(t, sum)) return false;
    }
    return true;
  }

  void write_sensor(int s) {
    const SensorChannel& c = sensor_channels_[s];
    double* out = output_.data() + row_.sensor_wrench() + 6 * s;
    Spatial wrench = c.local.value;
    if (sensors_[s].six_axis() && method_ == Method::segment) {
      Spatial world;
      if (!sum_segments(s, world)) world = c.total.value;
      wrench = wrench_to_child(tree_.state(sensors_[s].node).pose, world);
    }
    write_wrench(out, wrench, c.usable);
    for (int i = 0; i < 6; ++i) {
      if (!sensors_[s].axes[i]) out[i] = kNaN;
    }
  }

  bool write_segment(int g) {
    const SegmentChannel& c = segment_channels_[g];
    double* out = output_.data();
    write_wrench(out + row_.segment_wrench() + 6 * g, segment_wrench_[g], segment_present_[g]);
    write_wrench(out + row_.segment_innovation() + 6 * g, c.balance.e, c.balance.fresh);
    const bool settled = c.filter.settled(now_, bandwidths_);
    out[row_.segment_settled() + g] = settled ? 1.0 : 0.0;
    return settled || !c.filter.present;
  }

  static void write_wrench(double* out, const Spatial& w, bool known) {
    if (known) {
      store(w, out);
    } else {
      std::fill_n(out, 6, kNaN);
    }
  }

  Tree tree_;
  std::vector<JointRow> joints_;
  std::vector<SensorRow> sensors_;
  Layout layout_;
  RowLayout row_;
  Method method_;
  Bandwidths bandwidths_;
  std::vector<JointChannel> joint_channels_;
  std::vector<SensorChannel> sensor_channels_;
  std::vector<SegmentChannel> segment_channels_;
  std::vector<double> output_;
  std::vector<Spatial> segment_wrench_ = std::vector<Spatial>(layout_.segments.size());
  std::vector<char> segment_present_ = std::vector<char>(layout_.segments.size(), 0);
  Instant now_;
  double period_ = 0.0;  // typical interval between samples [s]
  bool started_ = false, timed_ = false;
};

}  // namespace touchline
