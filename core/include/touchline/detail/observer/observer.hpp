// SPDX-License-Identifier: Apache-2.0
// The extended momentum observer (Iskandar et al., ICRA 2021, eqs. 11-18) without matrices: the
// generalized momentum of a sensor's locked virtual joint is the spatial momentum of everything
// outboard of it. No allocation, lock, exception or output in `step` and `run`.
// Theory: docs/theory.md, section 2.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <type_traits>
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
#include "touchline/detail/observer/side_by_side.hpp"
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
        sensor_present_(sensors_.size(), 0),
        output_(row_.width(), kNaN),
        clock_(tuning),
        side_by_side_(layout_, joints_, sensors_, channels_, packed_, projections_, torques_,
                      wrenches_, row_) {
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
    terms_.evaluate(sample.q, sample.qd, ahead_[0]);
    advance(sample, ahead_[0], output_.data(), output_.data());
    return output_.data();
  }

  // Takes N samples, whose signals stand one after the other in each array; writes N rows and
  // calls `each(row)` after each. The numbers are those of `step`, to the last bit. Stops after a
  // sample for which `each` returns false, if it returns anything.
  template <class Each>
  void run(std::size_t samples, const double* time, const double* q, const double* qd,
           const double* tau, const double* wrench, double* out, Each&& each) {
    const std::size_t n = joints_.size(), w = 6 * sensors_.size(), width = output_.size();
    const double* last = output_.data();
    leave_lanes();
    for (std::size_t i = 0; i < samples; ++i) {
      const std::size_t k = i % kLanes;
      if (k == 0) look_ahead(samples - i, q + i * n, qd + i * n);
      advance({time[i], q + i * n, qd + i * n, tau + i * n, wrench + i * w}, ahead_[k], last, out);
      last = out;
      out += width;
      if (!goes_on(each, last)) break;
    }
    if (samples > 0) std::copy_n(last, width, output_.begin());
  }

  // The same, as fast as it goes: as long as nothing happens, several samples side by side.
  void run(std::size_t samples, const double* time, const double* q, const double* qd,
           const double* tau, const double* wrench, double* out) {
    const std::size_t n = joints_.size(), w = 6 * sensors_.size(), width = output_.size();
    const auto nothing = [](const double*) {};
    const double* last = output_.data();
    for (std::size_t i = 0; i < samples;) {
      const std::size_t left = samples - i, count = std::min<std::size_t>(kLanes, left);
      double* rows = out + i * width;
      const Sample first{time[i], q + i * n, qd + i * n, tau + i * n, wrench + i * w};
      if (count < kLanes || !step_together(first, time + i, rows)) {
        if (last != output_.data()) std::copy_n(last, width, output_.begin());
        run(count, time + i, first.q, first.qd, first.tau, first.wrench, rows, nothing);
      }
      i += count;
      last = out + (i - 1) * width;
    }
    leave_lanes();
    if (samples > 0) std::copy_n(last, width, output_.begin());
  }

  // Forgets everything: the next sample starts anew.
  void reset() {
    clock_.forget();
    forget();
  }

  // What a joint's torque, or a sensor, had last is not believed: its filters begin anew.
  void begin_torque_anew(std::size_t j) { channels_.begin_torque_anew(j); }
  void begin_sensor_anew(std::size_t s) { channels_.begin_sensor_anew(s); }

  // Goes on with what `whole` has filtered, instead of beginning anew. This is the same robot without
  // some sensors: `sensors[s]` is sensor s in `whole`, and `parts[g]` are the segments there which are
  // segment g here. Both have taken the same sample last, this one as its first. Filters are linear,
  // so a segment has the sum of its parts. A joint that loses a sensor outboard has its torque less
  // the filtered wrenches of those that are left, projected at this instant. That leaves a ghost of
  // order |w| |F| / K for 1 / K. What `whole` does not know begins anew. No allocation.
  void go_on_from(const Observer& whole, const std::vector<int>& sensors,
                  const std::vector<std::vector<int>>& parts) {
    const Filters &from = whole.channels_.filters, &to = channels_.filters;
    const bool one_pole = from.alike() && to.alike() && from.bandwidth(0) == to.bandwidth(0);
    if (!(now_.time == whole.now_.time) || !one_pole || from.doubtful()) return;
    for (std::size_t g = 0; g < parts.size(); ++g) add_up(whole, g, parts[g]);
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const auto t = static_cast<std::size_t>(sensors[s]);
      if (channels_.kind(s) == whole.channels_.kind(t) && channels_.kind(s) != Channels::SensorFilter::none)
        copy(whole, whole.channels_.sensor_filter(t), channels_.sensor_filter(s));
    }
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      copy(whole, whole.channels_.external(j), channels_.external(j));
      compare_anew(whole, channels_.own(j), j, layout_.outboard_sensors[j],
                   whole.layout_.outboard_sensors[j], sensors);
      compare_anew(whole, channels_.parity(j), j, layout_.inboard_sensors[j],
                   whole.layout_.inboard_sensors[j], sensors);
    }
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
  // The most time that a sensor may be lost before the wrench of segment g begins anew [s].
  double bridge(std::size_t g) const { return channels_.filters.bridge(channels_.segment_filter(g)); }
  // Of sensor s in world, at the last accepted sample.
  Pose sensor_pose(int s) const {
    return load_pose(before_ + terms_.at().sensor(s) + TermsLayout::kPose);
  }
  // External torque that contacts on its own segment put on joint j, mean over the last interval,
  // not filtered; 0 where it is not known.
  double own_innovation(std::size_t j) const { return channels_.filters.input(channels_.own(j))[0]; }
  // How often the filter of joint i, or of segment i - joints, has begun anew.
  std::uint32_t restarts(std::size_t i) const {
    const std::size_t n = joints_.size();
    return channels_.filters.group(i < n ? channels_.external(i) : channels_.segment_filter(i - n))
        .restarts;
  }
  // The model's terms alone, for a state of its own.
  Terms<double>& terms() { return terms_; }

 private:
  template <class Each>
  static bool goes_on(Each& each, const double* row) {
    if constexpr (std::is_void_v<decltype(each(row))>) {
      each(row);
      return true;
    } else {
      return each(row);
    }
  }
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
        terms_.evaluate(q + k * n, qd + k * n, ahead_[k]);
      return;
    }
    side_by_side_.evaluate(q, qd);
    for (int k = 0; k < kLanes; ++k) side_by_side_.copy_terms(k, ahead_[k]);
  }

  // kLanes samples at once; or nothing, if one of them is not as usual. `first`: of them.
  bool step_together(const Sample& first, const double* time, double* out) {
    if (!steady_ || !writer_.all_settled() || !side_by_side_.possible()) return false;
    if (channels_.filters.doubtful()) return false;
    if (!side_by_side_.read(first)) return false;
    const bool inside = side_by_side_.inside(lower_.data(), upper_.data());
    const std::size_t n = joints_.size();
    Clock clock = clock_;
    Health health[kLanes] = {};
    Instant now[kLanes], before = now_;
    for (int k = 0; k < kLanes; ++k) {
      if (clock.take(time[k], health[k]) != Clock::Verdict::accepted) return false;
      now[k] = {time[k], before.time, clock.period(), clock.usual_step()};
      before = now[k];
      if (!inside) health[k] |= judge_limits(first.q + k * n);
      if ((health[k] & ~kModelLimit) != 0 || !now[k].usual(now[k].before)) return false;
    }
    if (!in_lanes_) side_by_side_.enter(before_);
    in_lanes_ = true;
    side_by_side_.evaluate();
    side_by_side_.balance(now);
    compare(side_by_side_.projected(), side_by_side_.e(), side_by_side_.inputs());
    side_by_side_.filter(now);
    side_by_side_.write(writer_.quality(), health, out);
    clock_ = clock;
    now_ = now[kLanes - 1];
    return true;
  }

  // What the samples side by side have left behind, for those that come one by one.
  void leave_lanes() {
    if (!in_lanes_) return;
    side_by_side_.leave(before_);
    in_lanes_ = false;
  }

  // The sequential part of a step. `terms`: those of the sample, exchanged for room for others;
  // `last`: the row before, which stays where a sample is refused.
  void advance(const Sample& sample, double*& terms, const double* last, double* out) {
    Health health = 0;
    if (!accept(sample, health, last, out)) return;
    std::swap(terms, before_);
    const double *now = before_, *earlier = terms;
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
    project(earlier, now);
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
    return health != 0 ? health : judge_limits(sample.q);
  }
  Health judge_limits(const double* q) const {
    bool inside = true;
    for (std::size_t j = 0; j < lower_.size(); ++j) inside &= (q[j] >= lower_[j]) & (q[j] <= upper_[j]);
    return inside ? 0 : kModelLimit;
  }

  // Fills the rows of the balances; returns whether all signals are usable.
  bool read(const Sample& sample, const double* terms, Health& health) {
    Balances& balances = channels_.balances;
    const TermsLayout& at = terms_.at();
    std::copy_n(terms + at.joint_momentum(), at.joints, balances.p(channels_.joint(0)));
    bool complete = torques_.read(sample.tau, sample.q, sample.qd, terms + at.joint_bias(),
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
    project(earlier, now);
    channels_.filters.take_load_changes();
  }

  // From the balances to the inputs of the filters, with the terms at both ends of the interval.
  void project(const double* earlier, const double* now) {
    double* e = channels_.balances.e(0);
    projections_.project(earlier, now, e + channels_.sensor_rows());
    compare(projections_.values(), e, channels_.filters.input(0));
  }

  // The inputs of all filters, from the innovations `e` of all balances and what these do to the
  // joints.
  template <class T>
  void compare(const T* projected, T* e, T* inputs) const {
    const Balances& balances = channels_.balances;
    const Filters& filters = channels_.filters;
    const auto sum = [projected, this](const std::vector<Projection>& pairs) {
      T total{};
      for (const Projection& pair : pairs) total += projected[projections_.at(pair)];
      return total;
    };
    for (std::size_t j : sources_) e[j] = sum(layout_.source_sensors[j]);
    T *external = inputs + filters.group(channels_.external(0)).first,
      *own = inputs + filters.group(channels_.own(0)).first,
      *parity = inputs + filters.group(channels_.parity(0)).first;
    for (std::size_t j = 0; j < joints_.size(); ++j) {
      external[j] = e[j];
      own[j] = e[j] - projected[outboard_[j]];
      parity[j] = e[j] - projected[inboard_[j]];
    }
    for (std::size_t j : forks_) own[j] = e[j] - sum(layout_.outboard_sensors[j]);
    for (std::size_t j : branches_)  // what loads the sensor, but neither the joint nor its segment
      parity[j] += sum(layout_.inboard_sensors[j]) - projected[inboard_[j]];
    std::copy_n(e + balances.group(channels_.segment(0)).first, 6 * row_.segments,
                inputs + filters.group(channels_.segment_filter(0)).first);
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      const Channels::SensorFilter kind = channels_.kind(s);
      if (kind == Channels::SensorFilter::none) continue;
      const bool local = kind == Channels::SensorFilter::local;
      const std::size_t balance = local ? channels_.local(s) : channels_.sensor(s);
      std::copy_n(e + balances.group(balance).first, 6,
                  inputs + filters.group(channels_.sensor_filter(s)).first);
    }
  }

  // Takes the value of a filter of another one.
  void copy(const Observer& whole, std::size_t from, std::size_t to) {
    const Filters& filters = whole.channels_.filters;
    if (!filters.group(from).present || !channels_.filters.group(to).present) return;
    channels_.filters.go_on_from(to, filters.value(from), filters.group(from).since);
  }

  // The filter of segment g takes the sum of those of its parts.
  void add_up(const Observer& whole, std::size_t g, const std::vector<int>& parts) {
    const Filters& filters = whole.channels_.filters;
    double sum[6] = {}, since = -std::numeric_limits<double>::infinity();
    bool known = channels_.filters.group(channels_.segment_filter(g)).present;
    for (const int part : parts) {
      const std::size_t filter = whole.channels_.segment_filter(static_cast<std::size_t>(part));
      known = known && filters.group(filter).present;
      since = std::max(since, filters.group(filter).since);
      for (int i = 0; i < 6; ++i) sum[i] += filters.value(filter)[i];
    }
    if (known && !parts.empty()) channels_.filters.go_on_from(channels_.segment_filter(g), sum, since);
  }

  // A filter of what torque j leaves over the loads of `pairs`; `before`: of `whole` (with other numbers
  // of sensors), which has the same filter at the same place among those of its joints.
  void compare_anew(const Observer& whole, std::size_t filter, std::size_t j,
                    const std::vector<Projection>& pairs, const std::vector<Projection>& before,
                    const std::vector<int>& sensors) {
    Filters& filters = channels_.filters;
    const auto same = [&](const Projection& a, const Projection& b) {
      return a.line == b.line && sensors[static_cast<std::size_t>(a.sensor)] == b.sensor;
    };
    if (std::equal(pairs.begin(), pairs.end(), before.begin(), before.end(), same)) {
      copy(whole, filter, filter);
      return;
    }
    const Filters::Group& external = filters.group(channels_.external(j));
    if (!external.present || !filters.group(filter).present) return;
    double value = *filters.value(channels_.external(j)), since = external.since;
    const double* lines = before_ + terms_.at().subspaces();
    for (std::size_t k = 0; k < pairs.size(); ++k) {
      const bool branch = filter == channels_.parity(j) && k > 0;  // it loads the sensor, but not the joint
      for (const int g : layout_.segments_outboard[static_cast<std::size_t>(pairs[k].sensor)]) {
        const std::size_t segment = channels_.segment_filter(static_cast<std::size_t>(g));
        if (!filters.group(segment).present) return;
        since = std::max(since, filters.group(segment).since);
        double load = 0.0;
        for (std::size_t i = 0; i < 6; ++i)
          load += lines[i * terms_.at().lines + static_cast<std::size_t>(pairs[k].line)] *
                  filters.value(segment)[i];
        value -= branch ? -load : load;
      }
    }
    filters.go_on_from(filter, &value, since);
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
  std::vector<char> sensor_present_;
  // Joints that are read from sensors; with several sensors outboard; with some on other branches.
  std::vector<std::size_t> sources_, forks_, branches_;
  std::vector<std::size_t> outboard_, inboard_;   // per joint: where its projections stand
  std::vector<double> output_;
  Clock clock_;
  SideBySide side_by_side_;
  Instant now_;
  bool started_ = false, steady_ = false;
  bool in_lanes_ = false;  // is the state of the last sample with those side by side?
};

}  // namespace touchline
