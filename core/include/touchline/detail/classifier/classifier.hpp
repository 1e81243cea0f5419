// SPDX-License-Identifier: Apache-2.0
// Contact or collision, and clamped or free: what kind of touch each segment feels. A collision
// begins fast: the force grows by more than `onset` to more than `collision`. What has not begun so
// within `decide_within` is a contact; a later blow makes it a collision. Forces have passed the
// observer's low-pass, which shows a step of F as a rate of at most 0.63 F / `rate_window` (K = 100).
// A filter that begins anew rises from zero whatever lasts: that is no growth of a force.
// Of joint torques the largest stands for the force. Where no other one shows a blow it may be wrong:
// `by_one_joint` tells.
// No allocation per sample.
// Theory: docs/theory.md, section 7.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <utility>
#include <vector>

#include "touchline/detail/classifier/clamping.hpp"
#include "touchline/detail/classifier/force_history.hpp"
#include "touchline/detail/classifier/tuning.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

enum class Kind { none = 0, undecided = 1, contact = 2, collision = 3 };

// From when on a touch of a segment is a blow.
struct BlowLimits {
  double onset;             // growth of its force [N/s]
  double collision;         // size of its force [N]
  std::vector<int> joints;  // whose torques stand for its force; none: its wrench is known
};

class Classifier {
 public:
  Classifier(const Observer& observer, std::vector<BlowLimits> limits,
             const ClassifierTuning& tuning = {})
      : tuning_(tuning),
        row_(observer.row_layout()),
        limits_(std::move(limits)),
        bandwidths_(limits_.size()),
        sizes_(2 * limits_.size()),
        touches_(limits_.size()),
        settled_(limits_.size(), 0),
        left_out_(static_cast<std::size_t>(row_.joints), -std::numeric_limits<double>::infinity()),
        history_(sizes_.size(), tuning_.rate_window),
        clamping_(limits_.size(), tuning_) {
    bool good = limits_.size() == static_cast<std::size_t>(row_.segments);
    for (const BlowLimits& of_segment : limits_) {
      for (const int joint : of_segment.joints) good = good && joint >= 0 && joint < row_.joints;
    }
    if (!good) throw std::invalid_argument("the limits do not fit the observer");
    for (std::size_t g = 0; g < limits_.size(); ++g) {
      const int sensor = observer.layout().segments[g].sensor;
      if (sensor >= 0) bandwidths_[g] = observer.sensors()[sensor].bandwidth;
      for (const JointRow& joint : observer.joints()) {
        if (sensor < 0) bandwidths_[g] = std::max(bandwidths_[g], joint.bandwidth);
      }
    }
  }

  Classifier(const Classifier&) = delete;
  Classifier& operator=(const Classifier&) = delete;

  std::size_t width() const { return static_cast<std::size_t>(row_.width()); }
  std::size_t segments() const { return limits_.size(); }

  // Takes a sample: the observer's row and the detector's level of each segment.
  void step(double time, const double* row, const double* levels) {
    step(time, row, levels, [](std::size_t) { return false; });
  }
  // The same; what segment g shows is no blow where `doubted(g)`.
  template <class Doubted>
  void step(double time, const double* row, const double* levels, Doubted&& doubted) {
    time_ = std::fmax(time_, time);
    for (std::size_t g = 0; g < limits_.size(); ++g) find_sizes(g, row);
    history_.add(time_, sizes_.data());
    for (std::size_t g = 0; g < limits_.size(); ++g) {
      const int settled = count_settled(g, row);
      if (settled == std::exchange(settled_[g], settled)) continue;
      history_.begin_anew(g);
      history_.begin_anew(other(g));
    }
    clamping_.step(time_, row + row_.segment_wrench(), levels);
    for (std::size_t g = 0; g < limits_.size(); ++g)
      decide(static_cast<int>(g), levels[g] > 0.0, doubted(g));
  }

  // The torque of joint j shows no blow until then [s].
  void leave_out(std::size_t j, double until) { left_out_[j] = std::fmax(left_out_[j], until); }
  // What segment g has shown since then [s] was no blow.
  void forget_blows(std::size_t g, double since) {
    Touch& touch = touches_[g];
    if (!(touch.blow >= since)) return;
    touch.blow = kNaN;
    touch.borne_out = false;
    touch.kind = Kind::undecided;
  }

  // What is said of the contacts on segment g in that sample.
  void consider(int g, const Reports& reports) { clamping_.consider(g, reports); }

  Kind kind(int g) const { return touches_[g].kind; }
  // Of a contact that carries this share of the load on segment g.
  Kind kind(int g, double share) const {
    return share >= tuning_.leading_share ? kind(g) : std::min(kind(g), Kind::contact);
  }
  // Contact k on segment g.
  bool clamped(int g, int k) const { return clamping_(g, k); }
  // When the present touch of a segment last began fast, or grew as fast [s]; NaN: never.
  double blow(int g) const { return touches_[g].blow; }
  // Is the present touch of a segment a collision by the torque of one joint alone?
  bool by_one_joint(int g) const {
    return touches_[g].kind == Kind::collision && !touches_[g].borne_out;
  }
  // Of the segment's force [N/s]; NaN where it is not touched.
  double rate(int g) const { return touches_[g].rate; }

 private:
  static constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

  struct Touch {
    Kind kind = Kind::none;
    double begin = 0.0, rate = kNaN, blow = kNaN;
    bool borne_out = false;  // has more than one joint shown a blow?
  };

  // Where the second size of segment g stands.
  std::size_t other(std::size_t g) const { return limits_.size() + g; }

  // Of the force on segment g, from what has settled; the second is what its other joints say without the
  // one that says most [N]. A wrench needs no second.
  void find_sizes(std::size_t g, const double* row) {
    const double* w = row + row_.segment_wrench() + 6 * g;
    double &most = sizes_[g], &second = sizes_[other(g)];
    if (limits_[g].joints.empty()) {
      most = second = row[row_.segment_settled() + g] > 0.0 ? norm(Vec3{w[0], w[1], w[2]}) : kNaN;
      return;
    }
    most = second = 0.0;
    for (const int joint : limits_[g].joints) {
      if (!counts(joint, row)) continue;
      const double size = std::fabs(row[row_.segment_torque() + joint]) / tuning_.lever;
      second = std::fmax(second, std::fmin(size, most));
      most = std::fmax(most, size);
    }
  }

  // Does the torque of a joint stand for a force?
  bool counts(int joint, const double* row) const {
    return row[row_.joint_settled() + joint] > 0.0 && !(time_ < left_out_[joint]);
  }

  // How much of what segment g is felt with has settled, and is not left out.
  int count_settled(std::size_t g, const double* row) const {
    if (limits_[g].joints.empty()) return row[row_.segment_settled() + g] > 0.0 ? 1 : 0;
    int count = 0;
    for (const int joint : limits_[g].joints) count += counts(joint, row) ? 1 : 0;
    return count;
  }

  void decide(int g, bool touched, bool doubted) {
    Touch& touch = touches_[g];
    if (!touched) {
      touch = Touch{};
      return;
    }
    if (touch.kind == Kind::none) touch = {Kind::undecided, time_, kNaN};
    touch.rate = history_.rate(g);
    if (!doubted && is_blow(g, g)) {
      touch.kind = Kind::collision;
      touch.blow = time_;
      touch.borne_out = touch.borne_out || is_blow(g, other(g));
    } else if (touch.kind == Kind::undecided && time_ >= touch.begin + tuning_.decide_within) {
      touch.kind = Kind::contact;
    }
  }

  // Does a size of segment g grow as a blow does?
  bool is_blow(std::size_t g, std::size_t size) const {
    const double rate = history_.rate(size);
    return rate > limits_[g].onset && sizes_[size] + rate / bandwidths_[g] > limits_[g].collision;
  }

  ClassifierTuning tuning_;
  RowLayout row_;
  std::vector<BlowLimits> limits_;
  std::vector<double> bandwidths_;  // of the segments' wrenches [rad/s]
  std::vector<double> sizes_;  // of the segments' forces, and then their second ones [N]
  std::vector<Touch> touches_;
  std::vector<int> settled_;  // per segment, at the last sample: see `count_settled`
  std::vector<double> left_out_;  // per joint, until when [s]
  ForceHistory history_;
  Clamping clamping_;
  double time_ = -std::numeric_limits<double>::infinity();
};

}  // namespace touchline
