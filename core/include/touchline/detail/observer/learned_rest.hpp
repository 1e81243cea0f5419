// SPDX-License-Identifier: Apache-2.0
// What a joint's torque has beside the model, as a table over its own position and velocity: ripple,
// friction that depends on the place, offsets of a sensor that turns. It was learned from motion
// without contact. Between the nodes it is bilinear; beyond them, where nothing was seen, it is 0.
// Theory: docs/theory.md, section 2.1.
#pragma once

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <vector>

namespace touchline {

struct LearnedRest {
  std::vector<double> q, qd;   // nodes in rising order [rad or m, and per s]; none: there is no rest
  std::vector<double> torque;  // (q, qd) at the nodes [Nm or N]; 0 on all four edges

  bool empty() const { return torque.empty(); }

  // It is never larger than the largest node, and goes to 0 without a step.
  double operator()(double position, double velocity) const {
    if (!(position > q.front() && position < q.back())) return 0.0;
    if (!(velocity > qd.front() && velocity < qd.back())) return 0.0;
    const std::size_t i = node_below(q, position), k = node_below(qd, velocity);
    const double x = (position - q[i]) / (q[i + 1] - q[i]);
    const double y = (velocity - qd[k]) / (qd[k + 1] - qd[k]);
    const double *near = torque.data() + i * qd.size() + k, *far = near + qd.size();
    return (1.0 - x) * ((1.0 - y) * near[0] + y * near[1]) + x * ((1.0 - y) * far[0] + y * far[1]);
  }

  // May it be used, as it stands?
  bool sound() const {
    const std::size_t rows = q.size(), columns = qd.size();
    if (empty()) return rows == 0 && columns == 0;
    if (rows < 2 || columns < 2 || torque.size() != rows * columns) return false;
    for (const double x : torque) {
      if (!std::isfinite(x)) return false;
    }
    for (std::size_t i = 0; i < rows; ++i) {
      for (std::size_t k = 0; k < columns; ++k) {
        const bool edge = i == 0 || k == 0 || i + 1 == rows || k + 1 == columns;
        if (edge && torque[i * columns + k] != 0.0) return false;
      }
    }
    return rising(q) && rising(qd);
  }

 private:
  // The last node that is not above x, which lies within the nodes.
  static std::size_t node_below(const std::vector<double>& nodes, double x) {
    return static_cast<std::size_t>(std::upper_bound(nodes.begin(), nodes.end(), x) -
                                    nodes.begin()) - 1;
  }
  static bool rising(const std::vector<double>& nodes) {
    for (std::size_t i = 0; i < nodes.size(); ++i) {
      if (!std::isfinite(nodes[i]) || (i > 0 && nodes[i] <= nodes[i - 1])) return false;
    }
    return true;
  }
};

}  // namespace touchline
