// SPDX-License-Identifier: Apache-2.0
// Several samples of a recording at once, as long as all of them are as usual. Every number stands
// with those of the next samples side by side; filters run through time, with several rows side
// by side. Every operation is that of a single step, lane by lane, so the numbers
// are the same to the last bit. No allocation but in the constructor.
// Theory: docs/theory.md, section 2.2.
#pragma once

#include <algorithm>
#include <cstddef>
#include <vector>

#include "touchline/detail/model/lanes.hpp"
#include "touchline/detail/model/spatial.hpp"
#include "touchline/detail/observer/channels.hpp"
#include "touchline/detail/observer/layout.hpp"
#include "touchline/detail/observer/projections.hpp"
#include "touchline/detail/observer/readings.hpp"
#include "touchline/detail/observer/row.hpp"
#include "touchline/detail/observer/terms.hpp"
#include "touchline/sample.hpp"

namespace touchline {

class SideBySide {
 public:
  SideBySide(const Layout& layout, const std::vector<JointRow>& joints,
             const std::vector<SensorRow>& sensors, Channels& channels, Terms<Lanes>& terms,
             const Projections& projections, const JointReadings& torques,
             const std::vector<SensorReading>& wrenches, const RowLayout& row)
      : layout_(layout),
        joints_(joints),
        sensors_(sensors),
        channels_(channels),
        model_(terms),
        projections_(projections),
        torques_(torques),
        wrenches_(wrenches),
        row_(row),
        q_(2 * joints.size()),
        logged_(joints.size() + 6 * sensors.size()),
        terms_(terms.at().width()),
        lines_before_(6 * terms.at().lines, 0.0),
        p_before_(channels.balances.size(), kNaN),
        u_before_(p_before_),
        e_(padded(p_before_.size()), all_lanes(kNaN)),
        projected_(projections.room(), Lanes{}),
        inputs_(padded(channels.filters.size()), all_lanes(kNaN)),
        values_(inputs_.size(), kNaN),
        keep_(inputs_.size(), 0.0),
        poles_(inputs_.size(), Lanes{}),
        news_(poles_) {
    projected_.back() = all_lanes(kNaN);
    possible_ = kLanes > 1;
    for (std::size_t s = 0; s < sensors.size(); ++s) {
      possible_ = possible_ && wrenches[s].usual() &&
                  channels.kind(s) != Channels::SensorFilter::local;
    }
  }

  // Is there a way for this robot at all?
  bool possible() const { return possible_; }

  // The signals of kLanes samples, the first of which is `sample`. Are all usable, and within their
  // ranges? Where a joint is outside the limits of the model is not looked at.
  bool read(const Sample& sample) {
    const std::size_t n = joints_.size(), w = 6 * sensors_.size();
    gather(sample.q, n, n, q_.data());
    gather(sample.qd, n, n, q_.data() + n);
    gather(sample.tau, n, n, logged_.data());
    gather(sample.wrench, w, w, logged_.data() + n);
    LaneMask sound = between(Lanes{}, -1.0, 1.0);
    for (const Lanes& x : q_) sound &= between(x, -kAbsurd, kAbsurd);
    if (!all_of(sound) || !torques_.sound(logged_.data())) return false;
    for (std::size_t s = 0; s < sensors_.size(); ++s) {
      if (!wrenches_[s].sound(logged_.data() + n + 6 * s)) return false;
    }
    return true;
  }
  // Are all joints between these positions?
  bool inside(const double* lower, const double* upper) const {
    LaneMask inside = between(Lanes{}, -1.0, 1.0);
    for (std::size_t j = 0; j < joints_.size(); ++j) inside &= within(q_[j], lower[j], upper[j]);
    return all_of(inside);
  }

  // The terms of the samples that have been read; the sensors' poses stay with the model.
  void evaluate() { model_.evaluate_without_poses(q_.data(), q_.data() + joints_.size(), terms_.data()); }
  void evaluate(const double* q, const double* qd) {
    const std::size_t n = joints_.size();
    gather(q, n, n, q_.data());
    gather(qd, n, n, q_.data() + n);
    model_.evaluate(q_.data(), q_.data() + n, terms_.data());
  }
  void copy_terms(int k, double* out) const {
    for (std::size_t i = 0; i < terms_.size(); ++i) out[i] = lane(terms_[i], k);
  }

  // Begins with what single steps have left; `terms`: of the last sample.
  void enter(const double* terms) {
    std::copy_n(terms + model_.at().subspaces(), lines_before_.size(), lines_before_.begin());
    Balances& balances = channels_.balances;
    std::copy_n(balances.momenta(), p_before_.size(), p_before_.begin());
    std::copy_n(balances.loads(), u_before_.size(), u_before_.begin());
    std::copy_n(channels_.filters.values(), channels_.filters.size(), values_.begin());
  }

  // Leaves for single steps what the last sample was.
  void leave(double* terms) {
    model_.put_poses(terms_.data());
    copy_terms(kLanes - 1, terms);
    Balances& balances = channels_.balances;
    std::copy(p_before_.begin(), p_before_.end(), balances.momenta());
    std::copy(u_before_.begin(), u_before_.end(), balances.loads());
    std::copy_n(values_.begin(), channels_.filters.size(), channels_.filters.values());
  }

  // After `evaluate`: innovations of momenta and known loads, and what these do to the joints.
  void balance(const Instant* now) {
    const TermsLayout& at = model_.at();
    const std::size_t n = at.joints;
    Lanes rate;
    for (int k = 0; k < kLanes; ++k) set_lane(rate, k, now[k].time - now[k].before);
    rate = 1.0 / rate;
    torques_.read(logged_.data(), q_.data(), q_.data() + n, terms_.data() + at.joint_bias(), logged_.data());
    balance(0, n, terms_.data() + at.joint_momentum(), logged_.data(), rate);
    for (std::size_t s = 0; s < at.sensors; ++s) {
      const Lanes* terms = terms_.data() + at.sensor(s);
      Lanes* u = logged_.data() + n + 6 * s;
      const BasicSpatial<Lanes> reading = wrenches_[s].read(u);
      const BasicSpatial<Lanes> weight = sensors_[s].gravity_compensated
                                             ? BasicSpatial<Lanes>{}
                                             : load(terms + TermsLayout::kWeight);
      store(wrench_to_parent(model_.pose(s), reading) + weight, u);
      balance(row(channels_.sensor(s)), 6, terms + TermsLayout::kMomentum, u, rate);
    }
    for (std::size_t g = 0; g < layout_.segments.size(); ++g) balance_segment(g, rate);
    projections_.project(lines_before_.data(), terms_.data(), e_.data() + channels_.sensor_rows(),
                         layout_.lines.size(), projected_.data());
  }

  const Lanes* projected() const { return projected_.data(); }
  Lanes* e() { return e_.data(); }
  Lanes* inputs() { return inputs_.data(); }

  // The filters, sample after sample: afterwards row by row in `inputs`, kLanes rows at a time,
  // the values of one sample.
  void filter(const Instant* now) {
    const std::size_t size = inputs_.size();
    if (channels_.filters.alike()) {
      Lanes keep[kLanes], take[kLanes];
      for (int k = 0; k < kLanes; ++k) {
        keep[k] = all_lanes(channels_.filters.only_pole(now[k].time - now[k].before));
        take[k] = 1.0 - keep[k];
      }
      for (std::size_t i = 0; i < size; i += kLanes) filter(i, keep, take);
      return;
    }
    for (int k = 0; k < kLanes; ++k) {
      double* keep = keep_.data();
      channels_.filters.write_poles(now[k].time - now[k].before, keep);
      for (std::size_t i = 0; i < size; i += kLanes) {
        poles_[i + k] = load_lanes(keep + i);
        news_[i + k] = 1.0 - poles_[i + k];
      }
    }
    for (std::size_t i = 0; i < size; i += kLanes)
      filter(i, poles_.data() + i, news_.data() + i);
  }

  // The rows of all samples. Blocks of kLanes columns may reach into those that follow, which are
  // written later.
  void write(const std::vector<double>& quality, const Health* health, double* out) {
    const std::size_t n = joints_.size(), width = row_.width();
    for (int k = 0; k < kLanes; ++k) {
      double* to = out + k * width;
      for (std::size_t i = 0; i < 3 * n; i += kLanes) store_lanes(inputs_[i + k], to + i);
    }
    put(e_.data(), n, out + row_.joint_innovation());
    const std::size_t wrenches = channels_.filters.group(channels_.segment_filter(0)).first;
    for (std::size_t i = wrenches / kLanes * kLanes; i < wrenches + 6 * row_.segments; i += kLanes)
      transpose(inputs_.data() + i);  // of all samples row by row again
    const Lanes* segment_wrenches = inputs_.data() + wrenches;
    for (int s = 0; s < row_.sensors; ++s) {
      BasicSpatial<Lanes> sum;
      for (int g : layout_.segments_outboard[s]) sum = sum + load(segment_wrenches + 6 * g);
      store(wrench_to_child(model_.pose(s), sum), sensor_wrenches_.data() + 6 * s);
    }
    put(sensor_wrenches_.data(), 6 * row_.sensors, out + row_.sensor_wrench());
    put(segment_wrenches, 6 * row_.segments, out + row_.segment_wrench());
    put(e_.data() + row(channels_.segment(0)), 6 * row_.segments, out + row_.segment_innovation());
    const std::size_t size = quality.size(), blocks = size / kLanes * kLanes;
    for (int k = 0; k < kLanes; ++k) {
      double *row = out + k * width, *to = row + row_.joint_settled();
      for (std::size_t i = 0; i < blocks; i += kLanes) store_lanes(load_lanes(&quality[i]), to + i);
      for (std::size_t i = blocks; i < size; ++i) to[i] = quality[i];
      row[row_.health()] = static_cast<double>(health[k]);
    }
  }

 private:
  static std::size_t padded(std::size_t rows) { return (rows + kLanes - 1) / kLanes * kLanes; }
  std::size_t row(std::size_t balance) const { return channels_.balances.group(balance).first; }

  // kLanes rows of the filters from row i on, with the poles of each sample and what is left to 1.
  void filter(std::size_t i, const Lanes* keep, const Lanes* take) {
    Lanes* of_rows = inputs_.data() + i;
    transpose(of_rows);
    Lanes value = load_lanes(values_.data() + i);
    for (int k = 0; k < kLanes; ++k) of_rows[k] = value = keep[k] * value + take[k] * of_rows[k];
    store_lanes(value, values_.data() + i);
  }

  // Rows from `first` on: from momenta and known loads to the mean external loads.
  void balance(std::size_t first, std::size_t count, const Lanes* p, const Lanes* u, const Lanes& rate) {
    double *p_before = p_before_.data() + first, *u_before = u_before_.data() + first;
    Lanes* e = e_.data() + first;
    for (std::size_t i = 0; i < count; ++i) {
      e[i] = rate * (p[i] - move_on(p_before[i], p[i])) - 0.5 * (move_on(u_before[i], u[i]) + u[i]);
    }
  }

  // A segment's momentum and load: those of its sensor without those of the next ones outboard.
  void balance_segment(std::size_t g, const Lanes& rate) {
    const Segment& segment = layout_.segments[g];
    if (segment.sensor < 0) return;
    Lanes p[6], u[6];
    std::copy_n(momentum(segment.sensor), 6, p);
    std::copy_n(load_of(segment.sensor), 6, u);
    for (int t : segment.successors) {
      const Lanes *of_next = momentum(t), *on_next = load_of(t);
      for (std::size_t i = 0; i < 6; ++i) p[i] -= of_next[i];
      for (std::size_t i = 0; i < 6; ++i) u[i] -= on_next[i];
    }
    balance(row(channels_.segment(g)), 6, p, u, rate);
  }
  // Of what is outboard of sensor s, and on it: six rows each.
  const Lanes* momentum(int s) const {
    return terms_.data() + model_.at().sensor(static_cast<std::size_t>(s)) + TermsLayout::kMomentum;
  }
  const Lanes* load_of(int s) const { return logged_.data() + joints_.size() + 6 * s; }

  // `count` columns of all rows of the output.
  void put(const Lanes* columns, std::size_t count, double* out) const {
    const std::size_t width = row_.width();
    if (count < kLanes) {
      for (std::size_t i = 0; i < count; ++i) {
        for (int k = 0; k < kLanes; ++k) out[k * width + i] = lane(columns[i], k);
      }
      return;
    }
    for (std::size_t next = 0; next < count; next += kLanes) {
      const std::size_t i = std::min(next, count - kLanes);  // the last block reaches back
      Lanes block[kLanes];
      for (std::size_t c = 0; c < kLanes; ++c) block[c] = columns[i + c];
      transpose(block);
      for (int k = 0; k < kLanes; ++k) store_lanes(block[k], out + k * width + i);
    }
  }

  const Layout& layout_;
  const std::vector<JointRow>& joints_;
  const std::vector<SensorRow>& sensors_;
  Channels& channels_;
  Terms<Lanes>& model_;
  const Projections& projections_;
  const JointReadings& torques_;
  const std::vector<SensorReading>& wrenches_;
  RowLayout row_;
  bool possible_ = false;
  std::vector<Lanes> q_;  // positions, then velocities
  std::vector<Lanes> logged_;  // torques, then wrenches; after `balance` the known loads instead
  std::vector<Lanes> terms_;
  std::vector<double> lines_before_;  // of the last sample, as among the terms
  std::vector<double> p_before_, u_before_;  // of the last sample, as in the balances
  std::vector<Lanes> e_;                     // likewise
  std::vector<Lanes> projected_, inputs_;
  std::vector<Lanes> sensor_wrenches_ = std::vector<Lanes>(6 * row_.sensors);
  // Of the filters: values and poles by row; per kLanes rows the poles of each sample, and what is
  // left to 1.
  std::vector<double> values_, keep_;
  std::vector<Lanes> poles_, news_;
};

}  // namespace touchline
