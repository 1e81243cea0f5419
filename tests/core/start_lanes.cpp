// SPDX-License-Identifier: Apache-2.0
// Pairs of points and the forces at both that explain best, side by side in lanes: prints what goes
// in and what comes out, for an independent solution to be compared with.
#include "touchline/detail/localizer/start_beside.hpp"

#include <cstdio>
#include <random>

using namespace touchline;

// A^T B of two (rows, 6).
static void multiply(const double* A, const double* B, int rows, double* out) {
  for (int r = 0; r < rows; ++r) {
    for (int i = 0; i < 6; ++i) {
      for (int j = 0; j < 6; ++j) out[6 * i + j] += A[6 * r + i] * B[6 * r + j];
    }
  }
}

int main() {
  constexpr int kRows = 9, kStarts[2] = {5, 7};
  constexpr double kScale = 50.0;
  std::mt19937 chance(1);
  const auto draw = [&] { return 2e-9 * static_cast<double>(chance() % 1000000000) - 1.0; };
  double maps[2][6 * kRows], target[kRows], square = 0.0;
  std::printf("target");
  for (double& y : target) {
    y = 30.0 * draw();
    square += y * y;
    std::printf(" %.17g", y);
  }
  StartLanes lanes[2] = {StartLanes(kStarts[0]), StartLanes(kStarts[1])};
  double N[3][36] = {}, h[2][6] = {};  // of the first body, of the second, and what couples them
  for (int e = 0; e < 2; ++e) {
    std::printf("\nmap");
    for (double& m : maps[e]) std::printf(" %.17g", m = draw());
    std::vector<Vec3> points, normals;
    std::printf("\npoints");
    for (int i = 0; i < kStarts[e]; ++i) {
      points.push_back({draw(), draw(), draw()});
      normals.push_back({draw(), draw(), draw()});
      std::printf(" %.17g %.17g %.17g", points[i].x, points[i].y, points[i].z);
    }
    multiply(maps[e], maps[e], kRows, N[e]);
    for (int r = 0; r < kRows; ++r) {
      for (int i = 0; i < 6; ++i) h[e][i] += maps[e][6 * r + i] * target[r];
    }
    lanes[e].fill(points.data(), normals.data(), kStarts[e], N[e], 6, h[e], kScale);
  }
  multiply(maps[0], maps[1], kRows, N[2]);
  for (int i = 0; i < kStarts[0]; ++i) {
    StartBeside one(lanes[0], i, N[2], 6, square);
    for (int block = 0; block < lanes[1].blocks(); ++block) {
      const Lanes misfit = one.misfit(lanes[1], block);
      Lanes f[6];
      one.forces(lanes[1], block, f);
      for (int k = 0; k < kLanes; ++k) {
        const int j = block * kLanes + k;
        if (!std::isfinite(lane(misfit, k)) && j >= kStarts[1]) continue;  // no start
        std::printf("\npair %d %d %.17g", i, j, lane(misfit, k));
        for (const Lanes& x : f) std::printf(" %.17g", lane(x, k));
      }
    }
  }
  for (double x = -1.0; x <= 1.0; x += 0.01)
    std::printf("\nangle %.17g %.17g", x, lane(arc_cosine(all_lanes(x)), 0));
  std::printf("\n");
}
