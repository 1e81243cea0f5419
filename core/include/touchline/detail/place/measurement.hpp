// SPDX-License-Identifier: Apache-2.0
// What a segment's sensors say of one contact on one of its bodies, weighed by the covariance of
// the noise. The same for every layout: a six-axis sensor at the inboard end, joint torques, sensors
// of fewer axes, or what there is of them. No allocation per sample.
// Theory: docs/theory.md, section 5.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/model/posture.hpp"
#include "touchline/detail/observer/observer.hpp"
#include "touchline/detail/place/baseline_offsets.hpp"
#include "touchline/detail/place/lasting_noise.hpp"
#include "touchline/detail/place/quadratic.hpp"
#include "touchline/detail/place/row_noise.hpp"
#include "touchline/detail/place/segment_rows.hpp"
#include "touchline/detail/place/settings.hpp"

namespace touchline {

class Measurement {
 public:
  // Observer and settings stay the caller's.
  Measurement(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise,
              const PlaceSettings& settings)
      : settings_(settings),
        observer_(observer),
        posture_(observer.tree(), observer.row_layout().joints),
        offsets_(observer, posture_, tests),
        rows_(observer, posture_),
        layout_(observer.row_layout()),
        lasting_(observer, posture_, std::move(tests), noise.wrench_error, noise.torque_error,
                  noise.wrench_error_off),
        noise_(observer, posture_, std::move(noise), 6 + layout_.joints + 6 * layout_.sensors) {
    const std::size_t most = rows_.most(), size = 6 + most;
    used_.resize(most);
    own_.resize(most);
    outboard_.resize(most);
    covariance_.resize(size * size);
    lasting_covariance_.resize(size * size);
    factor_.resize(size * size);
    design_.resize(size * kWide);
    told_.resize(size * kWide);
    columns_.resize(size * kWide * 2);
  }

  // Of the sample: its configuration; `qd` may be null. `drift`: what the model's errors may have
  // added to each row of the detector since its baseline, or null. `quiet`: for how long the baseline
  // of each segment has been averaged [s], or null. `excess`: how many times as large as told the
  // noise of each row is, or null. `wrench_off`: does any wrench of the arm stand off?
  void set_state(const double* q, const double* qd, const double* drift, const double* quiet,
                 const double* excess, bool wrench_off = false) {
    excess_ = excess;
    lasting_.set_off(wrench_off);
    posture_.set(q, qd);
    drift_ = drift;
    quiet_ = quiet;
  }

  // Takes the observer's row, and the detector's normalized rows (or null) from which the offsets
  // follow. Returns false where nothing is known of the segment.
  bool read(int g, const double* row, const double* normalized) {
    segment_ = g;
    row_ = row;
    normalized_ = normalized;
    has_wrench_ = observer_.layout().segments[g].sensor >= 0 &&
                  row[layout_.segment_settled() + g] > 0.0 &&
                  std::isfinite(row[layout_.segment_wrench() + 6 * g]);
    for (int i = 0; i < 6; ++i) raw_wrench_[i] = row[layout_.segment_wrench() + 6 * g + i];
    std::copy(raw_wrench_, raw_wrench_ + 6, wrench_);
    offsets_.find(g, row, normalized, has_wrench_ ? raw_wrench_ : nullptr);
    count_ = 0;
    for (const SegmentRow& r : rows_.of(g)) take(r);
    size_ = (has_wrench_ ? 6 : 0) + count_;
    lasts_ = lasting_.find(g, drift_);
    solved_ = 0;
    return size_ > 0 && weigh() && (normalized == nullptr || take_out_offsets()) && add_lasting();
  }

  // The largest of a segment's normalized rows.
  double strength(int g, const double* normalized) const {
    double most = 0.0;
    for (std::size_t i = 0; i < tests(); ++i) {
      if (offsets_.tests()[i].segment == g) most = std::max(most, std::fabs(normalized[i]));
    }
    return most;
  }

  bool has_wrench() const { return has_wrench_; }
  // What the gains of joint torques err by, as a part of the load.
  double torque_error() const { return lasting_.torque_error(); }
  const double* wrench() const { return wrench_; }
  // Do changes tell of new contacts? With joint torques alone there is no pitch, and few equations
  // or none are left over: what a model's errors leave looks like one more contact.
  bool can_be_followed() const { return has_wrench_ || lasting_.exact_torques(); }
  // What a contact's growth shows in: its force, or without a wrench the size of all torques.
  Vec3 load() const {
    if (has_wrench_) return {wrench_[0], wrench_[1], wrench_[2]};
    double square = 0.0;
    for (int i = 0; i < count_; ++i) square += own_[i] * own_[i];
    return {std::sqrt(square), 0.0, 0.0};
  }
  // How old the rows are, if a filtered force is so old [s]: without a wrench, torques are taken as
  // those of the axes and places of now.
  double lag(double of_force) const { return has_wrench_ ? of_force : 0.0; }
  // Rows in use: six of a wrench and the others.
  int size() const { return size_; }
  int scalars() const { return count_; }
  std::size_t most_rows() const { return 6 + used_.size(); }
  const Posture& posture() const { return posture_; }
  std::size_t tests() const { return offsets_.tests().size(); }
  const DetectionRow& test(std::size_t i) const { return offsets_.tests()[i]; }
  // What was read last: its segment, and the detector's normalized rows of all segments, or null.
  int segment() const { return segment_; }
  const double* normalized() const { return normalized_; }

  // Covariance (6, 6) of the segment's wrench.
  void wrench_covariance(double* out) const {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) {
        out[6 * i + j] = 0.0;
        for (int k = 0; k <= std::min(i, j); ++k)
          out[6 * i + j] += factor_[i * size_ + k] * factor_[j * size_ + k];
      }
    }
  }

  // The measured numbers of all rows, as they are for contacts anywhere.
  void values(double* out, int stride) const {
    const int first = has_wrench_ ? 6 : 0;
    for (int i = 0; i < first; ++i) out[i * stride] = wrench_[i];
    for (int i = 0; i < count_; ++i) out[(first + i) * stride] = own_[i];
  }

  // What a wrench on the body of `node`, `lag` [s] old, does to all rows.
  void load(int node, const Spatial& w, double lag, double* out, int stride) const {
    const int first = has_wrench_ ? 6 : 0;
    double values[6];
    bool loaded;
    store(w, values);
    for (int i = 0; i < first; ++i) out[i * stride] = values[i];
    for (int i = 0; i < count_; ++i)
      out[(first + i) * stride] = rows_.load(*used_[i], node, w, this->lag(lag), loaded);
  }

  // Does row i feel contacts on the body of `node`?
  bool feels(int i, int node) const {
    const int first = has_wrench_ ? 6 : 0;
    return i < first || rows_.feels(*used_[i - first], node);
  }

  // The joint of row i where there is no wrench; -1: the row is a sensor's axis.
  int joint(int i) const { return used_[i]->joint; }
  // What a unit wrench on the body of `node` does to row i in a posture, where there is no wrench;
  // false: nothing.
  bool subspace(int i, const Posture& posture, int node, double* out) const {
    return rows_.subspace(*used_[i], posture, node, out);
  }

  // Independent equations for one contact on the body of `node`: a wrench, or the rows that feel it.
  int equations(int node) const {
    int count = has_wrench_ ? 6 : 0;
    for (int i = count; i < size_; ++i) count += feels(i, node);
    return count;
  }

  // The lower triangle of the covariance of all rows.
  void covariance(double* out) const { std::copy_n(covariance_.data(), size_ * size_, out); }
  // Is there a part of it that no mean over time takes away?
  bool lasts() const { return lasts_; }

  // To the scale of the noise: independent rows of variance one.
  void whiten(double* rows, int stride) const { solve_lower(factor_.data(), size_, rows, stride); }

  // The same of `width` of them that stand side by side; see `solve_lower_rows`.
  template <int width>
  void whiten_rows(double* rows) const {
    solve_lower_rows<width>(factor_.data(), size_, rows);
  }

  // Takes out a contact that is known: its wrench `w` on the body of `node`, `lag` [s] old.
  void take_out(int node, const Spatial& w, double lag) {
    double values[6];
    store(w, values);
    solved_ = 0;
    for (int i = 0; i < 6; ++i) {
      wrench_[i] -= values[i];
      raw_wrench_[i] -= values[i];
    }
    for (int i = 0; i < count_; ++i) {
      const SegmentRow& r = *used_[i];
      bool loaded;
      own_[i] -= rows_.load(r, node, w, this->lag(lag), loaded);
      // A joint outboard of the contact: what the wrench says of it has not reached it.
      if (!loaded && r.joint >= 0) outboard_[i] += rows_.carried(r, w, lag);
    }
  }

  // Widens the noise of all rows but forces by that of a moment of `sigma` [Nm]; `spread` follows.
  void loosen_moments(double sigma) {
    for (int i = has_wrench_ ? 3 : 0; i < size_; ++i) covariance_[i * (size_ + 1)] += sigma * sigma;
  }

  // Adds to the covariance the outer products of `count` vectors of all rows, one after the other;
  // false if the rows cannot be weighed any more.
  bool spread(const double* vectors, int count) {
    for (int k = 0; k < count; ++k) {
      const double* v = vectors + k * size_;
      for (int i = 0; i < size_; ++i) {
        for (int j = 0; j <= i; ++j) covariance_[i * size_ + j] += v[i] * v[j];
      }
    }
    return factor();
  }

  // What all rows say of one contact on the body of `node`.
  Quadratic quadratic(int node) {
    const double* d = design(node);
    Lanes sums[6][kRegisters] = {};
    Quadratic result{};
    for (int i = 0; i < size_; ++i) {
      const double* line = d + kWide * i;
      add_products(line, line, sums);
      result.constant += line[6] * line[6];
    }
    for (int a = 0; a < 6; ++a) {
      double row[kWide];
      for (int c = 0; c < kRegisters; ++c) store_lanes(sums[a][c], row + c * kLanes);
      std::copy_n(row, 6, result.information + 6 * a);
      result.vector[a] = row[6];
    }
    return result;
  }

  // The part (6, 6) of the information on a wrench on the body of `node` by which the errors that last
  // weigh: D^T S^-1 L S^-1 D, with S the covariance of all rows and L that of these errors.
  void lasting_information(int node, double* out) {
    const double* d = design(node);
    const double *F = factor_.data(), *L = lasting_covariance_.data();
    double *x = columns_.data(), *y = x + size_ * kWide;  // S^-1 D and L S^-1 D
    for (int i = size_ - 1; i >= 0; --i) {
      for (int c = 0; c < kWide; c += kLanes) {
        Lanes sum = load_lanes(d + kWide * i + c);
        for (int k = i + 1; k < size_; ++k)
          sum -= all_lanes(F[k * size_ + i]) * load_lanes(x + kWide * k + c);
        store_lanes(sum / all_lanes(F[i * size_ + i]), x + kWide * i + c);
      }
    }
    for (int i = 0; i < size_; ++i) {
      for (int c = 0; c < kWide; c += kLanes) {
        Lanes sum = all_lanes(0.0);
        for (int k = 0; k < size_; ++k)
          sum += all_lanes(L[std::max(i, k) * size_ + std::min(i, k)]) * load_lanes(x + kWide * k + c);
        store_lanes(sum, y + kWide * i + c);
      }
    }
    solve_lower_rows<kWide>(F, size_, y);
    Lanes sums[6][kRegisters] = {};
    for (int i = 0; i < size_; ++i) add_products(d + kWide * i, y + kWide * i, sums);
    for (int b = 0; b < 6; ++b) {
      double row[kWide];
      for (int c = 0; c < kRegisters; ++c) store_lanes(sums[b][c], row + c * kLanes);
      std::copy_n(row, 6, out + 6 * b);
    }
  }

 private:
  // Numbers of a row of the design: six of a unit wrench, what is read, and one that makes them whole
  // registers.
  static constexpr int kWide = 8, kRegisters = kWide / kLanes;

  // Adds each of the first six numbers of one row times all of another.
  static void add_products(const double* one, const double* other, Lanes (&sums)[6][kRegisters]) {
    for (int c = 0; c < kRegisters; ++c) {
      const Lanes part = load_lanes(other + c * kLanes);
      for (int a = 0; a < 6; ++a) sums[a][c] += all_lanes(one[a]) * part;
    }
  }

  // What a wrench on the body of `node` does to all rows, and what they read, to the scale of the
  // noise. Bodies have their first rows in common: those of the body before that are the same stay.
  const double* design(int node) {
    const int first = has_wrench_ ? 6 : 0;
    double *d = design_.data(), *told = told_.data();
    int same = solved_;
    for (int i = solved_; i < first; ++i) {
      for (int k = 0; k < kWide; ++k) told[kWide * i + k] = i == k ? 1.0 : 0.0;
      told[kWide * i + 6] = wrench_[i];
    }
    for (int i = 0; i < count_; ++i) {
      double line[kWide];
      const bool loaded = rows_.subspace(*used_[i], node, line);
      line[6] = own_[i];
      line[7] = 0.0;
      if (loaded && has_wrench_ && std::isfinite(outboard_[i])) {
        line[6] = outboard_[i];
        for (int k = 0; k < 6; ++k) line[6] += line[k] * raw_wrench_[k];
      }
      double* before = told + kWide * (first + i);
      if (first + i < same && std::equal(line, line + kWide, before)) continue;
      same = std::min(same, first + i);
      std::copy_n(line, kWide, before);
    }
    std::copy(told + kWide * same, told + kWide * size_, d + kWide * same);
    solve_lower_rows<kWide>(factor_.data(), size_, d, same);
    solved_ = size_;
    return d;
  }

  // Takes the offsets out if there are any. What noise alone explains is none, and would only add
  // its own noise, unless a model has errors and the baseline, a mean over `quiet` [s], is sure.
  bool take_out_offsets() {
    const double rest = offsets_.variance(segment_, quiet_ != nullptr ? quiet_[segment_] : 0.0);
    if (!(lasts_ && rest < settings_.offset_sure) && !noticeable(rest)) return true;
    const int first = has_wrench_ ? 6 : 0;
    for (int i = 0; i < first; ++i) wrench_[i] -= offsets_.wrench()[i];
    for (int i = 0; i < count_; ++i) {
      own_[i] -= offset_of(*used_[i]);
      outboard_[i] -= offset_of(*used_[i]);
    }
    for (int i = 0; i < size_ * size_; ++i) covariance_[i] *= 1.0 + rest;
    for (int i = 0; i < size_ * size_; ++i) factor_[i] *= std::sqrt(1.0 + rest);
    solved_ = 0;
    return true;
  }

  // Are offsets, which have the part `rest` of the variance of a sample, more than noise?
  bool noticeable(double rest) {
    if (lasts_ && !factor()) return false;  // else it has been done
    const int first = has_wrench_ ? 6 : 0;
    double* d = design_.data();
    std::copy(offsets_.wrench(), offsets_.wrench() + first, d);
    for (int i = 0; i < count_; ++i) d[first + i] = offset_of(*used_[i]);
    solve_lower(factor_.data(), size_, d);
    double distance = 0.0;
    for (int i = 0; i < size_; ++i) distance += d[i] * d[i];
    return distance >= rest * chi2_limit(size_, settings_.offset_sigmas);
  }

  double offset_of(const SegmentRow& r) const {
    return r.joint >= 0 ? offsets_.joint(r.joint) : 0.0;
  }

  void take(const SegmentRow& r) {
    double own, outboard = std::nan("");
    if (r.joint >= 0) {
      if (!(row_[layout_.joint_settled() + r.joint] > 0.0)) return;
      own = row_[layout_.segment_torque() + r.joint];
      outboard = row_[layout_.parity() + r.joint];
    } else {
      own = row_[layout_.sensor_wrench() + 6 * r.sensor + r.axis];
    }
    if (!std::isfinite(own)) return;
    used_[count_] = &r;
    own_[count_] = own;
    outboard_[count_] = outboard;
    ++count_;
  }

  // The covariance of all rows by white noise, and its Cholesky factor.
  bool weigh() {
    noise_.clear(size_);
    const int first = has_wrench_ ? 6 : 0;
    if (has_wrench_) noise_.add_wrench(0, observer_.layout().segments[segment_]);
    for (int i = 0; i < count_; ++i) {
      const SegmentRow& r = *used_[i];
      if (r.joint >= 0) {
        noise_.add_joint(first + i, r.joint);
      } else {
        noise_.add_axis(first + i, r.sensor, r.axis);
      }
    }
    noise_.covariance(size_, has_wrench_ ? 3 : 0, covariance_.data());
    if (excess_ != nullptr) exceed();
    add_gaps();
    return lasts_ || factor();
  }

  // Noise as seen, where it is larger than told. A wrench keeps the shape of its covariance.
  void exceed() {
    double wrench = 1.0;
    std::fill_n(factor_.data(), size_, 1.0);
    const int first = has_wrench_ ? 6 : 0;
    for (std::size_t t = 0; t < tests(); ++t) {
      const DetectionRow& test = offsets_.tests()[t];
      if (test.segment != segment_) continue;
      if (test.component >= 0) wrench = std::max(wrench, excess_[t]);
      for (int i = 0; i < count_ && test.component < 0; ++i) {
        if (used_[i]->joint == test.joint) factor_[first + i] = excess_[t];
      }
    }
    std::fill_n(factor_.data(), first, wrench);
    for (int i = 0; i < count_; ++i) {
      if (used_[i]->joint < 0) factor_[first + i] = wrench;
    }
    for (int i = 0; i < size_; ++i) {
      for (int j = 0; j <= i; ++j) covariance_[i * size_ + j] *= factor_[i] * factor_[j];
    }
  }

  // And by what lost samples may have left: of the segment's force and its moment about its sensor,
  // and of the joints.
  void add_gaps() {
    const int first = has_wrench_ ? 6 : 0;
    for (int i = 0; i < count_; ++i) {
      if (used_[i]->joint < 0) continue;
      const double std = settings_.gap_sigmas * row_[layout_.joint_gap_std() + used_[i]->joint];
      if (std > 0.0) covariance_[(first + i) * (size_ + 1)] += std * std;
    }
    const double* std = row_ + layout_.segment_gap_std() + 2 * segment_;
    if (!has_wrench_ || !(std[0] > 0.0 || std[1] > 0.0)) return;
    const int sensor = observer_.layout().segments[segment_].sensor;
    const Pose& X = posture_.pose(observer_.sensors()[sensor].node);
    for (int a = 0; a < 6; ++a) {
      double unit[6] = {}, v[6];
      unit[a] = settings_.gap_sigmas * std[a / 3];
      store(wrench_to_parent({identity<double>(), X.p}, touchline::load(unit)), v);
      for (int i = 0; i < 6; ++i) {
        for (int j = 0; j <= i; ++j) covariance_[i * size_ + j] += v[i] * v[j];
      }
    }
  }

  // And with the errors that last.
  bool add_lasting() {
    if (!lasts_) return true;
    lasting_.covariance(observer_.layout().segments[segment_].sensor,
                        {{wrench_[0], wrench_[1], wrench_[2]}, {wrench_[3], wrench_[4], wrench_[5]}},
                        used_.data(), own_.data(), count_, size_, lasting_covariance_.data());
    for (int i = 0; i < size_ * size_; ++i) covariance_[i] += lasting_covariance_[i];
    return factor();
  }

  bool factor() {
    solved_ = 0;
    std::copy_n(covariance_.data(), size_ * size_, factor_.data());
    return cholesky(factor_.data(), size_, 1e-15);
  }

  const PlaceSettings& settings_;
  const Observer& observer_;
  Posture posture_;
  BaselineOffsets offsets_;
  SegmentRows rows_;
  RowLayout layout_;
  LastingNoise lasting_;
  RowNoise noise_;

  int segment_ = 0, count_ = 0, size_ = 0;
  const double *row_ = nullptr, *normalized_ = nullptr;
  const double *drift_ = nullptr, *quiet_ = nullptr, *excess_ = nullptr;
  bool has_wrench_ = false, lasts_ = false;
  double wrench_[6] = {}, raw_wrench_[6] = {};
  std::vector<const SegmentRow*> used_;
  std::vector<double> own_;       // if the contact is inboard of the joint
  std::vector<double> outboard_;  // if it is outboard, less what the wrench says
  std::vector<double> covariance_, lasting_covariance_, factor_, columns_;
  // The rows of the design as told and to the scale of the noise; of the latter so many hold.
  std::vector<double> told_, design_;
  int solved_ = 0;
};

}  // namespace touchline
