// SPDX-License-Identifier: Apache-2.0
// Does one finite axis of a force-torque sensor contradict the others? A contact loads everything
// inboard of it: these relations hold whatever is wrong with the model of the links.
//
// A sensor and the next one inboard. What a contact puts on the outer one, the inner one feels too,
// so that the segment between them feels nothing of it. Where that segment feels the exact opposite,
// the inner sensor feels nothing. Two contacts that squeeze the arm between them do that as well, but
// not along one axis of the sensor without a moment about its origin: only that counts. Nor do they
// along a diagonal of two axes, where the error lies of axes that are swapped.
//
// A torque at the innermost sensor without a force is no single touch: no link is as far away. Two
// may cancel, but then the joints between them feel it, or a sensor does. So nothing else may.
//
// A joint and the sensor right behind it, with no body between them: no touch makes them differ. One
// that is wrong alone is known by what the sensor's own segment feels of it; else it is one of these.
//
// What two quantities alone tell is not judged. A force at the innermost sensor that no joint feels
// may be a push on the link that carries it, and a torque of one joint a hand that pinches it.
// Theory: docs/theory.md, section 3.4.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/gates/tuning.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/result.hpp"
#include "touchline/robot.hpp"

namespace touchline {

class ParityWatch {
 public:
  // Of a robot whose parts fit; `loadable`: per row of its detector, can a contact load it?
  ParityWatch(const Robot& robot, const Observer& observer, const std::vector<char>& loadable,
              const GatesTuning& tuning = {})
      : tuning_(tuning),
        at_{robot.joints.size(), robot.sensors.size()},
        observer_(observer),
        rows_(robot.rows),
        period_(std::max(robot.noise.period, kShortest)),
        since_(at_.count(), 0.0) {
    const Layout& layout = observer.layout();
    first_.assign(layout.segments.size(), -1);
    for (std::size_t i = 0; i + 6 <= rows_.size(); ++i) {
      const int g = rows_[i].segment;
      if (rows_[i].component == 0 && layout.segments[g].sensor >= 0) first_[g] = static_cast<int>(i);
    }
    for (std::size_t g = 0; g < layout.segments.size(); ++g) {
      const int inner = layout.segments[g].sensor;
      if (inner < 0 || first_[g] < 0) continue;
      innermost_.push_back(static_cast<int>(g));
      for (const int t : layout.segments[g].successors) {
        const int own = layout.segment_of_sensor[t];
        if (first_[own] >= 0) pairs_.push_back({static_cast<int>(g), own});
      }
    }
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      if (loadable[i] != 0) continue;
      const int joint = observer.joints()[rows_[i].joint].nodes[0];
      for (const int t : layout.segments[rows_[i].segment].successors) {
        const int own = layout.segment_of_sensor[t];
        if (layout.is_outboard(observer.sensors()[t].node, joint) && first_[own] >= 0)
          bare_.push_back({static_cast<int>(i), own});
      }
    }
    for (const Pair& pair : pairs_)
      innermost_.erase(std::remove(innermost_.begin(), innermost_.end(), pair.outer),
                       innermost_.end());
    for (const int g : innermost_) {
      witnesses_.emplace_back();
      const int own = observer.sensors()[layout.segments[g].sensor].node;
      for (std::size_t i = 0; i < rows_.size(); ++i) {
        const int s = layout.segments[rows_[i].segment].sensor;
        const bool its_own = rows_[i].segment == g && rows_[i].joint < 0;
        if (!its_own && s >= 0 && layout.is_outboard(observer.sensors()[s].node, own))
          witnesses_.back().push_back(i);
      }
    }
  }

  // Takes what the whole robot says of a sample at `time` [s]. Calls `contradicted(channel)` for each
  // that the others contradict, and `unsure(channel)` for each of several of which one is wrong.
  template <class Contradicted, class Unsure>
  void step(const Result& result, double time, Contradicted&& contradicted, Unsure&& unsure) {
    const double dt = time - time_;
    time_ = time;
    const bool goes_on = dt > 0.0 && dt < tuning_.step_periods * period_;
    if (!goes_on || (result.health & kSettling) != 0) return begin_anew();
    for (Pair& pair : pairs_) compare(pair, result, dt, contradicted);
    for (const Bare& bare : bare_) compare_joint(bare, result, dt, contradicted, unsure);
    for (std::size_t i = 0; i < innermost_.size(); ++i)
      compare_couple(innermost_[i], witnesses_[i], result, dt, contradicted);
  }

  // What was suspected counts no more: samples are missing.
  void forget() {
    begin_anew();
    time_ = std::numeric_limits<double>::quiet_NaN();
  }

 private:
  static constexpr double kShortest = 1e-6;  // [s] of a period: no division by zero
  // Beside a contact between the two sensors: a hand there gives way to another one, but not by just as
  // much. So many thresholds must be wrong, that noise is less than a tenth of it; and that part may be
  // left, three times what filters that turn leave.
  static constexpr double kClear = 2.0, kLeft = 0.1;

  struct Pair {
    int inner, outer;  // segments
    // What both had while the outer one felt nothing [thresholds]: a contact that lasts between them
    // hides no fault that begins beside it.
    double own[6] = {}, between[6] = {};
    bool touched = false;  // was there such a contact?
  };

  struct Bare {
    int row, outer;  // of a joint; the segment of the sensor right behind it
  };

  void begin_anew() {
    std::fill(since_.begin(), since_.end(), 0.0);
    for (Pair& pair : pairs_) refer(pair, nullptr, nullptr);
  }

  // What a pair has now is what it had before; null: nothing, as of the baselines.
  static void refer(Pair& pair, const double* own, const double* between) {
    pair.touched = own != nullptr;
    for (int i = 0; i < 6; ++i) {
      pair.own[i] = own != nullptr ? own[i] : 0.0;
      pair.between[i] = between != nullptr ? between[i] : 0.0;
    }
  }

  // Has a relation been broken for long enough?
  bool broken(std::size_t channel, bool now, double dt) {
    since_[channel] = now ? since_[channel] + dt : 0.0;
    if (since_[channel] < std::max(tuning_.parity_dwell,
        (tuning_.parity_least_dwell - 0.5) * period_)) return false;
    since_[channel] = 0.0;
    return true;
  }

  // The load of a segment in its sensor's frame [N, Nm], from what it has of each axis [thresholds].
  Spatial load_of(int segment, const double* shares) const {
    double w[6];
    for (int i = 0; i < 6; ++i) w[i] = shares[i] * rows_[first_[segment] + i].contact;
    return load(w);
  }

  static double largest_size(const double* shares) {
    return std::fabs(shares[largest(shares)]);
  }

  template <class Contradicted>
  void compare(Pair& pair, const Result& result, double dt, Contradicted&& contradicted) {
    const Layout& layout = observer_.layout();
    const int outer = layout.segments[pair.outer].sensor;
    const std::size_t first = at_.wrench() + 6 * static_cast<std::size_t>(outer);
    const double* all_own = result.normalized.data() + first_[pair.outer];
    const double* all_between = result.normalized.data() + first_[pair.inner];
    if (largest_size(all_own) < tuning_.parity_noise) {
      const bool touched = largest_size(all_between) > tuning_.parity_noise;
      touched ? refer(pair, all_own, all_between) : refer(pair, nullptr, nullptr);
    }
    double own[6], between[6];
    for (int i = 0; i < 6; ++i) {
      own[i] = all_own[i] - pair.own[i];
      between[i] = all_between[i] - pair.between[i];
    }
    const bool settled = result.estimate.segment_settled(pair.inner) &&
                         result.estimate.segment_settled(pair.outer);
    bool now = settled && opposes(pair, own, between, pair.touched);
    if (settled && !now && pair.touched) {  // the contact has gone since then
      std::copy(all_own, all_own + 6, own);
      now = opposes(pair, all_own, all_between, false);
    }
    const int axis = now ? only_axis(outer, own) : -1;
    const int other = now && axis < 0 ? swapped_axis(pair.outer, own) : -1;
    if (!broken(first, axis >= 0 || other >= 0, dt)) return;
    if (axis >= 0) return contradicted(first + axis);
    contradicted(first + static_cast<std::size_t>(largest(own)));
    contradicted(first + static_cast<std::size_t>(other));
  }

  // Does the inner segment of a pair feel the opposite of what the outer one does [thresholds]?
  bool opposes(const Pair& pair, const double* own, const double* between, bool touched) const {
    if (!(largest_size(own) > 1.0 && largest_size(between) > tuning_.parity_noise)) return false;
    const Layout& layout = observer_.layout();
    const int inner = layout.segments[pair.inner].sensor, outer = layout.segments[pair.outer].sensor;
    double seen[6];
    store(wrench_to_child(observer_.sensor_pose(inner),
                          wrench_to_parent(observer_.sensor_pose(outer), load_of(pair.outer, own))),
          seen);
    double size2 = 0.0, left2 = 0.0;
    for (int i = 0; i < 6; ++i) {
      const double x = seen[i] / rows_[first_[pair.inner] + i].contact, left = x + between[i];
      size2 += x * x;
      left2 += left * left;
    }
    const double clear = touched ? kClear : tuning_.parity_clear;
    return size2 > clear * clear &&
           left2 < (touched ? kLeft * kLeft * size2
                            : std::max(tuning_.parity_left * tuning_.parity_left * size2,
                                       tuning_.parity_noise * tuning_.parity_noise));
  }

  // A joint's torque beyond what the sensor right behind it says, and beyond what its friction may add.
  template <class Contradicted, class Unsure>
  void compare_joint(const Bare& bare, const Result& result, double dt, Contradicted&& contradicted,
                     Unsure&& unsure) {
    const double beyond = std::fabs(result.normalized[bare.row]);
    const std::size_t torque = at_.tau() + static_cast<std::size_t>(rows_[bare.row].joint);
    const double expected = std::max(1.0, result.drift[bare.row] / rows_[bare.row].contact);
    if (!broken(torque, beyond > tuning_.parity_clear * expected, dt)) return;
    const double* own = result.normalized.data() + first_[bare.outer];
    const int sensor = observer_.layout().segments[bare.outer].sensor, axis = largest(own);
    const std::size_t first = at_.wrench() + 6 * static_cast<std::size_t>(sensor);
    if (std::fabs(own[axis]) < tuning_.parity_noise) return contradicted(torque);
    const double shown = std::fabs(own[axis]) * rows_[first_[bare.outer] + axis].contact;
    const double missed = beyond * rows_[bare.row].contact;
    if (std::fabs(shown - missed) < tuning_.parity_left * missed && only_axis(sensor, own) == axis)
      return contradicted(first + static_cast<std::size_t>(axis));
    unsure(torque);
    if (observer_.sensors()[sensor].turned) return;
    for (std::size_t i = 0; i < 6; ++i) {
      if (measures(bare, static_cast<int>(i))) unsure(first + i);
    }
  }

  // Is an axis of the sensor right behind a joint along that joint's, or nearly?
  bool measures(const Bare& bare, int axis) const {
    const int joint = observer_.joints()[rows_[bare.row].joint].nodes[0];
    const int sensor = observer_.layout().segments[bare.outer].sensor;
    const std::vector<Node>& nodes = observer_.tree().nodes();
    double unit[6] = {};
    unit[axis % 3] = 1.0;
    Vec3 along = load(unit).linear;
    bool fixed = true;
    for (int node = observer_.sensors()[sensor].node; node != joint; node = nodes[node].parent) {
      fixed = fixed && nodes[node].kind == NodeKind::fixed;
      along = nodes[node].placement.R * along;
    }
    const bool same_kind = (nodes[joint].kind == NodeKind::revolute) == (axis >= 3);
    return same_kind && (!fixed || std::fabs(along.z) > kAlong);
  }
  static constexpr double kAlong = 0.5;  // cosine: 60 degrees, an axis with less shows half or less

  static int largest(const double* shown) {
    int most = 0;
    for (int i = 1; i < 6; ++i)
      if (std::fabs(shown[i]) > std::fabs(shown[most])) most = i;
    return most;
  }

  // The axis of the same kind that shows as much as the largest one, where no other shows anything.
  // One of two swapped axes has too much of what the other one lacks. -1: it is not so.
  int swapped_axis(int segment, const double* shown) const {
    const int sensor = observer_.layout().segments[segment].sensor, most = largest(shown);
    if (observer_.sensors()[sensor].turned) return -1;
    const double little = std::max(tuning_.parity_noise,
        tuning_.parity_alone * std::fabs(shown[most]));
    int second = -1;
    for (int i = 0; i < 6; ++i) {
      if (i == most || !(std::fabs(shown[i]) > little)) continue;
      if (second >= 0 || i / 3 != most / 3) return -1;
      second = i;
    }
    if (second < 0) return -1;
    const auto size = [&](int i) {
      return std::fabs(shown[i]) * rows_[first_[segment] + i].contact;
    };
    const double a = size(most), b = size(second);
    return std::fabs(a - b) > tuning_.parity_alone * std::max(a, b) ? -1 : second;
  }

  // The only axis along which a sensor shows anything; -1: there are several. `shown`: in thresholds.
  int only_axis(int sensor, const double* shown) const {
    if (observer_.sensors()[sensor].turned) return -1;
    const int most = largest(shown);
    const double little = std::max(tuning_.parity_noise,
        tuning_.parity_alone * std::fabs(shown[most]));
    for (int i = 0; i < 6; ++i)
      if (i != most && std::fabs(shown[i]) > little) return -1;
    return most;
  }

  // A torque at the innermost sensor with a force so small that it would act beyond reach, where
  // nothing else outboard feels anything.
  template <class Contradicted>
  void compare_couple(int g, const std::vector<std::size_t>& witnesses, const Result& result,
                      double dt, Contradicted&& contradicted) {
    const double* x = result.normalized.data() + first_[g];
    bool now = result.estimate.segment_settled(g) &&
               std::max({std::fabs(x[3]), std::fabs(x[4]), std::fabs(x[5])}) > tuning_.parity_clear;
    if (now) {
      const Spatial w = load_of(g, x);
      double unsure = 0.0;  // of its force [N]
      for (int i = 0; i < 3; ++i) unsure = std::max(unsure,
          tuning_.parity_noise * rows_[first_[g] + i].contact);
      now = norm(w.angular) > tuning_.reach * (norm(w.linear) + unsure);
    }
    now = now && std::none_of(witnesses.begin(), witnesses.end(), [&](std::size_t i) {
      return std::fabs(result.normalized[i]) > tuning_.parity_noise;
    });
    const int sensor = observer_.layout().segments[g].sensor;
    const std::size_t first = at_.wrench() + 6 * static_cast<std::size_t>(sensor);
    const int axis = now ? only_axis(sensor, x) : -1;
    if (broken(first, axis >= 0, dt)) contradicted(first + axis);
  }

  GatesTuning tuning_;
  ChannelLayout at_;
  const Observer& observer_;
  std::vector<DetectionRow> rows_;
  double period_;
  std::vector<int> first_;  // per segment: its first row of six of a wrench; -1: none
  std::vector<Pair> pairs_;
  std::vector<Bare> bare_;
  std::vector<int> innermost_;  // segments whose sensor has none inboard
  std::vector<std::vector<std::size_t>> witnesses_;  // of each: other rows that its loads pass
  std::vector<double> since_;  // per channel: for how long its relation has been broken [s]
  double time_ = std::numeric_limits<double>::quiet_NaN();
};

}  // namespace touchline
