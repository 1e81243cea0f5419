// SPDX-License-Identifier: Apache-2.0
// Which channels alone explain what is felt, and have done so for long enough to be told. A wrong sign
// or scale is wrong by a multiple of what a channel carries. It comes within a sample, or as that
// changes. What is wrong by more, or comes otherwise, and may be a push along an axis of a sensor, has to
// last for longer than most pushes do. No allocation per sample.
// Theory: docs/theory.md, section 3.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "touchline/detail/detector/row_lanes.hpp"
#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/place/lone_channel.hpp"
#include "touchline/robot.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class SuspectWatch {
 public:
  // Of a robot whose parts fit; `layout` is its observer's.
  SuspectWatch(const Robot& robot, const Layout& layout)
      : at_{robot.joints.size(), robot.sensors.size()},
        contact_(at_.count(), std::numeric_limits<double>::infinity()),
        now_(at_.count(), 0),
        told_(at_.count(), 0),
        beyond_(at_.count(), 0),
        little_(at_.count(), 0),
        since_(at_.count(), kNever),
        seen_(at_.count(), -kNever),
        until_(at_.count(), -kNever),
        now_read_(at_.count() - at_.tau(), std::nan("")),
        last_(now_read_),
        read_(now_read_),
        lately_(now_read_),
        stepped_(at_.count() - at_.tau()),
        usual_(stepped_),
        scale_(stepped_),
        bias_(stepped_),
        bandwidth_(stepped_),
        held_(stepped_),
        first_(at_.count() - at_.tau()),
        compensated_(at_.sensors),
        innermost_(at_.sensors, 1) {
    for (std::size_t j = 0; j < at_.joints; ++j) {
      const JointRow& joint = robot.joints[j];
      scale_[j] = joint.measured() ? joint.sign * joint.gain : std::nan("");
      bias_[j] = joint.bias;
      bandwidth_[j] = kNever;  // no filter
    }
    for (std::size_t s = 0; s < at_.sensors; ++s) {
      const SensorRow& sensor = robot.sensors[s];
      compensated_[s] = sensor.gravity_compensated ? 1 : 0;
      for (std::size_t k = 0; k < 6; ++k) {
        const std::size_t i = at_.joints + 6 * s + k;
        scale_[i] = sensor.sign;
        bias_[i] = sensor.bias[k];
        bandwidth_[i] = sensor.bandwidth;
      }
    }
    for (const Segment& segment : layout.segments) {
      if (segment.sensor < 0) continue;
      for (const int outer : segment.successors) innermost_[outer] = 0;
    }
    for (const DetectionRow& row : robot.rows) {
      const int sensor = layout.segments[row.segment].sensor;
      if (row.joint >= 0) contact_[at_.tau() + row.joint] = row.contact;
      if (row.component >= 0 && sensor >= 0)
        contact_[at_.wrench() + 6 * sensor + row.component] = row.contact;
    }
  }

  // A sample begins; `add` takes what is suspected of a segment; then `finish`.
  void begin(const Sample& sample) {
    std::fill(now_.begin(), now_.end(), 0);
    const double dt = sample.time - time_;
    time_ = sample.time;
    const double forgets = dt > 0.0 ? dt / (kLately + dt) : 0.0;
    std::copy_n(sample.tau, at_.joints, now_read_.data());
    std::copy_n(sample.wrench, 6 * at_.sensors, now_read_.data() + at_.joints);
    for (std::size_t i = 0; i < now_read_.size(); i += kLanes) read(i, dt, forgets);
  }
  // `over`: does any row of the segment exceed its limit still? Where none does a push has let go, and what
  // is left of an arm in motion is its model's error: a part of a threshold is no fault then.
  void add(const Suspect& suspect, bool over) {
    if (!suspect.any() || !suspect.told) return;
    const double least = (over ? kLeast : 1.0) * contact_[suspect.channel];
    if (!(std::fabs(suspect.error) > least)) return;
    const char beyond = suspect.touched && is_beyond(suspect) ? 1 : 0;
    if (now_[suspect.channel] == 0 && !(since_[suspect.channel] < kNever)) began(suspect);
    if (suspect.touched && has_risen(suspect)) held_[suspect.channel - at_.tau()] = 1.0;
    const char little = is_little(suspect) ? 1 : 0;
    for (const int c : {suspect.channel, suspect.other}) {
      if (c < 0) continue;
      now_[c] = 1;
      little_[c] = little;
      beyond_[c] = std::max(beyond_[c], beyond);  // a scale is never wrong by more, so it was none
    }
    any_ = true;
  }
  // Calls `out(channel, until)` for each that tells nothing until then [s].
  template <class Out>
  void finish(double time, Out&& out) {
    if (!any_) return;  // none is suspected or told, nor was it of late
    any_ = false;
    for (std::size_t c = 0; c < now_.size(); ++c) {
      if (now_[c] != 0) seen_[c] = time;
      if (!(time - seen_[c] < kMissed)) {
        since_[c] = kNever;
        beyond_[c] = little_[c] = 0;
        if (c >= at_.tau()) held_[c - at_.tau()] = 0.0;
      }
      if (now_[c] != 0 && !(since_[c] <= time)) since_[c] = time;
      const bool rises = c >= at_.tau() && held_[c - at_.tau()] > 0.0;
      const double dwell = beyond_[c] != 0 || rises ? kLasts
                           : little_[c] != 0                 ? kLittleLasts
                                                             : kDwell;
      if (now_[c] != 0 && time - since_[c] >= dwell) out(static_cast<int>(c), until_[c] = time + kOut);
      told_[c] = time < until_[c];
      any_ = any_ || since_[c] < kNever || !(time >= until_[c]);
    }
  }

  // Per channel, as `ChannelLayout`: is it told?
  const std::vector<char>& told() const { return told_; }

 private:
  static constexpr double kNever = std::numeric_limits<double>::infinity();
  static constexpr double kOut = 2.0;     // [s] for which it tells nothing after that
  static constexpr double kDwell = 0.02;  // [s] for which it explains all: a contact rises to more
  // Of what a channel carries, and of what that has changed by of late: an error of less is no wrong scale,
  // and what a model errs by in motion. Unless it came at once it has to last for longer [s]. Half of the
  // part: a model that is 5 % off is told as a fault. Double: so may half a torque be, which is told later.
  static constexpr double kLittle = 0.3, kLittleLasts = 0.2;
  // Of the mean step: of 5,000 steps of white noise the largest is 5.4. Half: noise comes at once. Double:
  // biases of some thresholds come slowly.
  static constexpr double kUnusual = 8.0;
  // [s] of what may be a push, too. Biases and drifts are all that is wrong by more than a multiple: of
  // the two seconds in which these are to be told it leaves a tenth. Half: leaning on the first link for
  // a second is told as a fault.
  static constexpr double kLasts = 1.8;
  // Times what a channel carries: a wrong sign is wrong by twice of it, and filters and noise by the rest.
  static constexpr double kMultiple = 3.0;
  // Of the error: a fault that comes at once brings this part within one sample. A push that rises in
  // five brings a third.
  static constexpr double kAtOnce = 0.5;
  // Thresholds by which its error has grown since it was suspected. Half: noise does so beside a push.
  // Double: a push along an axis is told as a fault of an arm that moves fast.
  static constexpr double kGrown = 2.0;
  // [s] over which it has carried something lately. Half: a lie that grows with a slow motion is a push for
  // longer. Double: where the arm has come to in the last seconds counts less.
  static constexpr double kLately = 5.0;
  // Of the error: what two swapped axes may differ by beside it, by noise and the model's errors.
  static constexpr double kUnlike = 0.5;
  static constexpr double kMissed = 0.01; // [s] for which noise may hide it
  static constexpr double kLeast = 0.7;   // of the threshold of a contact: what it must be wrong by

  // The readings of torques and axes from `i` on, counted together, to their signs and scales [Nm or N,
  // Nm]; what is not read stays as it was. Each lane does what a plain double would.
  void read(std::size_t i, double dt, double forgets) {
    const Lanes zero = all_lanes(0.0), one = all_lanes(1.0);
    const Lanes now = scale_.at(i) * now_read_.at(i) - bias_.at(i);
    const Lanes x = (dt > 0.0 ? dt : 0.0) * bandwidth_.at(i);
    const Lanes follows = x < all_lanes(kNever) ? x / (one + x) : one;
    const Lanes read = read_.at(i), lately = lately_.at(i), stepped = stepped_.at(i), usual = usual_.at(i);
    const auto here = now == now, first = read != read;
    const Lanes way = now - last_.at(i), step = first ? zero : (way < zero ? -way : way);
    const Lanes moved = held_.at(i) > zero ? lately : lately + forgets * (now - lately);
    const Lanes kept = (1.0 - forgets) * stepped;
    read_.put(i, here ? (first ? now : read + follows * (now - read)) : read);
    lately_.put(i, here ? (first ? now : moved) : lately);
    stepped_.put(i, here ? (step < kept ? kept : step) : stepped);
    usual_.put(i, here ? usual + forgets * (step - usual) : usual);
    last_.put(i, here ? now : last_.at(i));
  }

  // May the model err by that? Of what is compensated before it is read nothing is known.
  bool is_little(const Suspect& suspect) const {
    const std::size_t i = suspect.channel - at_.tau();
    if (i >= at_.joints && compensated_[(i - at_.joints) / 6] != 0) return false;
    const double size = std::fabs(suspect.error), carried = read_[i] + suspect.error;
    if (stepped_[i] >= std::max(kAtOnce * size, kUnusual * usual_[i])) return false;
    return size < kLittle * std::min(std::fabs(carried), std::fabs(carried - lately_[i]));
  }

  // Is a force wrong by more than a multiple of what its axis carries, or two that are swapped by
  // something else than they differ by? What they carry is what they read, less the error. Of what is
  // compensated before it is read nothing is known. No push loads a moment alone.
  bool is_beyond(const Suspect& suspect) const {
    if (suspect.channel < static_cast<int>(at_.wrench())) return false;
    const std::size_t axis = suspect.channel - at_.wrench(), i = at_.joints + axis;
    if (axis % 6 >= 3 || compensated_[axis / 6] != 0) return false;
    const double error = suspect.error;  // of a load, which is read with the other sign
    const double carried = read_[i] + error;
    if (suspect.other < 0) return std::fabs(error) > kMultiple * std::fabs(carried);
    const double other = read_[suspect.other - at_.tau()] - error;
    return std::fabs(error - (carried - other)) > kUnlike * std::fabs(error);
  }

  // A channel is suspected from now on.
  void began(const Suspect& suspect) {
    const std::size_t i = suspect.channel - at_.tau();
    first_[i] = {suspect.error, read_[i] + suspect.error};
  }

  // Has a force of the innermost sensor become wrong over several samples, by more than what it carries
  // has changed by of late, or since it was suspected? It may carry so much that a push is a small part
  // of that. An outer sensor has another one inboard, which feels the push.
  bool has_risen(const Suspect& suspect) const {
    if (suspect.channel < static_cast<int>(at_.wrench()) || suspect.other >= 0) return false;
    const std::size_t axis = suspect.channel - at_.wrench(), i = at_.joints + axis;
    if (axis % 6 >= 3 || compensated_[axis / 6] != 0 || innermost_[axis / 6] == 0) return false;
    const double size = std::fabs(suspect.error), carried = read_[i] + suspect.error;
    if (!(stepped_[i] < kAtOnce * size)) return false;
    const double grown = std::fabs(suspect.error - first_[i].error);
    return size > kMultiple * std::fabs(carried - lately_[i]) ||
           (grown > kGrown * contact_[suspect.channel] &&
            grown > kMultiple * std::fabs(carried - first_[i].carried));
  }

  // What an axis was wrong by, and carried, as it was suspected first [N, Nm].
  struct First {
    double error, carried;
  };

  ChannelLayout at_;
  std::vector<double> contact_;  // per channel: threshold of a contact [N, Nm]
  std::vector<char> now_, told_, beyond_, little_;
  bool any_ = false;
  std::vector<double> since_, seen_, until_;  // [s]
  // Per torque and axis [N, Nm]: its reading as given, its last one, and readings as the filters have
  // them. Then their mean of late, but for what has risen, and their largest and mean steps of late.
  RowLanes now_read_, last_, read_, lately_, stepped_, usual_;
  RowLanes scale_, bias_, bandwidth_;  // to make readings of what is given; of the filter [rad/s]
  RowLanes held_;                      // 1: it has risen while it was suspected, see `has_risen`
  std::vector<First> first_;  // per torque and axis
  std::vector<char> compensated_;  // per sensor: is gravity taken out of what it reads?
  std::vector<char> innermost_;  // per sensor: has it none inboard?
  double time_ = std::numeric_limits<double>::quiet_NaN();  // [s]
};

}  // namespace touchline
