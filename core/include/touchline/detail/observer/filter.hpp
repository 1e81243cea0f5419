// SPDX-License-Identifier: Apache-2.0
// First-order residual filters,  r+ = a r + (1 - a) e,  fed with mean loads over intervals that
// may vary. Rows and groups are as for the balances.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/detail/observer/balance.hpp"

namespace touchline {

enum class Discretization { automatic, tustin, exponential };

// The discrete pole a of bandwidth K over dt. Tustin has the smaller error but rings for large
// K dt, so `automatic` leaves it at K dt = 0.5.
inline double pole(double bandwidth, double dt, Discretization rule) {
  const double x = bandwidth * dt;
  const bool tustin = rule == Discretization::tustin ||
                      (rule == Discretization::automatic && x <= 0.5);
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
    bool present = false;   // there is a value at this instant
  };

  explicit Filters(Discretization rule) : rule_(rule) {}

  // Returns the number of the group.
  std::size_t add(std::size_t count, double bandwidth) {
    groups_.push_back({value_.size(), count, handle_of(bandwidth)});
    const std::size_t size = value_.size() + count;
    for (auto* rows : {&value_, &input_, &keep_}) rows->resize(size, kNaN);
    handles_.resize(size, groups_.back().bandwidth);
    return groups_.size() - 1;
  }

  const Group& group(std::size_t g) const { return groups_[g]; }
  const double* value(std::size_t g) const { return value_.data() + groups_[g].first; }
  const double* input(std::size_t g) const { return input_.data() + groups_[g].first; }
  double* input(std::size_t g) { return input_.data() + groups_[g].first; }

  bool settled(std::size_t g, const Instant& now) const {
    return groups_[g].present &&
           now.time - groups_[g].since >= 5.0 / bandwidths_[groups_[g].bandwidth];
  }

  // Poles of all rows for the interval from the sample before: without more ado, all filter.
  void begin(const Instant& now) {
    const double dt = now.time - now.before;
    if (dt == dt_) return;
    for (std::size_t h = 0; h < poles_.size(); ++h) poles_[h] = pole(bandwidths_[h], dt, rule_);
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
      if (interval == interval) keep(group, pole(bandwidths_[group.bandwidth], interval, rule_));
      return;
    }
    keep(group, 1.0);
    std::fill_n(input_.begin() + group.first, group.count, 0.0);
    if (action != Action::restart) return;
    std::fill_n(value_.begin() + group.first, group.count, 0.0);
    group.time = group.since = now.time;
  }

  void run() { step(keep_.data(), input_.data(), value_.data(), value_.size()); }

  void forget() {
    for (Group& group : groups_) group.time = kNaN;
  }

 private:
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
  std::vector<Group> groups_;
  std::vector<double> bandwidths_, poles_;  // by handle
  std::vector<std::size_t> handles_;        // by row
  std::vector<double> value_, input_, keep_;
  double dt_ = kNaN;  // that the poles stand for
};

}  // namespace touchline
