// SPDX-License-Identifier: Apache-2.0
// What a segment's sensors say of one contact on one of its bodies, weighed by the covariance of
// the noise. The same for every layout: a six-axis sensor at the inboard end, joint torques, sensors
// of fewer axes, or what there is of them. No allocation per sample.
#pragma once

#include <algorithm>
#include <cmath>
#include <vector>

#include "touchline/dense.hpp"
#include "touchline/detector.hpp"
#include "touchline/observer.hpp"
#include "touchline/posture.hpp"
#include "touchline/quadratic.hpp"
#include "touchline/row_noise.hpp"

namespace touchline {

class Measurement {
 public:
  Measurement(const Observer& observer, std::vector<DetectionRow> tests, NoiseFigures noise)
      : observer_(observer),
        posture_(observer.tree(), observer.row_layout().joints),
        tests_(std::move(tests)),
        layout_(observer.row_layout()),
        noise_(observer, posture_, std::move(noise), 6 + layout_.joints + 6 * layout_.sensors),
        joint_offsets_(layout_.joints) {
    for (int g = 0; g < layout_.segments; ++g) rows_.push_back(rows_of(g));
    std::size_t most = 0;
    for (const auto& rows : rows_) most = std::max(most, rows.size());
    const std::size_t size = 6 + most;
    used_.resize(most);
    own_.resize(most);
    outboard_.resize(most);
    covariance_.resize(size * size);
    factor_.resize(size * size);
    design_.resize(size * 7);
  }

  // The configuration of the sample; `qd` may be null.
  // And for how long the baseline of each segment has been averaged [s], or null.
  void set_state(const double* q, const double* qd, const double* quiet) {
    posture_.set(q, qd);
    quiet_ = quiet;
  }

  // Takes the observer's row, and the detector's normalized rows (or null) from which the offsets
  // follow. Returns false where nothing is known of the segment.
  bool read(int g, const double* row, const double* normalized) {
    segment_ = g;
    row_ = row;
    has_wrench_ = observer_.layout().segments[g].sensor >= 0 &&
                  row[layout_.segment_settled() + g] > 0.0 &&
                  std::isfinite(row[layout_.segment_wrench() + 6 * g]);
    for (int i = 0; i < 6; ++i) raw_wrench_[i] = row[layout_.segment_wrench() + 6 * g + i];
    std::copy(raw_wrench_, raw_wrench_ + 6, wrench_);
    find_offsets(normalized);
    count_ = 0;
    for (const Row& r : rows_[g]) take(r);
    size_ = (has_wrench_ ? 6 : 0) + count_;
    return size_ > 0 && weigh() && (normalized == nullptr || take_out_offsets());
  }

  // The largest of a segment's normalized rows.
  double strength(int g, const double* normalized) const {
    double most = 0.0;
    for (std::size_t i = 0; i < tests_.size(); ++i) {
      if (tests_[i].segment == g) most = std::max(most, std::fabs(normalized[i]));
    }
    return most;
  }

  bool has_wrench() const { return has_wrench_; }
  const double* wrench() const { return wrench_; }
  // Rows in use: six of a wrench and the others.
  int size() const { return size_; }
  int scalars() const { return count_; }
  std::size_t most_rows() const { return 6 + used_.size(); }
  const Posture& posture() const { return posture_; }
  std::size_t tests() const { return tests_.size(); }

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
      out[(first + i) * stride] = load(*used_[i], node, w, lag, loaded);
  }

  // Does row i feel contacts on the body of `node`?
  bool feels(int i, int node) const {
    const int first = has_wrench_ ? 6 : 0;
    if (i < first) return true;
    const Row& r = *used_[i - first];
    if (r.joint < 0) return observer_.layout().is_outboard(node, observer_.sensors()[r.sensor].node);
    for (int own : observer_.joints()[r.joint].nodes) {
      if (observer_.layout().is_outboard(node, own)) return true;
    }
    return false;
  }

  // The lower triangle of the covariance of all rows.
  void covariance(double* out) const { std::copy_n(covariance_.data(), size_ * size_, out); }

  // To the scale of the noise: independent rows of variance one.
  void whiten(double* rows, int stride) const { solve_lower(factor_.data(), size_, rows, stride); }

  // Takes out a contact that is known: its wrench `w` on the body of `node`, `lag` [s] old.
  void take_out(int node, const Spatial& w, double lag) {
    double values[6];
    store(w, values);
    for (int i = 0; i < 6; ++i) {
      wrench_[i] -= values[i];
      raw_wrench_[i] -= values[i];
    }
    for (int i = 0; i < count_; ++i) {
      const Row& r = *used_[i];
      bool loaded;
      own_[i] -= load(r, node, w, lag, loaded);
      if (loaded || r.joint < 0) continue;
      // A joint outboard of the contact: what the wrench says of it has not reached it.
      for (int own : observer_.joints()[r.joint].nodes)
        outboard_[i] += dot(earlier(posture_.subspace(own), own, lag), w);
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
    const int first = has_wrench_ ? 6 : 0;
    double* d = design_.data();  // rows of six, then the measured number
    for (int i = 0; i < first; ++i) {
      for (int k = 0; k < 6; ++k) d[7 * i + k] = i == k ? 1.0 : 0.0;
      d[7 * i + 6] = wrench_[i];
    }
    for (int i = 0; i < count_; ++i) {
      double* line = d + 7 * (first + i);
      const bool loaded = subspace(*used_[i], node, line);
      line[6] = own_[i];
      if (loaded && has_wrench_ && std::isfinite(outboard_[i])) {
        line[6] = outboard_[i];
        for (int k = 0; k < 6; ++k) line[6] += line[k] * raw_wrench_[k];
      }
    }
    for (int k = 0; k < 7; ++k) solve_lower(factor_.data(), size_, d + k, 7);
    Quadratic result{};
    for (int i = 0; i < size_; ++i) {
      const double* line = d + 7 * i;
      for (int a = 0; a < 6; ++a) {
        for (int b = 0; b <= a; ++b) result.information[6 * a + b] += line[a] * line[b];
        result.vector[a] += line[a] * line[6];
      }
      result.constant += line[6] * line[6];
    }
    for (int a = 0; a < 6; ++a) {
      for (int b = a + 1; b < 6; ++b) result.information[6 * a + b] = result.information[6 * b + a];
    }
    return result;
  }

 private:
  static constexpr double kOffset = 3.0;  // sigmas of a normal variable: beyond, it is no noise

  // A joint's torque, or one axis of a sensor that has fewer than six.
  struct Row {
    int joint, sensor, axis;
  };

  std::vector<Row> rows_of(int g) const {
    std::vector<Row> rows;
    const Layout& layout = observer_.layout();
    const int own = layout.segments[g].sensor;
    for (int j = 0; j < layout_.joints; ++j) {
      const JointRow& joint = observer_.joints()[j];
      if (joint.measured() && !joint.nodes.empty() && inboard_sensor(joint.nodes[0]) == own)
        rows.push_back({j, -1, -1});
    }
    for (int s = 0; s < layout_.sensors; ++s) {
      const SensorRow& sensor = observer_.sensors()[s];
      if (sensor.six_axis() || inboard_sensor(sensor.node) != own || carries_sensor(sensor.node))
        continue;
      for (int a = 0; a < 6; ++a) {
        if (sensor.axes[a]) rows.push_back({-1, s, a});
      }
    }
    return rows;
  }

  int inboard_sensor(int node) const {
    for (; node >= 0; node = posture_.nodes()[node].parent) {
      for (std::size_t s = 0; s < observer_.sensors().size(); ++s) {
        if (observer_.sensors()[s].six_axis() && observer_.sensors()[s].node == node)
          return static_cast<int>(s);
      }
    }
    return -1;
  }

  bool carries_sensor(int node) const {
    for (const SensorRow& s : observer_.sensors()) {
      if (s.six_axis() && observer_.layout().is_outboard(s.node, node)) return true;
    }
    return false;
  }

  // A row's offset is what the detector has taken out of it.
  void find_offsets(const double* normalized) {
    std::fill(joint_offsets_.begin(), joint_offsets_.end(), 0.0);
    std::fill(wrench_offset_, wrench_offset_ + 6, 0.0);
    if (normalized == nullptr) return;
    double clean[6];
    bool complete = false;
    for (std::size_t i = 0; i < tests_.size(); ++i) {
      const DetectionRow& test = tests_[i];
      if (test.segment != segment_) continue;
      const double value = normalized[i] * test.contact;
      if (test.component < 0) {
        joint_offsets_[test.joint] = row_[layout_.segment_torque() + test.joint] - value;
      } else {
        clean[test.component] = value;
        complete = test.component == 5;
      }
    }
    if (!has_wrench_ || !complete) return;
    const int sensor = observer_.layout().segments[segment_].sensor;
    store(wrench_to_parent(posture_.pose(observer_.sensors()[sensor].node),
                           {{clean[0], clean[1], clean[2]}, {clean[3], clean[4], clean[5]}}),
          clean);
    for (int i = 0; i < 6; ++i) wrench_offset_[i] = raw_wrench_[i] - clean[i];
  }

  // Takes the offsets out if there are any: what noise alone explains is none, and would only add
  // its own noise. The baseline, a mean over `quiet` [s], is surer than one sample.
  bool take_out_offsets() {
    const int first = has_wrench_ ? 6 : 0;
    double* d = design_.data();
    std::copy(wrench_offset_, wrench_offset_ + first, d);
    for (int i = 0; i < count_; ++i) d[first + i] = offset_of(*used_[i]);
    solve_lower(factor_.data(), size_, d);
    double distance = 0.0;
    for (int i = 0; i < size_; ++i) distance += d[i] * d[i];
    const double rest = variance_of_baseline();
    if (distance < rest * chi2_limit(size_, kOffset)) return true;
    for (int i = 0; i < first; ++i) wrench_[i] -= wrench_offset_[i];
    for (int i = 0; i < count_; ++i) {
      own_[i] -= offset_of(*used_[i]);
      outboard_[i] -= offset_of(*used_[i]);
    }
    if (!weigh()) return false;
    for (int i = 0; i < size_ * size_; ++i) factor_[i] *= std::sqrt(1.0 + rest);
    return true;
  }

  double offset_of(const Row& r) const { return r.joint >= 0 ? joint_offsets_[r.joint] : 0.0; }

  // Of a mean of filtered noise over a time, in parts of the variance of one sample.
  double variance_of_baseline() const {
    const int sensor = observer_.layout().segments[segment_].sensor;
    const double bandwidth = sensor >= 0 ? observer_.sensors()[sensor].bandwidth
                             : layout_.joints > 0 ? observer_.joints()[0].bandwidth
                                                  : 0.0;
    const double x = bandwidth * (quiet_ != nullptr ? quiet_[segment_] : 0.0);
    return x > 1e-3 ? 2.0 / x * (1.0 - (1.0 - std::exp(-x)) / x) : 1.0;
  }

  void take(const Row& r) {
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

  // What a unit wrench on the body of `node` does to a row; false: nothing.
  bool subspace(const Row& r, int node, double* out) const {
    Spatial sum{};
    bool loaded = false;
    if (r.joint >= 0) {
      for (int own : observer_.joints()[r.joint].nodes) {
        if (!observer_.layout().is_outboard(node, own)) continue;
        sum = sum + posture_.subspace(own);
        loaded = true;
      }
    } else if (observer_.layout().is_outboard(node, observer_.sensors()[r.sensor].node)) {
      sum = posture_.axis(observer_.sensors()[r.sensor].node, r.axis);
      loaded = true;
    }
    // The power of a wrench along a twist [v; w]: f . v + m . w.
    store(sum, out);
    return loaded;
  }

  // The covariance of all rows, from the sources of noise, and its Cholesky factor.
  bool weigh() {
    noise_.clear();
    const int first = has_wrench_ ? 6 : 0;
    if (has_wrench_) {
      noise_.add_wrench(0, observer_.layout().segments[segment_],
                        {{wrench_[0], wrench_[1], wrench_[2]}, {wrench_[3], wrench_[4], wrench_[5]}});
    }
    for (int i = 0; i < count_; ++i) {
      const Row& r = *used_[i];
      if (r.joint >= 0) {
        noise_.add_joint(first + i, r.joint, own_[i]);
      } else {
        noise_.add_axis(first + i, r.sensor, r.axis, own_[i]);
      }
    }
    noise_.covariance(size_, has_wrench_ ? 3 : 0, covariance_.data());
    return factor();
  }

  bool factor() {
    std::copy_n(covariance_.data(), size_ * size_, factor_.data());
    return cholesky(factor_.data(), size_, 1e-15);
  }

  // How the twist along which a row measures was `lag` ago; it moves with the body of `node`.
  Spatial earlier(const Spatial& s, int node, double lag) const {
    const Spatial& v = posture_.twist(node);
    return {s.linear - lag * (cross(v.angular, s.linear) + cross(v.linear, s.angular)),
            s.angular - lag * cross(v.angular, s.angular)};
  }

  // What a wrench on the body of `node`, `lag` old, does to a row; `loaded`: is it felt there?
  double load(const Row& r, int node, const Spatial& w, double lag, bool& loaded) const {
    double sum = 0.0;
    loaded = false;
    if (r.joint < 0) {
      const int own = observer_.sensors()[r.sensor].node;
      loaded = observer_.layout().is_outboard(node, own);
      return loaded ? dot(earlier(posture_.axis(own, r.axis), own, lag), w) : 0.0;
    }
    for (int own : observer_.joints()[r.joint].nodes) {
      if (!observer_.layout().is_outboard(node, own)) continue;
      sum += dot(earlier(posture_.subspace(own), own, lag), w);
      loaded = true;
    }
    return sum;
  }

  const Observer& observer_;
  Posture posture_;
  std::vector<DetectionRow> tests_;
  RowLayout layout_;
  RowNoise noise_;
  std::vector<std::vector<Row>> rows_;  // per segment
  std::vector<double> joint_offsets_;

  int segment_ = 0, count_ = 0, size_ = 0;
  const double *row_ = nullptr, *quiet_ = nullptr;
  bool has_wrench_ = false;
  double wrench_[6] = {}, raw_wrench_[6] = {}, wrench_offset_[6] = {};
  std::vector<const Row*> used_;
  std::vector<double> own_;       // if the contact is inboard of the joint
  std::vector<double> outboard_;  // if it is outboard, less what the wrench says
  std::vector<double> covariance_, factor_, design_;
};

}  // namespace touchline
