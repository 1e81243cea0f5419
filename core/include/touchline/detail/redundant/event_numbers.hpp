// SPDX-License-Identifier: Apache-2.0
// Events under the numbers under which they are told. Each pipeline counts its own ones. Where another
// one speaks, its events get new numbers, or go on with those of the one before.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

#include "touchline/pipeline.hpp"
#include "touchline/result.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class EventNumbers {
 public:
  // At most so many at a time.
  explicit EventNumbers(std::size_t most) { numbered_.reserve(most); }

  bool empty() const { return numbered_.empty(); }
  bool full() const { return numbered_.size() >= numbered_.capacity(); }
  // The next one, as far as told.
  int next() const { return next_; }
  void count_from(int next) { next_ = next; }

  bool knows(const Pipeline& of, int own) const { return find(of, own) != nullptr; }
  // Does event `own` of a pipeline go on with one that was told before?
  bool continues(const Pipeline& of, int own) const {
    const Numbered* n = find(of, own);
    return n != nullptr && n->continues;
  }
  // The number under which it has been told; -1: none of its own.
  int told(const Pipeline& of, int own) const {
    const Numbered* n = find(of, own);
    return n != nullptr ? n->told : -1;
  }

  // The number under which it is told. `keeps`: that of its pipeline, if it is new.
  int of(const Pipeline& pipeline, int own, bool keeps) {
    if (const Numbered* n = find(pipeline, own)) return n->told;
    if (keeps && own >= next_) return own;
    if (!full()) numbered_.push_back({&pipeline, own, next_, false, {}});
    return next_++;
  }

  // It goes on with an event.
  void go_on(const Pipeline& of, int own, const Event& with) {
    numbered_.push_back({&of, own, with.id, true, with});
  }

  void forget(const Pipeline& of, int own) {
    numbered_.erase(
        std::remove_if(numbered_.begin(), numbered_.end(),
                       [&](const Numbered& n) { return n.of == &of && n.own == own; }),
        numbered_.end());
  }
  void forget_all() { numbered_.clear(); }

  // What an event, or a contact of one, takes over of the one that it goes on with. `segment`: who
  // speaks knows no better than the one before on which segment it is.
  void take_over(const Pipeline& of, int own, bool segment, Event& event) const {
    const Numbered* n = find(of, own);
    if (n == nullptr || !n->continues) return;
    const Event& before = n->before;
    if (segment) event.segment = before.segment;
    event.detected = before.detected;
    event.level = std::max(event.level, before.level);
    if (before.decided == before.decided) event.decided = before.decided;
    const bool worse = event.link == before.link && event.position_std > kWorse * before.position_std;
    if (before.status == Status::located && (event.status != Status::located || worse))
      take_place(before, event);
    event.doubted = event.doubted && before.doubted;
    if (event.clamped != Clamped::yes) event.clamped = before.clamped;
    event.rate = std::fmax(event.rate, before.rate);
    take_forces(before, event);
  }
  void take_over(const Pipeline& of, int own, Contact& contact) const {
    const Numbered* n = find(of, own);
    if (n != nullptr && n->continues) contact.level = std::max(contact.level, n->before.level);
  }

 private:
  struct Numbered {
    const Pipeline* of;
    int own, told;
    bool continues = false;  // with an event, as that was told last:
    Event before;
  };

  // The later of two places on a link counts unless its error is so many times as large. Half: the
  // place is from before the loss, where the arm has moved on. Double: joint torques have the last word.
  static constexpr double kWorse = 2.0;

  // It was located better, as when there were more sensors.
  static void take_place(const Event& before, Event& event) {
    event.status = before.status;
    event.link = before.link;
    event.body_probability = before.body_probability;
    event.position = before.position;
    event.position_link = before.position_link;
    event.time_of_position = before.time_of_position;
    event.position_std = before.position_std;
    event.candidates = before.candidates;
    event.zone = before.zone;
    event.rank = before.rank;
    event.unknowns = before.unknowns;
  }

  // Of a segment whose sensor is lost no force is known. The largest ones are those of the whole event.
  static void take_forces(const Event& before, Event& event) {
    if (std::isnan(event.force.x)) event.force = before.force;
    event.force_peak = std::fmax(event.force_peak, before.force_peak);
    if (event.joint < 0 || before.torque_peak > event.torque_peak) {
      event.joint = before.joint;
      event.torque_peak = before.torque_peak;
    }
  }

  const Numbered* find(const Pipeline& of, int own) const {
    for (const Numbered& n : numbered_) {
      if (n.of == &of && n.own == own) return &n;
    }
    return nullptr;
  }

  std::vector<Numbered> numbered_;
  int next_ = 0;
};

}  // namespace touchline
