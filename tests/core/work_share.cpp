// SPDX-License-Identifier: Apache-2.0
// What a sample may do on searches, and who may begin one.
#include <cstdio>

#include "touchline/detail/localizer/work_share.hpp"

static int failures = 0;
static void expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("%s\n", what);
  ++failures;
}

int main() {
  touchline::WorkShare share(800);
  expect(share.take(0.0, true) == 100, "a touch that begins has an eighth");
  expect(share.take(0.001, false) == 800, "one that lasts has all");
  share.spend(800);
  expect(share.take(0.001, false) == 0, "what is spent is gone");
  expect(share.take(0.002, false) == 800, "the next sample has all again");
  share.divide(2);
  expect(share.take(0.002, false) == 800, "a sample that has begun is not divided");
  expect(share.take(0.003, false) == 400, "two pipelines share the next one");
  expect(share.take(0.003, true) == 50, "and its eighth");
  share.divide(1);
  expect(share.take(0.004, false) == 800, "one alone has all");
  expect(share.begin() && !share.begin(), "one touch is looked for at once");
  expect(share.begin_pair() && !share.begin_pair(), "and one pair");
  share.take(0.005, false);
  expect(share.begin() && share.begin_pair(), "the others in the next sample");
  return failures > 0;
}
