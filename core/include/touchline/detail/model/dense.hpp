// SPDX-License-Identifier: Apache-2.0
// Small symmetric systems, row by row in plain arrays.
// Theory: docs/theory.md, section 1.3.
#pragma once

#include <cmath>

#include "touchline/detail/model/lanes.hpp"

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

// The same for sizes that are known when it is compiled, to the last bit: each element goes through the
// same operations, but those of a row stand side by side. What is above the diagonal has no meaning.
template <int n>
bool cholesky_by_rows(double* a, double tolerance) {
  double diagonal[n];
  for (int i = 0; i < n; ++i) diagonal[i] = a[i * n + i];
  for (int j = 0; j < n; ++j) {
    const double d = a[j * n + j];
    if (!(d > tolerance * diagonal[j])) return false;
    const double root = std::sqrt(d);
    double column[n] = {};
    for (int i = j + 1; i < n; ++i) column[i] = a[i * n + j] / root;
    for (int i = j + 1; i < n; ++i) {
      const double factor = column[i];
      double row[n];
      for (int k = 0; k < n; ++k) row[k] = a[i * n + k] - factor * column[k];
      for (int k = 0; k < n; ++k) a[i * n + k] = row[k];
      a[i * n + j] = factor;
    }
    a[j * n + j] = root;
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

// The same for `width` right sides that stand side by side, x[i * width] to x[i * width + width - 1],
// whole registers of them. Each goes through the operations of one alone: the last bits are the same.
// The first `done` rows are solved already.
template <int width>
inline void solve_lower_rows(const double* l, int n, double* x, int done = 0) {
  constexpr int kCount = width / kLanes;  // registers of a row
  for (int i = done; i < n; ++i) {
    double* own = x + i * width;
    Lanes s[kCount];
    for (int c = 0; c < kCount; ++c) s[c] = load_lanes(own + c * kLanes);
    for (int k = 0; k < i; ++k) {
      const Lanes factor = all_lanes(l[i * n + k]);
      for (int c = 0; c < kCount; ++c) s[c] -= factor * load_lanes(x + k * width + c * kLanes);
    }
    const Lanes diagonal = all_lanes(l[i * n + i]);
    for (int c = 0; c < kCount; ++c) store_lanes(s[c] / diagonal, own + c * kLanes);
  }
}

// Loops of compile-time bounds written out: a small factor then stays in registers.
#if defined(__clang__)
#define TOUCHLINE_UNROLL _Pragma("unroll")
#elif defined(__GNUC__)
#define TOUCHLINE_UNROLL _Pragma("GCC unroll 16")
#else
#define TOUCHLINE_UNROLL
#endif

// The same for sizes that are known when it is compiled: operations that do not wait for each other
// stand together. The last bits differ.
template <int n>
bool cholesky(double* a, double tolerance = 1e-13) {
  double column[n], diagonal[n];
  TOUCHLINE_UNROLL
  for (int i = 0; i < n; ++i) diagonal[i] = a[i * n + i];
  TOUCHLINE_UNROLL
  for (int j = 0; j < n; ++j) {
    const double d = a[j * n + j];
    if (!(d > tolerance * diagonal[j])) return false;
    const double root = std::sqrt(d), inverse = 1.0 / root;
    a[j * n + j] = root;
    TOUCHLINE_UNROLL
    for (int i = j + 1; i < n; ++i) column[i] = a[i * n + j] *= inverse;
    TOUCHLINE_UNROLL
    for (int i = j + 1; i < n; ++i) {
      TOUCHLINE_UNROLL
      for (int k = j + 1; k <= i; ++k) a[i * n + k] -= column[i] * column[k];
    }
  }
  return true;
}

// x = (L L^T)^-1 x.
template <int n>
void solve_cholesky(const double* l, double* x) {
  double inverse[n];
  TOUCHLINE_UNROLL
  for (int i = 0; i < n; ++i) inverse[i] = 1.0 / l[i * n + i];
  TOUCHLINE_UNROLL
  for (int i = 0; i < n; ++i) {
    x[i] *= inverse[i];
    TOUCHLINE_UNROLL
    for (int k = i + 1; k < n; ++k) x[k] -= l[k * n + i] * x[i];
  }
  TOUCHLINE_UNROLL
  for (int i = n - 1; i >= 0; --i) {
    x[i] *= inverse[i];
    TOUCHLINE_UNROLL
    for (int k = 0; k < i; ++k) x[k] -= l[i * n + k] * x[i];
  }
}

#undef TOUCHLINE_UNROLL

// The inverse of a lower factor, in `out`, with zeros above; its product with a vector takes no
// division.
inline void invert_lower(const double* l, int n, double* out) {
  for (int j = 0; j < n; ++j) {
    for (int i = 0; i < n; ++i) out[i * n + j] = i == j ? 1.0 : 0.0;
    solve_lower(l, n, out + j, n);
  }
}

// |L x|^2 of a lower (n, n) matrix.
inline double squared_norm(const double* l, const double* x, int n) {
  double total = 0.0;
  for (int i = 0; i < n; ++i) {
    double s = 0.0;
    for (int k = 0; k <= i; ++k) s += l[i * n + k] * x[k];
    total += s * s;
  }
  return total;
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

// The inverse of a symmetric positive definite (n, n) matrix, of which the lower triangle is given,
// in its place; false if it is not positive definite. `work` (n, n).
inline bool invert(double* a, int n, double* work) {
  if (!cholesky(a, n, 1e-15)) return false;
  invert_lower(a, n, work);
  for (int i = 0; i < n; ++i) {
    for (int j = 0; j <= i; ++j) {
      double s = 0.0;
      for (int k = i; k < n; ++k) s += work[k * n + i] * work[k * n + j];
      a[i * n + j] = a[j * n + i] = s;
    }
  }
  return true;
}

// The same for sizes that are known when it is compiled, to the last bit.
template <int n>
bool invert_by_rows(double* a) {
  if (!cholesky_by_rows<n>(a, 1e-15)) return false;
  double W[n][n];  // the inverse of the factor, with zeros above
  for (int i = 0; i < n; ++i) {
    double row[n] = {};
    row[i] = 1.0;
    for (int k = 0; k < i; ++k) {
      const double factor = a[i * n + k];
      for (int j = 0; j < n; ++j) row[j] -= factor * W[k][j];
    }
    const double diagonal = a[i * n + i];
    for (int j = 0; j < n; ++j) W[i][j] = row[j] / diagonal;
  }
  for (int i = 0; i < n; ++i) {
    double row[n] = {};
    for (int k = i; k < n; ++k) {
      const double factor = W[k][i];
      for (int j = 0; j < n; ++j) row[j] += factor * W[k][j];
    }
    for (int j = 0; j <= i; ++j) a[i * n + j] = a[j * n + i] = row[j];
  }
  return true;
}

// log det of L L^T.
inline double log_determinant(const double* l, int n) {
  double sum = 0.0;
  for (int i = 0; i < n; ++i) sum += std::log(l[i * n + i]);
  return 2.0 * sum;
}

// Jacobi's rotations: the eigenvalues of a symmetric (n, n) matrix end up on its diagonal; the columns
// of v are turned along, so that from the identity on they end up as the eigenvectors.
inline void diagonalize(double* a, double* v, int n) {
  constexpr int kSweeps = 12;  // a bound: Jacobi's method converges quadratically
  for (int sweep = 0; sweep < kSweeps; ++sweep) {
    double off = 0.0, diagonal = 0.0;
    for (int i = 0; i < n; ++i) {
      diagonal += a[i * n + i] * a[i * n + i];
      for (int j = 0; j < i; ++j) off += a[i * n + j] * a[i * n + j];
    }
    if (!(off > 1e-16 * diagonal)) return;
    for (int p = 0; p < n; ++p) {
      for (int q = p + 1; q < n; ++q) {
        if (a[p * n + q] * a[p * n + q] <= 1e-18 * std::fabs(a[p * n + p] * a[q * n + q])) continue;
        const double theta = 0.5 * (a[q * n + q] - a[p * n + p]) / a[p * n + q];
        const double t = std::copysign(1.0, theta) / (std::fabs(theta) + std::sqrt(theta * theta + 1.0));
        const double c = 1.0 / std::sqrt(t * t + 1.0), s = t * c;
        for (int k = 0; k < n; ++k) {
          const double x = a[k * n + p], y = a[k * n + q];
          a[k * n + p] = c * x - s * y;
          a[k * n + q] = s * x + c * y;
        }
        for (int k = 0; k < n; ++k) {
          const double x = a[p * n + k], y = a[q * n + k];
          a[p * n + k] = c * x - s * y;
          a[q * n + k] = s * x + c * y;
        }
        for (int k = 0; k < n; ++k) {
          const double x = v[k * n + p], y = v[k * n + q];
          v[k * n + p] = c * x - s * y;
          v[k * n + q] = s * x + c * y;
        }
      }
    }
  }
}

}  // namespace touchline
