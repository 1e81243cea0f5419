// SPDX-License-Identifier: Apache-2.0
// Is all that is felt of a segment what one faulty channel would show? Where a force-torque sensor
// feels a segment, hardly any contact loads one of its axes, or one joint torque, and nothing else:
// its line would have to meet the sensor's origin along an axis. So the two explanations stand beside
// each other, and neither is sure. No allocation per sample.
// Theory: docs/theory.md, section 3.5.
#pragma once

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

#include "touchline/detail/gates/fault.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/place/measurement.hpp"
#include "touchline/detail/place/quadratic.hpp"

namespace touchline {

// A channel that alone explains what is felt, and what it would be wrong by [N or Nm]. Or two axes
// of a sensor that are swapped: one has too much of what the other one lacks.
struct Suspect {
  int channel = -1;  // as `ChannelLayout`; -1: there is none
  int other = -1;    // the one that it is swapped with; -1: none
  double error = 0.0;
  bool told = true;  // else what is felt begins no contact, but a contact may be near that does it, too
  bool touched = false;  // a contact at a place that is known would do it, too
  bool any() const { return channel >= 0; }
};

class LoneChannel {
 public:
  // Of `measurement`, which stays the caller's.
  LoneChannel(const Observer& observer, Measurement& measurement)
      : observer_(observer),
        measurement_(measurement),
        at_{static_cast<std::size_t>(observer.row_layout().joints), observer.sensors().size()},
        inner_(observer.sensors().size(), -1),
        out_until_(at_.count(), -kAbsurd),
        rows_(measurement.most_rows()),
        column_(measurement.most_rows()),
        columns_(kWide * measurement.most_rows()) {
    weighed_.reserve(at_.joints + 12 * at_.sensors);  // each torque; six axes, and six pairs of them
    for (const Segment& segment : observer.layout().segments) {
      for (const int outer : segment.successors) inner_[outer] = segment.sensor;
    }
  }

  // Of segment g, whose rows the measurement has read. So many of their dimensions explain anything.
  // `contested`: a contact explains all, too.
  Suspect find(int g, int free = 0, bool contested = false) {
    const int size = measurement_.size();
    if (!measurement_.has_wrench() || size - free <= kLeast) return {};
    measurement_.values(rows_.data(), 1);
    measurement_.whiten(rows_.data(), 1);
    all_ = 0.0;
    for (int i = 0; i < size; ++i) all_ += rows_[i] * rows_[i];
    if (free > 0 && all_ < chi2_limit(size - free, kArrival)) return {};  // they explain it alone
    weighed_.clear();
    count_ = 0;
    visit_channels(g, [this](int channel, int other) { add(channel, other); });
    weigh();
    const Weighed best = likeliest();
    const double left = all_ - best.explains;
    const double limit = chi2_limit(std::max(1, size - 1 - free), kNoise);
    // A load that noise nearly hides fits every channel, and a clear one none but the faulty one.
    const bool clear = best.explains - next_to(best.suspect) > kOnly * kOnly &&
                       left < kFair * best.explains;
    const bool noise = free > 0 && best.suspect.other < 0 &&
                       left < chi2_limit(std::max(1, size - 1 - free), kUsual);
    if (left > limit + kShape * kShape * all_) return {};
    Suspect found = best.suspect;
    found.told = !contested && (left <= kLeft * all_ || clear) && !may_be_load(best);
    return found.told || noise ? found : Suspect{};
  }

  // Of what was looked at last: its squared size, to the scale of the noise.
  double size() const { return all_; }

  // From now on until then [s] a channel tells nothing.
  void leave_out(int channel, double until) {
    out_until_[channel] = until;
    any_out_ = true;
  }

  // Takes out of the rows of segment g what such channels say of them; false if nothing is left.
  bool take_out(int g, double time) {
    if (!any_out_) return true;
    any_out_ = std::any_of(out_until_.begin(), out_until_.end(), [&](double t) { return time < t; });
    if (!any_out_ || !measurement_.has_wrench()) return true;
    bool good = true;
    visit_channels(g, [&](int channel, int other) {
      if (other >= 0 || !(time < out_until_[channel])) return;
      for (int i = 0; i < measurement_.size(); ++i) column_[i] *= kAnything;
      good = measurement_.spread(column_.data(), 1) && good;
    });
    return good;
  }

 private:
  static constexpr int kWide = 8;         // channels that are weighed side by side: whole registers
  static constexpr int kLeast = 5;        // rows: of fewer, a contact leaves nothing over
  static constexpr int kTorques = 4;      // beside the sensor: fewer say little of a push's axis
  static constexpr double kAnything = 1e3;  // [N, Nm] sigma of what tells nothing
  static constexpr double kOther = 4.0;   // of the squared error: what feels more, feels something else
  static constexpr double kArrival = 5.0;  // sigmas beyond which known contacts do not explain
  static constexpr double kNoise = 3.0;   // sigmas of what another channel may show,
  static constexpr double kShape = 0.03;  // and this part of it: filters turn with the arm
  // Of the squared size: what one channel leaves of a contact that noise, or a gap, nearly hides.
  static constexpr double kLeft = 0.1;
  // No more than noise usually leaves [sigmas]: of what known contacts do not explain, five sigmas and
  // more, another contact far from them leaves more.
  static constexpr double kUsual = 1.0;
  // Or sigmas by which no other channel explains as much. What is left may then be this part of what it
  // explains: ten rows of noise beside a load of five sigmas are less than half.
  static constexpr double kOnly = 3.0, kFair = 0.5;

  // A channel, or two that are swapped, and the part of the squared length that lies along it. Two are
  // wrong only where one explains less by so many sigmas.
  struct Weighed {
    Suspect suspect;
    double explains = 0.0;
    double likely() const { return explains - (suspect.other >= 0 ? kOnly * kOnly : 0.0); }
  };

  // Calls `visit(channel, other)` for all that segment g feels, with what one unit of it does to the
  // rows in `column_`; `other`: of swapped axes, else -1.
  template <class Visit>
  void visit_channels(int g, Visit&& visit) {
    const Segment& segment = observer_.layout().segments[g];
    visit_axes(segment.sensor, 1.0, visit);
    for (const int outer : segment.successors) visit_axes(outer, -1.0, visit);
    for (int i = 0; i < measurement_.scalars(); ++i) {
      if (measurement_.joint(i) < 0) continue;
      std::fill_n(column_.data(), measurement_.size(), 0.0);
      column_[6 + i] = 1.0;
      visit(static_cast<int>(at_.tau()) + measurement_.joint(i), -1);
    }
  }

  // The axes of a sensor, which this segment feels with a sign. Of one whose log has other axes, a
  // channel is no axis. Swapped ones are looked for where joint torques or a sensor inboard contradict
  // them.
  template <class Visit>
  void visit_axes(int sensor, double sign, Visit&& visit) {
    if (observer_.sensors()[sensor].turned) return;
    const int first = static_cast<int>(at_.wrench()) + 6 * sensor;
    for (int axis = 0; axis < 6; ++axis) {
      load_axis(sensor, axis, -1, sign);
      visit(first + axis, -1);
    }
    if (inner_[sensor] < 0 && measurement_.size() < 6 + kTorques) return;
    for (int axis = 0; axis < 6; ++axis) {  // of three: each with the next
      const int other = axis % 3 == 2 ? axis - 2 : axis + 1;
      load_axis(sensor, axis, other, sign);
      visit(first + axis, first + other);
    }
  }

  // What one unit of an axis, less one of another, does to the rows: to `column_`.
  void load_axis(int sensor, int axis, int other, double sign) {
    const int node = observer_.sensors()[sensor].node;
    const Spatial w = wrench_to_parent(measurement_.posture().pose(node), unit(axis, other, sign));
    if (sign > 0.0) {  // its own joints do not count on it
      std::fill_n(column_.data(), measurement_.size(), 0.0);
      store(w, column_.data());
    } else {
      measurement_.load(node, w, 0.0, column_.data(), 1);
    }
  }

  static Spatial unit(int axis, int other, double size) {
    double values[6] = {};
    values[axis] = size;
    if (other >= 0) values[other] = -size;
    return touchline::load(values);
  }

  // To those that are weighed together.
  void add(int channel, int other) {
    const int size = measurement_.size();
    for (int i = 0; i < size; ++i) columns_[kWide * i + count_] = column_[i];
    channels_[count_] = {channel, other};
    if (++count_ == kWide) weigh();
  }

  // Weighs those that have been added; each as if alone, to the last bit.
  void weigh() {
    const int size = measurement_.size();
    measurement_.whiten_rows<kWide>(columns_.data());
    double along[kWide], square[kWide];
    for (int c = 0; c < kWide; c += kLanes) {
      Lanes a = all_lanes(0.0), b = all_lanes(0.0);
      for (int i = 0; i < size; ++i) {
        const Lanes x = load_lanes(columns_.data() + kWide * i + c);
        a += x * all_lanes(rows_[i]);
        b += x * x;
      }
      store_lanes(a, along + c);
      store_lanes(b, square + c);
    }
    for (int k = 0; k < count_; ++k) {
      if (!(square[k] > 0.0)) continue;
      weighed_.push_back({{channels_[k].first, channels_[k].second, along[k] / square[k]},
                          along[k] * along[k] / square[k]});
    }
    count_ = 0;
  }

  // The channel that explains most of those that the other segment at their sensor bears out.
  Weighed likeliest() {
    while (!weighed_.empty()) {
      const auto most = std::max_element(weighed_.begin(), weighed_.end(),
          [](const Weighed& a, const Weighed& b) { return a.likely() < b.likely(); });
      if (borne_out(most->suspect)) return *most;
      *most = weighed_.back();
      weighed_.pop_back();
    }
    return {};
  }

  // Is a torque suspected, but something that turns what its joint carries is likelier? That is what a
  // model errs by, and loads the joints and the sensor inboard, too.
  bool may_be_load(const Weighed& of) {
    if (of.suspect.channel >= static_cast<int>(at_.wrench())) return false;
    const int node = observer_.joints()[of.suspect.channel - at_.tau()].nodes[0];
    const Vec3 axis = measurement_.posture().pose(node).R.z;
    const bool turns = observer_.tree().nodes()[node].kind == NodeKind::revolute;
    const double values[6] = {turns ? 0.0 : axis.x, turns ? 0.0 : axis.y, turns ? 0.0 : axis.z,
                              turns ? axis.x : 0.0, turns ? axis.y : 0.0, turns ? axis.z : 0.0};
    measurement_.load(node, touchline::load(values), 0.0, column_.data(), 1);
    measurement_.whiten(column_.data(), 1);
    double along = 0.0, square = 0.0;
    for (int i = 0; i < measurement_.size(); ++i) {
      along += column_[i] * rows_[i];
      square += column_[i] * column_[i];
    }
    return square > 0.0 && along * along / square > of.explains;
  }

  // What any other such channel explains that has no part in a suspect.
  double next_to(const Suspect& suspect) const {
    double most = 0.0;
    for (const Weighed& w : weighed_) {
      const bool other = !shares(w.suspect, suspect.channel) && !shares(w.suspect, suspect.other);
      if (w.explains > most && other && borne_out(w.suspect)) most = w.explains;
    }
    return most;
  }
  static bool shares(const Suspect& suspect, int channel) {
    return channel >= 0 && (suspect.channel == channel || suspect.other == channel);
  }

  // Does the other segment at the sensor feel the opposite, as it would of an error and would not of
  // a contact?
  bool borne_out(const Suspect& suspect) const {
    if (suspect.channel < static_cast<int>(at_.wrench())) return true;
    const int sensor = (suspect.channel - static_cast<int>(at_.wrench())) / 6;
    const int axis = (suspect.channel - static_cast<int>(at_.wrench())) % 6;
    const int own = observer_.layout().segment_of_sensor[sensor];
    const bool here = own == measurement_.segment();
    if (here && inner_[sensor] < 0) return true;
    if (measurement_.normalized() == nullptr) return false;
    const int other = here ? observer_.layout().segment_of_sensor[inner_[sensor]] : own;
    const int at = here ? inner_[sensor] : sensor;
    const int swapped = suspect.other >= 0 ? suspect.other - suspect.channel + axis : -1;
    const Spatial error = unit(axis, swapped, here ? -suspect.error : suspect.error);
    double shown[6];
    const Posture& posture = measurement_.posture();
    const Spatial w = wrench_to_parent(posture.pose(observer_.sensors()[sensor].node), error);
    store(wrench_to_child(posture.pose(observer_.sensors()[at].node), w), shown);
    double with = 0.0, without = 0.0, size = 0.0;
    for (std::size_t i = 0; i < measurement_.tests(); ++i) {
      const DetectionRow& row = measurement_.test(i);
      if (row.segment != other || row.component < 0) continue;
      const double y = measurement_.normalized()[i], x = shown[row.component] / row.contact;
      without += y * y;
      with += (y - x) * (y - x);
      size += x * x;
    }
    return with < without || without > kOther * size;
  }

  const Observer& observer_;
  Measurement& measurement_;
  ChannelLayout at_;
  std::vector<int> inner_;  // per sensor: the next six-axis one inboard; -1: there is none
  std::vector<double> out_until_;  // per channel [s]
  bool any_out_ = false;
  std::vector<double> rows_, column_, columns_;  // to the scale of the noise; `kWide` side by side,
  std::pair<int, int> channels_[kWide];          // and of which channels they are
  int count_ = 0;
  double all_ = 0.0;  // squared length of the rows
  std::vector<Weighed> weighed_;
};

}  // namespace touchline
