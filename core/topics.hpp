// SPDX-License-Identifier: Apache-2.0
// Joint states and wrenches that come one after the other, as CDR, become samples of a robot.
#pragma once

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <string>
#include <utility>
#include <vector>

#include "logs/cdr.hpp"
#include "touchline/live.hpp"

namespace touchline {

// What the messages of a robot mean.
struct TopicNames {
  std::vector<std::string> joints;      // names in the messages, in the robot's order
  std::vector<double> factors[3];       // (n) of position, velocity, effort into SI units
  std::vector<bool> measured;           // (n) is there a torque signal?
  std::vector<std::array<double, 6>> axes;  // of each sensor; NaN: the axis is not measured
};

// The median step between stamps of one stream.
class TypicalStep {
 public:
  // A stamp [s], behind `lost` that did not come.
  void take(double time, int lost) {
    const double step = time - last_;
    if (count_ > 0 && step <= 0.0 && step > -kSetBack) return;  // it came twice, or late
    if (count_ > 0 && step > 0.0) steps_[next_++ % kSteps] = step / (1 + lost);
    last_ = time;
    ++count_;
  }
  // [s]; 0 where it is not known yet.
  double seconds() const {
    const std::size_t known = std::min(next_, kSteps);
    if (known < 3) return 0.0;
    std::array<double, kSteps> sorted = steps_;
    std::nth_element(sorted.begin(), sorted.begin() + known / 2, sorted.begin() + known);
    return sorted[known / 2];
  }

 private:
  static constexpr std::size_t kSteps = 64;
  static constexpr double kSetBack = 1.0;  // [s] a clock that was set, not a message that is late

  std::array<double, kSteps> steps_{};
  std::size_t next_ = 0, count_ = 0;
  double last_ = 0.0;
};

// Each joint state makes a sample, with each sensor's last wrench by then, by their stamps. Where a
// wrench has come that would have belonged to a joint state before, joint states wait a moment for
// wrenches that are as new. Nothing is allocated for a message, but for a list of joint names that has not come before.
class TopicMerge {
 public:
  // What came, for those who count: `stream` 0 are the joint states, then each sensor.
  struct Note {
    int stream = 0;
    double time = 0.0, arrival = 0.0;  // [s]
    bool valid = true;
    int lost = 0;
  };

  explicit TopicMerge(TopicNames names)
      : names_(std::move(names)),
        joints_(names_.joints),
        waiting_(kStates),
        sensors_(names_.axes.size()),
        notes_(kNotes, Note()) {
    for (State& state : waiting_) state.signals.resize(3 * names_.joints.size());
  }

  std::size_t joints() const { return names_.joints.size(); }
  std::size_t sensors() const { return sensors_.size(); }
  const std::vector<std::string>& seen() const { return joints_.seen(); }
  std::size_t incomplete() const { return incomplete_; }  // before the first that named all joints
  Ring<Note>& notes() { return notes_; }
  bool full() const { return end_ - begin_ == kStates; }

  // A joint state, received at `arrival`; `now` is the time [s] of one without a stamp.
  void joint_state(const std::uint8_t* data, std::size_t size, double arrival, double now, int lost) {
    State& state = waiting_[end_ % kStates];
    std::fill(state.signals.begin(), state.signals.end(), kNan);
    const std::size_t n = joints();
    bool complete = false;
    double* s = state.signals.data();
    if (!joints_.decode(data, size, {&state.time, s, s + n, s + 2 * n, &complete})) return;
    if (!complete) {
      if (next_ == 0) ++incomplete_;
      return;
    }
    if (state.time == 0.0) state.time = now;
    for (std::size_t k = 0; k < 3; ++k)
      for (std::size_t j = 0; j < n; ++j) s[k * n + j] *= names_.factors[k][j];
    for (std::size_t j = 0; j < n; ++j)
      if (!names_.measured[j]) s[2 * n + j] = kNan;
    state.arrival = arrival;
    state.number = next_ += 1 + lost;
    step_.take(state.time, lost);
    bool valid = true;
    for (std::size_t j = 0; j < n; ++j) valid = valid && std::isfinite(s[j]);
    note({0, state.time, arrival, valid, lost});
    ++end_;
  }

  // A wrench of sensor `k`.
  void wrench(std::size_t k, const std::uint8_t* data, std::size_t size, double arrival, double now,
              int lost) {
    Wrench found;
    if (!logs::decode_wrench(data, size, &found.time, found.values.data())) return;
    if (found.time == 0.0) found.time = now;
    Sensor& sensor = sensors_[k];
    bool valid = true;
    for (int i = 0; i < 6; ++i) {
      found.values[i] *= names_.axes[k][i];
      valid = valid && (std::isnan(names_.axes[k][i]) || std::isfinite(found.values[i]));
    }
    sensor.step.take(found.time, lost);
    note({static_cast<int>(k) + 1, found.time, arrival, valid, lost});
    const double last = sensor.newest();
    const bool set_back = found.time < last - kClock;
    if (set_back) sensor.begin = sensor.end, sensor.current.time = -kInf;
    if (!set_back && found.time <= last) return;
    if (found.time <= merged_) {  // its joint state could not wait
      sensor.awaited = kAwaited;
      sensor.lag = merged_ - found.time;
    }
    if (sensor.end - sensor.begin == kAhead) ++sensor.begin;
    sensor.coming[sensor.end++ % kAhead] = found;
  }

  // Is there a joint state whose wrenches have come, or that had waited for them long enough at `looked`,
  // before all topics were looked at last [s]? What has come since is not given up unseen.
  bool ready(double looked) const { return begin_ != end_ && (!awaits() || looked >= due()); }
  // When the oldest joint state has waited long enough [s]; infinite where there is none.
  double due() const {
    if (begin_ == end_) return kInf;
    const double arrival = waiting_[begin_ % kStates].arrival;
    return awaits() ? arrival + std::min(kHold, 0.5 * step_.seconds()) : arrival;
  }

  // The time of the oldest joint state [s].
  double time() const { return waiting_[begin_ % kStates].time; }

  // Takes the oldest joint state, and what belongs to it.
  void take(Arrived& out) {
    const State& state = waiting_[begin_++ % kStates];
    out.time = merged_ = state.time;
    out.arrival = state.arrival;
    out.sequence = state.number - 1;
    std::copy(state.signals.begin(), state.signals.end(), out.signals.begin());
    double* to = out.signals.data() + state.signals.size();
    for (std::size_t k = 0; k < sensors_.size(); ++k, to += 6) {
      Sensor& sensor = sensors_[k];
      sensor.follow(state.time);
      out.ages[k] = state.time - sensor.current.time;
      const bool near = std::fabs(out.ages[k]) <= reach(sensor);
      for (int i = 0; i < 6; ++i) to[i] = near ? sensor.current.values[i] : kNan;
    }
  }

 private:
  static constexpr double kInf = std::numeric_limits<double>::infinity();
  static constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  static constexpr double kClock = 1.0;  // [s] by which two topics' stamps may differ on one clock
  static constexpr double kReach = 3.0;  // periods after which a wrench is none any more,
  static constexpr double kLeastReach = 0.01, kMostReach = 0.1;  // [s] within these
  static constexpr double kHold = 1e-3;  // [s] that a joint state waits for its wrenches at most
  static constexpr int kAwaited = 100;   // joint states that wait after one that could not
  static constexpr std::size_t kStates = 256;  // joint states that may wait
  static constexpr std::size_t kAhead = 1024;  // wrenches that wait for their joint state
  static constexpr std::size_t kNotes = 1 << 16;  // a second and more of eight topics at 8 kHz

  struct State {
    double time = 0.0, arrival = 0.0;  // [s]
    long long number = 0;
    std::vector<double> signals;
  };
  struct Wrench {
    double time = -kInf;
    std::array<double, 6> values{kNan, kNan, kNan, kNan, kNan, kNan};
  };
  // Does the oldest joint state wait for a wrench, and is there room for others meanwhile?
  bool awaits() const {
    const double time = waiting_[begin_ % kStates].time;
    return !full() && std::any_of(sensors_.begin(), sensors_.end(), [time](const Sensor& sensor) {
      return sensor.awaited > 0 && sensor.newest() < sensor.wanted(time);
    });
  }

  struct Sensor {
    Wrench current;                 // of the last joint state
    std::vector<Wrench> coming = std::vector<Wrench>(kAhead);  // newer ones
    std::size_t begin = 0, end = 0;
    int awaited = 0;   // for how many joint states yet their wrench is waited for
    double lag = 0.0;  // by which the stamp of that wrench is behind the joint state's [s]
    TypicalStep step;

    double newest() const { return begin == end ? current.time : coming[(end - 1) % kAhead].time; }
    void follow(double time) {
      if (time < current.time - kClock) current.time = -kInf;  // the clock was set back
      while (begin != end && coming[begin % kAhead].time <= time) current = coming[begin++ % kAhead];
      if (awaited > 0) awaited = current.time >= wanted(time) ? kAwaited : awaited - 1;
    }
    // The oldest stamp of a wrench that belongs to a joint state.
    double wanted(double time) const { return time - lag - 0.25 * step.seconds(); }
  };

  double reach(const Sensor& sensor) const {
    const double period = std::max(sensor.step.seconds(), step_.seconds());
    return std::min(std::max(kReach * period, kLeastReach), kMostReach);
  }

  void note(const Note& told) {
    if (Note* slot = notes_.vacant()) {
      *slot = told;
      notes_.publish();
    }
  }

  TopicNames names_;
  logs::JointStateDecoder joints_;
  TypicalStep step_;
  std::vector<State> waiting_;
  std::size_t begin_ = 0, end_ = 0;  // of those that wait
  long long next_ = 0;               // number of joint states so far, the lost ones included
  std::size_t incomplete_ = 0;
  double merged_ = -kInf;  // stamp of the last joint state that was taken [s]
  std::vector<Sensor> sensors_;
  Ring<Note> notes_;
};

}  // namespace touchline
