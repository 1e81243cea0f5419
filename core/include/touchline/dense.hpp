// SPDX-License-Identifier: Apache-2.0
// Small symmetric systems, row by row in plain arrays.
#pragma once

#include <cmath>

namespace touchline {

// The lower Cholesky factor in place of the lower triangle of a (n, n) matrix; false if it is not
// positive definite (to `tolerance`, relative to the diagonal).
inline bool cholesky(double* a, int n, double tolerance = 1e-13) {
  for (int j = 0; j < n; ++j) {
    const double diagonal = a[j * n + j];
    double d = diagonal;
    for (int k = 0; k < j; ++k) d -= a[j * n + k] * a[j * n + k];
    if (!(d > tolerance * diagonal)) return false;
    const double root = std::sqrt(d);
    a[j * n + j] = root;
    for (int i = j + 1; i < n; ++i) {
      double s = a[i * n + j];
      for (int k = 0; k < j; ++k) s -= a[i * n + k] * a[j * n + k];
      a[i * n + j] = s / root;
    }
  }
  return true;
}

// x = L^-1 x, for element i at x[i * stride].
inline void solve_lower(const double* l, int n, double* x, int stride = 1) {
  for (int i = 0; i < n; ++i) {
    double s = x[i * stride];
    for (int k = 0; k < i; ++k) s -= l[i * n + k] * x[k * stride];
    x[i * stride] = s / l[i * n + i];
  }
}

// x = (L L^T)^-1 x.
inline void solve_cholesky(const double* l, int n, double* x) {
  solve_lower(l, n, x);
  for (int i = n - 1; i >= 0; --i) {
    double s = x[i];
    for (int k = i + 1; k < n; ++k) s -= l[k * n + i] * x[k];
    x[i] = s / l[i * n + i];
  }
}

// log det of L L^T.
inline double log_determinant(const double* l, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += std::log(l[i * n + i]);
  return 2.0 * sum;
}

}  // namespace touchline
