// SPDX-License-Identifier: Apache-2.0
// First-order residual filters, fed with the mean external load e over each interval,
//   e = (p_k+1 - p_k) / dt - (u_k + u_k+1) / 2,   r+ = a r + (1 - a) e,
// so that no integral grows and the interval may vary. All rows of a robot stand side by side in
// plain arrays, which compilers vectorize; a group of rows (a joint, a sensor) shares its times.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

namespace touchline {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

enum class Discretization { automatic, tustin, exponential };

// The discrete pole a of bandwidth K over dt. Tustin has the smaller error but rings for large
// K dt, so `automatic` leaves it at K dt = 0.5.
inline double pole(double bandwidth, double dt, Discretization rule) {
  const double x = bandwidth * dt;
  const bool tustin = rule == Discretization::tustin ||
                      (rule == Discretization::automatic && x <= 0.5);
  return tustin ? (1.0 - 0.5 * x) / (1.0 + 0.5 * x) : std::exp(-x);
}

// The time of one accepted sample. Times that are not known are NaN, and every test with them
// is written so that it then fails.
struct Instant {
  double time = kNaN;
  double before = kNaN;  // of the accepted sample before
  double max_gap = 0.0;  // an interval longer than this is not integrated over

  bool in_reach(double earlier) const { return time - earlier <= max_gap; }
};

// Momentum p and known load u of all rows, and from two samples of a row its external load e.
class Balances {
 public:
  struct Group {
    std::size_t first, count;
    double time = kNaN;    // of the last sample that had a value
    double dt = 0.0;       // that e spans
    bool present = false;  // there is a value at this instant,
    bool fresh = false;    // and e spans an interval that ends here,
    bool regular = false;  // which began at the sample before
  };

  // Returns the number of the group.
  std::size_t add(std::size_t count) {
    groups_.push_back({p_.size(), count});
    const std::size_t size = p_.size() + count;
    for (auto* rows : {&p_, &u_, &p_before_, &u_before_, &rate_}) rows->resize(size, 0.0);
    e_.resize(size, kNaN);
    return groups_.size() - 1;
  }

  const Group& group(std::size_t g) const { return groups_[g]; }
  const double* e(std::size_t g) const { return e_.data() + groups_[g].first; }

  void begin(const Instant& now) {
    p_.swap(p_before_);
    u_.swap(u_before_);
    std::fill(rate_.begin(), rate_.end(), 1.0 / (now.time - now.before));
  }

  // Group g has values at this instant: they are to be written to p(g) and u(g).
  void take(std::size_t g, const Instant& now) {
    Group& group = groups_[g];
    group.dt = now.time - group.time;
    group.present = true;
    group.fresh = now.in_reach(group.time);
    group.regular = group.fresh && group.time == now.before;
    if (!group.regular) std::fill_n(rate_.begin() + group.first, group.count, 1.0 / group.dt);
    group.time = now.time;
  }
  double* p(std::size_t g) { return p_.data() + groups_[g].first; }
  double* u(std::size_t g) { return u_.data() + groups_[g].first; }

  // Group g has none: the last ones are kept, so that a few lost samples are bridged.
  void skip(std::size_t g) {
    Group& group = groups_[g];
    group.present = group.fresh = group.regular = false;
    std::copy_n(p_before_.begin() + group.first, group.count, p_.begin() + group.first);
    std::copy_n(u_before_.begin() + group.first, group.count, u_.begin() + group.first);
  }

  // e of all rows; NaN where there is none.
  void balance() {
    difference(p_.data(), p_before_.data(), u_.data(), u_before_.data(), rate_.data(), e_.data(),
               e_.size());
    for (const Group& group : groups_) {
      if (!group.fresh) std::fill_n(e_.begin() + group.first, group.count, kNaN);
    }
  }

  // For rows whose load comes from elsewhere.
  void set_e(std::size_t g, double value) { e_[groups_[g].first] = value; }

  void forget() {
    for (Group& group : groups_) group.time = kNaN;
  }

 private:
  static void difference(const double* __restrict p, const double* __restrict p_before,
                         const double* __restrict u, const double* __restrict u_before,
                         const double* __restrict rate, double* __restrict e, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
      e[i] = rate[i] * (p[i] - p_before[i]) - 0.5 * (u_before[i] + u[i]);
  }

  std::vector<Group> groups_;
  std::vector<double> p_, u_, p_before_, u_before_, rate_, e_;
};

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
    for (auto* rows : {&value_, &input_, &keep_}) rows->resize(size, 0.0);
    handles_.resize(size, groups_.back().bandwidth);
    return groups_.size() - 1;
  }

  const Group& group(std::size_t g) const { return groups_[g]; }
  const double* value(std::size_t g) const { return value_.data() + groups_[g].first; }
  double* input(std::size_t g) { return input_.data() + groups_[g].first; }

  bool settled(std::size_t g, const Instant& now) const {
    return groups_[g].present &&
           now.time - groups_[g].since >= 5.0 / bandwidths_[groups_[g].bandwidth];
  }

  // Poles of all rows for the interval from the sample before.
  void begin(const Instant& now) {
    const double dt = now.time - now.before;
    for (std::size_t h = 0; h < poles_.size(); ++h) poles_[h] = pole(bandwidths_[h], dt, rule_);
    for (std::size_t i = 0; i < keep_.size(); ++i) keep_[i] = poles_[handles_[i]];
  }

  // Decides what group g does, before `run`. To filter, input(g) must be set; `interval`: NaN
  // where it spans that from the sample before, otherwise its length.
  void act(std::size_t g, Action action, const Instant& now, double interval = kNaN) {
    Group& group = groups_[g];
    group.present = action != Action::absent;
    if (action == Action::filter) {
      group.time = now.time;
      if (interval == interval) keep(group, pole(bandwidths_[group.bandwidth], interval, rule_));
      return;
    }
    keep(group, action == Action::restart ? 0.0 : 1.0);
    std::fill_n(input_.begin() + group.first, group.count, 0.0);
    if (action == Action::restart) group.time = group.since = now.time;
  }

  // Group g follows a balance: it begins anew where the balance did.
  void follow(std::size_t g, const Balances::Group& balance, const Instant& now) {
    const Action action = !balance.present ? Action::absent
                          : balance.fresh  ? Action::filter
                                           : Action::restart;
    act(g, action, now, balance.regular ? kNaN : balance.dt);
  }

  void forget() {
    for (Group& group : groups_) group.time = kNaN;
  }

  void run() {
    step(keep_.data(), input_.data(), value_.data(), value_.size());
  }

 private:
  std::size_t handle_of(double bandwidth) {
    const auto found = std::find(bandwidths_.begin(), bandwidths_.end(), bandwidth);
    const std::size_t handle = static_cast<std::size_t>(found - bandwidths_.begin());
    if (found == bandwidths_.end()) {
      bandwidths_.push_back(bandwidth);
      poles_.push_back(kNaN);
    }
    return handle;
  }

  void keep(const Group& group, double a) {
    std::fill_n(keep_.begin() + group.first, group.count, a);
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
};

}  // namespace touchline
