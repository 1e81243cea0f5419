// SPDX-License-Identifier: Apache-2.0
// Stand-ins at work: pipelines of a robot without some of its sensors, for when these are lost.
// Theory: docs/theory.md, section 3.6.
#pragma once

#include <algorithm>
#include <cstddef>
#include <memory>
#include <utility>
#include <vector>

#include "touchline/detail/observer/layout.hpp"
#include "touchline/pipeline.hpp"
#include "touchline/result.hpp"
#include "touchline/robot.hpp"

namespace touchline {

// A stand-in at work.
class Deputy {
 public:
  // Of a stand-in that fits the robot that `whole` is of.
  Deputy(StandIn of, const Pipeline& whole)
      : given_{std::move(of.lost), {}, std::move(of.sensors), std::move(of.segments),
               std::move(of.rows), std::move(of.watch)},
        pipeline_(std::move(of.robot), whole.tuning()),
        wrench_(6 * given_.sensors.size()),
        without_(whole.robot().sensors.size(), 0),
        told_as_(whole.robot().segment_names.size(), -1),
        parts_(given_.segments.size()) {
    for (const int s : given_.lost) without_[s] = 1;
    find_parts(whole.observer().layout());
    for (std::size_t g = 0; g < parts_.size(); ++g) {
      if (pipeline_.observer().layout().segments[g].sensor < 0) continue;
      for (std::size_t part = 0; part < told_as_.size(); ++part) {
        if (told_as_[part] == given_.segments[g]) parts_[g].push_back(static_cast<int>(part));
      }
    }
  }

  // Without its robot, which the pipeline has.
  const StandIn& given() const { return given_; }
  const Pipeline& pipeline() const { return pipeline_; }
  Pipeline& pipeline() { return pipeline_; }
  bool is_without(std::size_t sensor) const { return without_[sensor] != 0; }
  // The segment as which segment g of the whole robot, which is part of it here, is told.
  int told_as(std::size_t g) const { return told_as_[g]; }
  // Has it been told nothing yet?
  bool fresh() const { return !used_; }
  // Did it feel anything in the last sample that it took?
  bool feels() const { return feels_; }

  // Takes a sample of the whole robot; see `Pipeline::update`.
  Result update(const Sample& sample) {
    used_ = true;
    for (std::size_t s = 0; s < given_.sensors.size(); ++s)
      std::copy_n(sample.wrench + 6 * given_.sensors[s], 6, wrench_.data() + 6 * s);
    const Result result =
        pipeline_.update({sample.time, sample.q, sample.qd, sample.tau, wrench_.data()});
    feels_ = !result.contacts.empty();
    return result;
  }

  // See `Pipeline`; sensors and segments are those of the whole robot.
  void begin_torque_anew(std::size_t j) { pipeline_.begin_torque_anew(j); }
  void begin_sensor_anew(std::size_t s) {
    if (is_without(s)) return;
    const auto found =
        std::find(given_.sensors.begin(), given_.sensors.end(), static_cast<int>(s));
    pipeline_.begin_sensor_anew(static_cast<std::size_t>(found - given_.sensors.begin()));
  }
  void doubt(std::size_t g, double since, double until) {
    visit_parts(g, [&](std::size_t own) { pipeline_.doubt(own, since, until); });
  }
  void doubt_torque(std::size_t g, std::size_t j, double since, double until) {
    visit_parts(g, [&](std::size_t own) { pipeline_.doubt_torque(own, j, since, until); });
  }

  // Begins with the last sample that `whole` has taken: what that has learned and filtered goes on.
  void begin(const Pipeline& whole, const Sample& last) {
    learn(whole);
    update(last);
    pipeline_.go_on_from(whole, given_.sensors, parts_);
  }

 private:
  // Its own segments that segment g of the whole robot is told as.
  template <class Visit>
  void visit_parts(std::size_t g, Visit&& visit) {
    for (std::size_t i = 0; i < given_.segments.size(); ++i) {
      if (told_as_[g] != given_.segments[i]) continue;
      used_ = true;
      visit(i);
    }
  }

  // Tells it what stands on the arm while nothing touches it, as `whole` has learned that.
  void learn(const Pipeline& whole) {
    used_ = true;
    const std::vector<DetectionRow>& rows = pipeline_.robot().rows;
    for (std::size_t i = 0; i < rows.size(); ++i) {
      const int known = given_.rows[i];
      if (rows[i].joint >= 0 && known >= 0 && whole.known_for(known) > 0.0)
        pipeline_.go_on_from(whole, known, static_cast<int>(i), whole.baseline(known));
      if (rows[i].component == 0) learn_wrench(whole, i);
    }
  }

  // Which segments of the whole robot are one here.
  void find_parts(const Layout& whole) {
    const Layout& own = pipeline_.observer().layout();
    for (std::size_t g = 0; g < own.segments.size(); ++g) {
      if (own.segments[g].sensor < 0) {  // its root has all that no sensor has
        for (int& part : told_as_) part = part < 0 ? given_.segments[g] : part;
      } else {
        const int sensor = given_.sensors[own.segments[g].sensor];
        add_parts(whole, whole.segment_of_sensor[sensor], given_.segments[g]);
      }
    }
  }
  void add_parts(const Layout& whole, int segment, int told) {
    told_as_[segment] = told;
    for (const int t : whole.segments[segment].successors) {
      if (is_without(t)) add_parts(whole, whole.segment_of_sensor[t], told);
    }
  }

  // The six rows of a segment from row `first` on: the sum of those of its parts.
  void learn_wrench(const Pipeline& whole, std::size_t first) {
    const Observer& observer = whole.observer();
    const std::vector<DetectionRow>& rows = pipeline_.robot().rows;
    const std::vector<DetectionRow>& of = whole.robot().rows;
    const int g = rows[first].segment, sensor = pipeline_.observer().layout().segments[g].sensor;
    if (first + 6 > rows.size() || sensor < 0) return;
    Spatial sum{};
    double age = kAbsurd;
    for (std::size_t i = 0; i + 6 <= of.size(); ++i) {
      if (of[i].component != 0 || told_as_[of[i].segment] != given_.segments[g]) continue;
      const int part = observer.layout().segments[of[i].segment].sensor;
      if (part < 0) continue;
      double stands[6];
      for (int k = 0; k < 6; ++k) {
        stands[k] = whole.baseline(static_cast<int>(i) + k);
        age = std::min(age, whole.known_for(static_cast<int>(i) + k));
      }
      sum = sum + wrench_to_parent(observer.sensor_pose(part), load(stands));
    }
    if (!(age > 0.0) || age >= kAbsurd) return;
    double stands[6];
    store(wrench_to_child(observer.sensor_pose(given_.sensors[sensor]), sum), stands);
    for (int k = 0; k < 6; ++k) {
      const int row = static_cast<int>(first) + k, known = given_.rows[row];
      if (known >= 0) pipeline_.go_on_from(whole, known, row, stands[k]);
    }
  }

  StandIn given_;
  Pipeline pipeline_;
  std::vector<double> wrench_;
  std::vector<char> without_;  // per sensor of the whole robot
  std::vector<int> told_as_;   // per segment of the whole robot
  std::vector<std::vector<int>> parts_;  // per segment of its own: those of the whole robot; the root: none
  bool used_ = false;          // has it been told anything?
  bool feels_ = false;
};

// All that may step in.
class Deputies {
 public:
  void add(StandIn given, const Pipeline& whole) {
    check(given, whole.robot());
    all_.push_back(std::make_unique<Deputy>(std::move(given), whole));
  }

  // Those of `before`, of this very robot, that are as new; the others are made of `given`.
  void take(Deputies& before, std::vector<StandIn> given, const Pipeline& whole) {
    for (std::size_t i = 0; i < given.size(); ++i) {
      if (i < before.all_.size() && before.all_[i]->fresh())
        all_.push_back(std::move(before.all_[i]));
      else
        add(std::move(given[i]), whole);
    }
    before.all_.clear();
  }

  // The one that does without just these sensors, or with the fewest others too; null: none.
  Deputy* without(const std::vector<char>& absent) const {
    Deputy* best = nullptr;
    for (const std::unique_ptr<Deputy>& deputy : all_) {
      bool covers = true;
      for (std::size_t s = 0; s < absent.size(); ++s)
        covers = covers && (absent[s] == 0 || deputy->is_without(s));
      if (covers && (best == nullptr || deputy->given().lost.size() < best->given().lost.size()))
        best = deputy.get();
    }
    return best;
  }

  template <class Visit>
  void visit(Visit&& visit) {
    for (const std::unique_ptr<Deputy>& deputy : all_) visit(*deputy);
  }

 private:
  std::vector<std::unique_ptr<Deputy>> all_;
};

}  // namespace touchline
