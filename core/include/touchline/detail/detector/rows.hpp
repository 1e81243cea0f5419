// SPDX-License-Identifier: Apache-2.0
// The rows that a detector looks at, and what they show at the present sample: what its parts share.
// No allocation after construction.
// Theory: docs/theory.md, section 4.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <utility>
#include <vector>

#include "touchline/detail/detector/detection_row.hpp"
#include "touchline/detail/detector/row_lanes.hpp"
#include "touchline/detail/observer/observer.hpp"

namespace touchline {

// Numbers of rows that stand together.
class RowRange {
 public:
  struct Iterator {
    std::size_t row;
    std::size_t operator*() const { return row; }
    Iterator& operator++() {
      ++row;
      return *this;
    }
    bool operator!=(const Iterator& other) const { return row != other.row; }
  };

  RowRange(std::size_t first, std::size_t end) : first_(first), end_(end) {}
  Iterator begin() const { return {first_}; }
  Iterator end() const { return {end_}; }

 private:
  std::size_t first_, end_;
};

class DetectorRows {
 public:
  // Rows of a segment stand together, those of its wrench first. Of so many segments; samples come
  // `period` [s] apart.
  DetectorRows(const Observer& observer, std::vector<DetectionRow> rows, std::size_t segments,
               double period)
      : samples(rows.size()),
        residuals(rows.size()),
        known(rows.size()),
        contact(rows.size()),
        bandwidths(rows.size()),
        kept(rows.size()),
        limits(rows.size(), 1.0),
        normalized(rows.size(), 0.0),
        shares(rows.size(), 0.0),
        off(segments, 0),
        rows_(std::move(rows)),
        first_(segments + 1, 0),
        slowest_(segments, kAbsurd) {
    for (std::size_t i = 0; i < rows_.size(); ++i) {
      const DetectionRow& row = rows_[i];
      const Segment& segment = observer.layout().segments[row.segment];
      bandwidths[i] = row.component < 0 ? observer.joints()[row.joint].bandwidth
                                        : observer.sensors()[segment.sensor].bandwidth;
      kept[i] = std::exp(-bandwidths[i] * period);
      contact[i] = row.contact;
      slowest_[row.segment] = std::min(slowest_[row.segment], bandwidths[i]);
      first_[row.segment + 1] = i + 1;
    }
    for (std::size_t g = 0; g < segments; ++g) first_[g + 1] = std::max(first_[g + 1], first_[g]);
  }

  const DetectionRow& operator[](std::size_t i) const { return rows_[i]; }
  const std::vector<DetectionRow>& all() const { return rows_; }
  std::size_t size() const { return rows_.size(); }
  std::size_t segments() const { return slowest_.size(); }
  RowRange of(std::size_t segment) const { return {first_[segment], first_[segment + 1]}; }
  std::size_t first(std::size_t segment) const { return first_[segment]; }
  std::size_t end(std::size_t segment) const { return first_[segment + 1]; }
  // The least bandwidth of a segment's rows [rad/s].
  double slowest(std::size_t segment) const { return slowest_[segment]; }
  // Do its filters keep less than this part of a reading until the next sample?
  bool is_slow(std::size_t segment, double part) const {
    return first(segment) < end(segment) && kept[first(segment)] < part;
  }
  // Is it a component of a wrench, and not a joint's torque?
  bool of_wrench(std::size_t i) const { return rows_[i].component >= 0; }
  // What the load of row i must exceed now [N or Nm].
  double limit(std::size_t i) const { return limits[i] * rows_[i].contact; }

  // Is any row of a segment known?
  bool any_known(std::size_t segment) const {
    for (const std::size_t i : of(segment))
      if (samples[i].known) return true;
    return false;
  }

  std::vector<double> numbers(double (*number)(const DetectionRow&)) const {
    std::vector<double> all;
    for (const DetectionRow& row : rows_) all.push_back(number(row));
    return all;
  }

  // Of the sample: what is read; residuals [N or Nm], and 1 where they are known.
  std::vector<RowSample> samples;
  RowLanes residuals, known;
  // Of the robot: thresholds [N or Nm], bandwidths of the filters [rad/s], and what part of a reading
  // these keep until the next sample.
  RowLanes contact;
  std::vector<double> bandwidths, kept;
  // Of the sample: what `normalized` must exceed, at least 1; (residual - baseline) / threshold; the
  // size of that, in limits. The latter two are 0 where there is no settled residual.
  RowLanes limits;
  std::vector<double> normalized, shares;
  // Per segment: has the arm shown that it is not as told?
  std::vector<char> off;

 private:
  std::vector<DetectionRow> rows_;
  std::vector<std::size_t> first_;  // per segment, and one more
  std::vector<double> slowest_;     // per segment
};

}  // namespace touchline
