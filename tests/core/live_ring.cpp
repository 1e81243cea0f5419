// SPDX-License-Identifier: Apache-2.0
// A ring between two threads, what a stream admits, and a runner that loses nothing.
#include <cmath>
#include <cstdio>
#include <limits>
#include <thread>
#include <vector>

#include "touchline/live.hpp"

namespace tl = touchline;

namespace {

int failures = 0;

void expect(bool holds, const char* what) {
  if (holds) return;
  std::printf("FAILED: %s\n", what);
  ++failures;
}

// A hundred thousand numbers through four slots: all arrive, in order, whole.
void test_ring() {
  using Pair = std::vector<long>;
  tl::Ring<Pair> ring(4, Pair(2));
  constexpr long kCount = 100000;
  std::thread writer([&] {
    for (long i = 0; i < kCount;) {
      Pair* slot = ring.vacant();
      if (slot == nullptr) {
        std::this_thread::yield();
        continue;
      }
      (*slot)[0] = i;
      (*slot)[1] = -i;
      ring.publish();
      ++i;
    }
  });
  bool whole = true;
  for (long i = 0; i < kCount;) {
    const Pair* slot = ring.front();
    if (slot == nullptr) {
      std::this_thread::yield();
      continue;
    }
    whole = whole && (*slot)[0] == i && (*slot)[1] == -i;
    ring.release();
    ++i;
  }
  writer.join();
  expect(whole && ring.empty() && ring.capacity() == 4, "every number arrives in order and whole");
}

void test_full() {
  tl::Ring<int> ring(2, 0);
  for (int i = 0; i < 2; ++i) {
    *ring.vacant() = i;
    ring.publish();
  }
  expect(ring.vacant() == nullptr, "a full ring has no vacant slot");
  ring.release();
  expect(ring.vacant() != nullptr && *ring.front() == 1, "what is released makes room");
}

void test_admission() {
  using Verdict = tl::Admission::Verdict;
  tl::Admission a;
  expect(a.take(std::numeric_limits<double>::quiet_NaN()) == Verdict::refused, "no number");
  expect(a.take(5.0) == Verdict::accepted && a.take(5.0) == Verdict::refused, "a repetition");
  expect(a.take(4.9) == Verdict::refused && a.take(5.1) == Verdict::accepted, "a late one");
  expect(a.take(1.0) == Verdict::set_back && a.take(1.1) == Verdict::accepted, "a clock set back");
  for (int i = 1; i < 10; ++i) expect(a.take(1.1 - 0.01 * i) == Verdict::refused, "disorder");
  expect(a.take(1.05) == Verdict::set_back, "disorder that lasts is a clock set back");
}

// Whatever its thread does, samples that find room are taken in order; the others are counted.
void test_runner() {
  std::vector<long long> taken;
  tl::Runner runner(2, 1, 1024, [&](const tl::Arrived& a) {
    taken.push_back(a.sequence);
    const tl::Sample s = a.sample(2);
    if (s.q[1] != s.time || s.wrench[5] != -s.time) taken.push_back(-1);
    if (a.sequence == 100) std::this_thread::sleep_for(std::chrono::milliseconds(20));
  });
  long pushed = 0;
  for (int i = 0; i < 20000; ++i) {
    pushed += runner.push([&](tl::Arrived& slot) {
      slot.sequence = i;
      slot.time = i;
      slot.signals[1] = i;
      slot.signals[11] = -i;
    });
    if (i % 64 == 0) std::this_thread::sleep_for(std::chrono::microseconds(50));
  }
  runner.stop();
  bool ordered = static_cast<long>(taken.size()) == pushed;
  for (std::size_t i = 1; i < taken.size(); ++i) ordered = ordered && taken[i] > taken[i - 1];
  expect(ordered, "samples are taken in order and whole");
  expect(runner.taken() == taken.size() && runner.overrun() == 20000 - taken.size(), "counts");
  expect(runner.longest_gap() >= 0.02 && runner.longest_gap() == 0.0, "the gap is told once");
}

}  // namespace

int main() {
  test_ring();
  test_full();
  test_admission();
  test_runner();
  std::printf("%d failures\n", failures);
  return failures == 0 ? 0 : 1;
}
