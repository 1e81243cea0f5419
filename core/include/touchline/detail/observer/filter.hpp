// SPDX-License-Identifier: Apache-2.0
// First-order residual filters,  r+ = a r + (1 - a) e,  fed with mean loads over intervals that
// may vary. Rows and groups are as for the balances.
//
// Over a gap the momentum is known at both ends, the load u only there: its mean, taken for the
// mean of the ends, is in doubt. By how much is not measured, but two things tell its size. Half of
// the load's change is the most that a load can be off that went from one end to the other
// without turning. The other, e - r, is what the gap would change in the estimate. Each is followed
// as a load of its own, which the filter forgets as it forgets the error.
// Theory: docs/theory.md, sections 2.2 and 2.3.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "touchline/detail/observer/balance.hpp"
#include "touchline/detail/observer/tuning.hpp"

namespace touchline {

enum class Discretization { automatic, tustin, exponential };

// The discrete pole a of bandwidth K over dt. Tustin has the smaller error but rings for large
// K dt, so `automatic` leaves it at K dt = 0.5.
inline double pole(double bandwidth, double dt, Discretization rule,
                   double tustin_steps = ObserverTuning{}.tustin_steps) {
  const double x = bandwidth * dt;
  const bool tustin = rule == Discretization::tustin ||
                      (rule == Discretization::automatic && x <= tustin_steps);
  return tustin ? (1.0 - 0.5 * x) / (1.0 + 0.5 * x) : std::exp(-x);
}

// What a filter does with a sample: nothing, for want of a value now (absent) or over the
// interval (hold); begin anew at zero; or its step.
enum class Action { absent, hold, restart, filter };

class Filters {
 public:
  struct Group {
    std::size_t first, count;
    std::size_t bandwidth;  // its handle
    double time = kNaN;     // of the last step or restart
    double since = kNaN;    // of the last restart
    std::uint32_t restarts = 0;
    bool present = false;   // there is a value at this instant
  };

  Filters(Discretization rule, const ObserverTuning& tuning) : rule_(rule), tuning_(tuning) {}

  // Returns the number of the group.
  std::size_t add(std::size_t count, double bandwidth) {
    groups_.push_back({value_.size(), count, handle_of(bandwidth)});
    const std::size_t size = value_.size() + count;
    for (auto* rows : {&value_, &input_, &keep_}) rows->resize(size, kNaN);
    for (auto* rows : {&load_change_, &half_change_, &surprise_}) rows->resize(size, 0.0);
    handles_.resize(size, groups_.back().bandwidth);
    return groups_.size() - 1;
  }

  const Group& group(std::size_t g) const { return groups_[g]; }
  std::size_t groups() const { return groups_.size(); }
  const double* value(std::size_t g) const { return value_.data() + groups_[g].first; }
  const double* input(std::size_t g) const { return input_.data() + groups_[g].first; }
  double* input(std::size_t g) { return input_.data() + groups_[g].first; }

  bool settled(std::size_t g, const Instant& now) const {
    return groups_[g].present &&
           now.time - groups_[g].since >= tuning_.settled_steps / bandwidth(g) - kRounding;
  }

  // Does group g go on after a gap since `earlier`?
  bool reaches(std::size_t g, double earlier, const Instant& now) const {
    return now.reaches(earlier, bridge(g));
  }
  // The most time that may be lost before group g begins anew [s].
  double bridge(std::size_t g) const {
    return std::min(tuning_.bridged_steps / bandwidth(g), tuning_.longest_bridge);
  }

  // Is any value in doubt because of a gap?
  bool doubtful() const { return doubtful_; }
  // What a gap may have left in the values of group g: two loads, one sigma each.
  const double* half_change(std::size_t g) const { return half_change_.data() + groups_[g].first; }
  const double* surprise(std::size_t g) const { return surprise_.data() + groups_[g].first; }

  double bandwidth(std::size_t g) const { return bandwidths_[groups_[g].bandwidth]; }
  std::size_t size() const { return value_.size(); }
  double* values() { return value_.data(); }
  // Has every row the same pole? It is for a step of `dt` [s]:
  bool alike() const { return poles_.size() == 1; }
  double only_pole(double dt) const { return dt == dt_ ? poles_[0] : pole_of(0, dt); }
  // The poles of all rows for a step of `dt` [s].
  void write_poles(double dt, double* out) {
    if (dt != dt_) set_poles(dt);
    std::copy(keep_.begin(), keep_.end(), out);
  }

  // Poles of all rows for the interval from the sample before: without more ado, all filter.
  void begin(const Instant& now) {
    const double dt = now.time - now.before;
    if (dt != dt_) set_poles(dt);
  }

  void set_poles(double dt) {
    for (std::size_t h = 0; h < poles_.size(); ++h) poles_[h] = pole_of(h, dt);
    if (poles_.size() == 1) {
      std::fill(keep_.begin(), keep_.end(), poles_[0]);
    } else {
      for (std::size_t i = 0; i < keep_.size(); ++i) keep_[i] = poles_[handles_[i]];
    }
    dt_ = dt;
  }

  // Until the sample before, all groups with a value filtered.
  void catch_up(const Instant& now) {
    for (Group& group : groups_) {
      if (group.present) group.time = now.before;
    }
  }

  // Decides what group g does, before `run`. `interval`: that which its input spans, if it is not
  // that from the sample before.
  void act(std::size_t g, Action action, const Instant& now, double interval = kNaN) {
    Group& group = groups_[g];
    group.present = action != Action::absent;
    if (action == Action::filter) {
      group.time = now.time;
      if (interval == interval) keep(group, pole_of(group.bandwidth, interval));
      return;
    }
    keep(group, 1.0);
    std::fill_n(input_.begin() + group.first, group.count, 0.0);
    if (action != Action::restart) return;
    std::fill_n(value_.begin() + group.first, group.count, 0.0);
    std::fill_n(half_change_.begin() + group.first, group.count, 0.0);
    std::fill_n(surprise_.begin() + group.first, group.count, 0.0);
    group.time = group.since = now.time;
    ++group.restarts;
  }

  // Takes the inputs for the change of the known loads over a gap.
  void take_load_changes() { load_change_ = input_; }

  // What is left of older doubts; to be called after all `act`.
  void fade_doubts(const Instant& now) {
    if (!doubtful_) return;
    doubtful_ = !(now.time > doubtful_until_);
    for (auto* doubt : {&half_change_, &surprise_}) {
      for (std::size_t i = 0; i < keep_.size(); ++i)
        (*doubt)[i] = doubtful_ ? std::fabs(keep_[i]) * (*doubt)[i] : 0.0;
    }
  }

  // Group g filters over a gap; to be called after `fade_doubts`, before `run`.
  void doubt(std::size_t g, const Instant& now) {
    const Group& group = groups_[g];
    double half[kMostRows], off[kMostRows];
    for (std::size_t i = 0; i < group.count; ++i) {
      const std::size_t at = group.first + i;
      const double gain = 1.0 - keep_[at];
      half[i] = 0.5 * gain * load_change_[at];
      off[i] = gain * (input_[at] - value_[at]);
    }
    enter(half, half_change_.data() + group.first, group.count);
    enter(off, surprise_.data() + group.first, group.count);
    const double slowest = *std::min_element(bandwidths_.begin(), bandwidths_.end());
    doubtful_until_ = now.time + tuning_.settled_steps / slowest;
    doubtful_ = true;
  }

  void run() { step(keep_.data(), input_.data(), value_.data(), value_.size()); }

  // Group g has filtered this since then [s], all of its rows.
  void go_on_from(std::size_t g, const double* value, double since) {
    std::copy_n(value, groups_[g].count, value_.begin() + groups_[g].first);
    groups_[g].since = since;
  }

  // Group g does not go on from its last value.
  void forget(std::size_t g) { groups_[g].time = kNaN; }
  void forget() {
    for (Group& group : groups_) group.time = kNaN;
    doubtful_ = false;
    for (auto* doubt : {&half_change_, &surprise_}) std::fill(doubt->begin(), doubt->end(), 0.0);
  }

 private:
  static constexpr std::size_t kMostRows = 6;  // of a group
  static constexpr double kRounding = 1e-6;    // [s] of stamps: four units of a Unix time in doubles

  double pole_of(std::size_t handle, double dt) const {
    return pole(bandwidths_[handle], dt, rule_, tuning_.tustin_steps);
  }

  // Adds a load to an older one of unknown sign: the larger sum counts.
  static void enter(const double* load, double* sum, std::size_t count) {
    double product = 0.0;
    for (std::size_t i = 0; i < count; ++i) product += load[i] * sum[i];
    const double sign = product < 0.0 ? -1.0 : 1.0;
    for (std::size_t i = 0; i < count; ++i) sum[i] = sign * sum[i] + load[i];
  }

  std::size_t handle_of(double bandwidth) {
    const auto found = std::find(bandwidths_.begin(), bandwidths_.end(), bandwidth);
    const auto handle = static_cast<std::size_t>(found - bandwidths_.begin());
    if (found == bandwidths_.end()) {
      bandwidths_.push_back(bandwidth);
      poles_.push_back(kNaN);
    }
    return handle;
  }

  void keep(const Group& group, double a) {
    std::fill_n(keep_.begin() + group.first, group.count, a);
    dt_ = kNaN;  // poles must be set anew
  }

  static void step(const double* __restrict keep, const double* __restrict input,
                   double* __restrict value, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
      value[i] = keep[i] * value[i] + (1.0 - keep[i]) * input[i];
  }

  Discretization rule_;
  ObserverTuning tuning_;
  std::vector<Group> groups_;
  std::vector<double> bandwidths_, poles_;  // by handle
  std::vector<std::size_t> handles_;        // by row
  std::vector<double> value_, input_, keep_;
  std::vector<double> load_change_, half_change_, surprise_;
  double doubtful_until_ = 0.0;
  bool doubtful_ = false;
  double dt_ = kNaN;  // that the poles stand for
};

}  // namespace touchline
