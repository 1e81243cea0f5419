// SPDX-License-Identifier: Apache-2.0
// First-order residual filters, fed with the mean external load over each interval,
//   e = (p_k+1 - p_k) / dt - (u_k + u_k+1) / 2,   r+ = a r + (1 - a) e,
// so that no integral grows and the interval may vary.
#pragma once

#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/spatial.hpp"

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

// The poles of all bandwidths in use, computed once per interval and not once per row.
class Bandwidths {
 public:
  explicit Bandwidths(Discretization rule) : rule_(rule) {}

  // Registers a bandwidth [rad/s]; returns its handle.
  int add(double bandwidth) {
    for (std::size_t i = 0; i < entries_.size(); ++i) {
      if (entries_[i].bandwidth == bandwidth) return static_cast<int>(i);
    }
    entries_.push_back({bandwidth, 0.0, 1.0});
    return static_cast<int>(entries_.size()) - 1;
  }

  double pole(int handle, double dt) {
    Entry& entry = entries_[handle];
    if (entry.dt != dt) {
      entry.pole = touchline::pole(entry.bandwidth, dt, rule_);
      entry.dt = dt;
    }
    return entry.pole;
  }

  double settling_time(int handle) const { return 5.0 / entries_[handle].bandwidth; }

 private:
  struct Entry {
    double bandwidth, dt, pole;
  };
  Discretization rule_;
  std::vector<Entry> entries_;
};

// What all channels share of one step.
struct Instant {
  double time = 0.0;
  long index = 0;       // of the accepted sample
  double max_gap = 0.0;  // an interval longer than this is not integrated over
};

// First-order low-pass of an innovation. `present`: there is a value at this instant.
template <class T>
struct LowPass {
  T value{};
  double since = 0.0;  // time of the last reset
  double time = -std::numeric_limits<double>::infinity();
  int bandwidth = 0;
  bool present = false;

  void restart(const Instant& now) {
    value = T{};
    since = time = now.time;
    present = true;
  }
  void step(const T& innovation, const Instant& now, double dt, Bandwidths& bandwidths) {
    const double a = bandwidths.pole(bandwidth, dt);
    value = a * value + (1.0 - a) * innovation;
    time = now.time;
    present = true;
  }
  bool stale(const Instant& now) const { return now.time - time > now.max_gap; }
  bool settled(const Instant& now, const Bandwidths& bandwidths) const {
    return present && now.time - since >= bandwidths.settling_time(bandwidth);
  }
};

inline bool is_finite(double v) { return std::isfinite(v); }

// A momentum balance: momentum p, known load u, external load e between two samples.
template <class T>
struct Balance {
  T p{}, u{}, e{};
  double time = -std::numeric_limits<double>::infinity();
  double dt = 0.0;
  long index = -1;         // the sample that p and u stand for
  bool anchored = false;   // p and u are of this instant
  bool fresh = false;      // e spans an interval that ends at this instant

  void skip() { anchored = fresh = false; }

  void observe(const T& p_now, const T& u_now, const Instant& now) {
    dt = now.time - time;
    fresh = index >= 0 && dt <= now.max_gap;
    if (fresh) e = (1.0 / dt) * (p_now - p) - 0.5 * (u + u_now);
    p = p_now;
    u = u_now;
    time = now.time;
    index = now.index;
    anchored = true;
  }
};

// Filters the innovation of a balance; starts anew where the balance did.
template <class T>
void follow(LowPass<T>& filter, const Balance<T>& balance, const Instant& now,
            Bandwidths& bandwidths) {
  filter.present = false;
  if (!balance.anchored) return;
  if (balance.fresh) {
    filter.step(balance.e, now, balance.dt, bandwidths);
  } else {
    filter.restart(now);
  }
}

}  // namespace touchline
