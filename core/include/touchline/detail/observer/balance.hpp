// SPDX-License-Identifier: Apache-2.0
// Momentum balances: from momentum p and known load u at two samples, the mean external load over
// the interval between them,  e = (p_k+1 - p_k) / dt - (u_k + u_k+1) / 2.
//
// All rows of a robot stand side by side in plain arrays, which compilers vectorize. A group of
// rows (a joint, a sensor) shares its times. As long as every group has a value at every sample,
// nothing about times needs to be kept by group: `book` is for all other samples.
// Theory: docs/theory.md, section 2.2.
#pragma once

#include <algorithm>
#include <cstddef>
#include <limits>
#include <vector>

namespace touchline {

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

// The time of one accepted sample. Times that are not known are NaN, and every test with them is
// written so that it then fails.
struct Instant {
  double time = kNaN;
  double before = kNaN;     // of the accepted sample before
  double period = 0.0;      // typical [s]
  double usual_step = 0.0;  // a step longer than this is a gap [s]

  bool usual(double earlier) const { return time - earlier <= usual_step; }
  // Can a gap since then be integrated over? `bridge`: the most time that may be lost [s]. The step
  // spans what is lost, the period that it ends with, and half of one for jitter.
  bool reaches(double earlier, double bridge) const {
    return time - earlier <= std::max(usual_step, bridge + 1.5 * period);
  }
};

class Balances {
 public:
  // `bridge`: e is known over gaps up to this [s].
  explicit Balances(double bridge) : bridge_(bridge) {}

  struct Group {
    std::size_t first, count;
    bool used;             // it has values at all
    double time = kNaN;    // of the last sample that had a value
    double dt = 0.0;       // that e spans
    bool present = false;  // there is a value at this instant,
    bool fresh = false;    // and e spans an interval that ends here,
    bool regular = false;  // which began at the sample before
  };

  // Returns the number of the group. One that is not `used` keeps NaN in e.
  std::size_t add(std::size_t count, bool used) {
    groups_.push_back({p_.size(), count, used});
    const std::size_t size = p_.size() + count;
    for (auto* rows : {&p_, &u_, &p_before_, &u_before_, &e_}) rows->resize(size, kNaN);
    rate_.resize(size, 0.0);
    return groups_.size() - 1;
  }

  const Group& group(std::size_t g) const { return groups_[g]; }
  std::size_t groups() const { return groups_.size(); }
  const double* e(std::size_t g) const { return e_.data() + groups_[g].first; }
  double* e(std::size_t g) { return e_.data() + groups_[g].first; }

  // The values of this instant are to be written here.
  double* p(std::size_t g) { return p_.data() + groups_[g].first; }
  double* u(std::size_t g) { return u_.data() + groups_[g].first; }

  // Does any e of this instant span a gap?
  bool bridged() const { return bridged_; }

  std::size_t size() const { return p_.size(); }
  // Momenta and loads of the last sample, all rows; for those who go on by other means.
  double* momenta() { return p_.data(); }
  double* loads() { return u_.data(); }

  void begin(const Instant& now) {
    bridged_ = false;
    p_.swap(p_before_);
    u_.swap(u_before_);
    std::fill(rate_.begin(), rate_.end(), 1.0 / (now.time - now.before));
  }

  // Until the sample before, all used groups had values.
  void catch_up(const Instant& now) {
    for (Group& group : groups_) {
      if (group.used) group.time = now.before;
    }
  }

  // Group g has values at this instant, or none: then the last ones are kept, so that a few lost
  // samples are bridged. Returns whether a next sample with all values needs no `book`.
  bool book(std::size_t g, bool present, const Instant& now) {
    Group& group = groups_[g];
    group.present = present;
    group.fresh = present && now.reaches(group.time, bridge_);
    bridged_ = bridged_ || (group.fresh && !now.usual(group.time));
    group.regular = group.fresh && group.time == now.before;
    if (present) {
      group.dt = now.time - group.time;
      group.time = now.time;
      if (!group.regular) std::fill_n(rate_.begin() + group.first, group.count, 1.0 / group.dt);
    } else {
      std::copy_n(p_before_.begin() + group.first, group.count, p_.begin() + group.first);
      std::copy_n(u_before_.begin() + group.first, group.count, u_.begin() + group.first);
    }
    return group.regular || !group.used;
  }

  void balance() {
    difference(p_.data(), p_before_.data(), u_.data(), u_before_.data(), rate_.data(), e_.data(),
               e_.size());
  }

  // Instead of `balance`: by how much the known loads have changed over the interval.
  void compare_loads() {
    for (std::size_t i = 0; i < e_.size(); ++i) e_[i] = u_[i] - u_before_[i];
  }

  // After `book`: e is NaN where it is not fresh.
  void blank() {
    for (const Group& group : groups_) {
      if (!group.fresh) std::fill_n(e_.begin() + group.first, group.count, kNaN);
    }
  }

  void forget() {
    for (Group& group : groups_) group.time = kNaN;
  }
  // Group g does not go on from its last value.
  void forget(std::size_t g) { groups_[g].time = kNaN; }

 private:
  static void difference(const double* __restrict p, const double* __restrict p_before,
                         const double* __restrict u, const double* __restrict u_before,
                         const double* __restrict rate, double* __restrict e, std::size_t size) {
    for (std::size_t i = 0; i < size; ++i)
      e[i] = rate[i] * (p[i] - p_before[i]) - 0.5 * (u_before[i] + u[i]);
  }

  double bridge_;
  bool bridged_ = false;
  std::vector<Group> groups_;
  std::vector<double> p_, u_, p_before_, u_before_, rate_, e_;
};

}  // namespace touchline
