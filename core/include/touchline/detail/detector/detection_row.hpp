// SPDX-License-Identifier: Apache-2.0
// What a detector tests, and what it is told of each row.
// Theory: docs/theory.md, section 4.1.
#pragma once

#include <vector>

#include "touchline/detail/detector/noise_figures.hpp"

namespace touchline {

enum class Level { none = 0, contact = 1, collision = 2 };

// How fast the robot moves: what errors of the model grow with.
struct Activity {
  double speed2 = 0.0;        // sum of squared joint speeds [rad2/s2]
  double acceleration = 0.0;  // norm of the joint accelerations [rad/s2]
};

// One sigma of what the model's errors leave in a row [N or Nm].
struct ModelError {
  double constant = 0.0;
  double speed = 0.0;         // per rad2/s2 of squared speed
  double acceleration = 0.0;  // per rad/s2

  double variance(const Activity& a) const { return constant * constant + moving_variance(a); }

  // Without the part that an arm at rest has, too.
  double moving_variance(const Activity& a) const {
    const double v = speed * a.speed2, b = acceleration * a.acceleration;
    return v * v + b * b;
  }
};

// One residual of a segment: a component of its wrench in the frame of its own sensor, or the
// torque that contacts on the segment put on one of its joints.
struct DetectionRow {
  int segment;
  int component;  // 0 to 5 of the segment wrench; -1: a joint
  int joint;
  double contact, collision;  // thresholds [N or Nm]
  double baseline_limit;      // how far the baseline may go from where it began [N or Nm]
  ModelError slow, quick;     // against the baseline and against the reference
  ModelError drift;           // against the baseline, while a contact lasts
  double seen = 0.0;          // sigmas of the noise, told and seen, that `contact` is kept above
};

// What is known of a row at one sample.
struct RowSample {
  double residual = 0.0;    // filtered [N or Nm]
  double innovation = 0.0;  // mean load over the last interval, not filtered
  double offset = 0.0;      // of the residual: the slow baseline
  double reference = 0.0;   // and the quick one
  double referred = 0.0;    // time over which the quick one has been averaged [s]
  double gap_std = 0.0;     // one sigma of what lost samples may have left in the residual
  double speed = 0.0;       // of its joint [rad/s or m/s]; a wrench has none
  double slowest = 0.0;     // the least size of that since the sample before: 0 where the joint has turned
  bool known = false;
};

struct DetectionTimes {
  double min_duration;  // a test must hold this long to fire [s]
  double hold;          // and be quiet this long to clear [s]
  double baseline;      // time constant of the baseline [s]
  double release;       // cleared below this fraction of the thresholds
};

// Rows: each by itself, and where `sum_limit` is finite the sum of their squares. Scaled: each
// against what noise and the model's errors let expect at this speed and acceleration. Chi2: all
// together, against their covariance. GLRT: the unfiltered loads of several windows, likewise.
// CUSUM: the innovations of a Kalman filter.
enum class Test { rows, scaled, chi2, glrt, cusum };

// A test in use, with its threshold for each segment.
struct TestSetting {
  Test test;
  std::vector<double> limits;
};

struct DetectionSettings {
  std::vector<TestSetting> tests;
  std::vector<double> sum_limits;  // per segment: of the sum of squares of all normalized rows
  DetectionTimes times;
  NoiseFigures noise;
  std::vector<double> windows;  // of the GLRT [s]
};

}  // namespace touchline
