// SPDX-License-Identifier: Apache-2.0
// What measurements say of one wrench: chi2(w) = constant - 2 vector . w + w^T information w, for
// the contact's wrench w in world axes about the world origin.
// Theory: docs/theory.md, section 5.2.
#pragma once

#include <cmath>

#include "touchline/detail/model/dense.hpp"
#include "touchline/detail/model/spatial.hpp"

namespace touchline {

struct Quadratic {
  double information[36];
  double vector[6];
  double constant;

  double operator()(const double* w) const {
    double chi2 = constant;
    for (int i = 0; i < 6; ++i) {
      double row = -2.0 * vector[i];
      for (int j = 0; j < 6; ++j) row += information[6 * i + j] * w[j];
      chi2 += row * w[i];
    }
    return chi2;
  }

  // Measured is not w but w + `more`.
  void shift(const Spatial& more) {
    double d[6], product[6];
    store(more, d);
    for (int i = 0; i < 6; ++i) {
      product[i] = 0.0;
      for (int j = 0; j < 6; ++j) product[i] += information[6 * i + j] * d[j];
    }
    for (int i = 0; i < 6; ++i) {
      constant += d[i] * (product[i] - 2.0 * vector[i]);
      vector[i] -= product[i];
    }
  }
};

// Beyond it lies as much of chi2 as of a normal variable beyond `sigmas` (Wilson-Hilferty).
inline double chi2_limit(int degrees, double sigmas) {
  const double n = degrees, c = 2.0 / (9.0 * n);
  return n * std::pow(1.0 - c + sigmas * std::sqrt(c), 3);
}

// Adds an unknown moment of `sigma` [Nm] about each axis to what is measured of a wrench; returns
// the logarithm of how much wider the measurements' distribution gets, the half of it.
inline double loosen(Quadratic& q, double sigma) {
  double M[9], x[3][7];  // solutions for the information and the vector, by row
  const double inverse = 1.0 / (sigma * sigma);
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j)
      M[3 * i + j] = q.information[6 * (3 + i) + 3 + j] + (i == j ? inverse : 0.0);
    for (int j = 0; j < 6; ++j) x[i][j] = q.information[6 * (3 + i) + j];
    x[i][6] = q.vector[3 + i];
  }
  if (!cholesky(M, 3)) return 0.0;
  for (int j = 0; j < 7; ++j) solve_lower(M, 3, &x[0][j], 7);
  for (int k = 0; k < 3; ++k) {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) q.information[6 * i + j] -= x[k][i] * x[k][j];
      q.vector[i] -= x[k][i] * x[k][6];
    }
    q.constant -= x[k][6] * x[k][6];
  }
  return 0.5 * (log_determinant(M, 3) - 3.0 * std::log(inverse));
}

}  // namespace touchline
