// SPDX-License-Identifier: Apache-2.0
// A running robot: samples go from the thread that receives them to a pipeline in a thread of its
// own. The receiver neither waits for the pipeline nor allocates; what others do costs no sample.
#pragma once

#include <atomic>
#include <chrono>
#include <cmath>
#include <condition_variable>
#include <cstddef>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "touchline/sample.hpp"

namespace touchline {

// Now, on the clock of arrivals [s].
inline double monotonic_seconds() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

// A bounded queue between one thread that writes and one that reads. Neither waits for the other.
// Slots are made once; `T` should keep its memory when it is written again.
template <class T>
class Ring {
 public:
  // Room for `slots` at least; `made` is copied into each.
  Ring(std::size_t slots, const T& made) {
    std::size_t size = 2;
    while (size < slots) size *= 2;
    slots_.assign(size, made);
  }

  // The writer's: the slot to fill before `publish`; null where the ring is full.
  T* vacant() {
    const std::size_t head = head_.load(std::memory_order_relaxed);
    if (head - tail_.load(std::memory_order_acquire) == slots_.size()) return nullptr;
    return &slots_[head & (slots_.size() - 1)];
  }
  void publish() { head_.store(head_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

  // The reader's: the oldest slot, to be read before `release`; null where there is none.
  const T* front() const {
    const std::size_t tail = tail_.load(std::memory_order_relaxed);
    if (tail == head_.load(std::memory_order_acquire)) return nullptr;
    return &slots_[tail & (slots_.size() - 1)];
  }
  void release() { tail_.store(tail_.load(std::memory_order_relaxed) + 1, std::memory_order_release); }

  std::size_t capacity() const { return slots_.size(); }
  bool empty() const { return front() == nullptr; }

 private:
  std::vector<T> slots_;
  // Each on a cache line of its own: the threads do not slow each other down.
  alignas(64) std::atomic<std::size_t> head_{0};
  alignas(64) std::atomic<std::size_t> tail_{0};
};

// Which samples of a stream go on: none that comes twice or behind a later one. A clock that was
// set back is told apart from disorder by how far back it is, or by how long that lasts.
class Admission {
 public:
  enum class Verdict { accepted, refused, set_back };

  Verdict take(double time) {
    if (!std::isfinite(time)) return Verdict::refused;
    if (!running_ || time > last_) {
      running_ = true;
      return accept(time, Verdict::accepted);
    }
    ++older_;
    if (time < last_ - kSetBack || older_ >= kPatience) return accept(time, Verdict::set_back);
    return Verdict::refused;
  }

 private:
  static constexpr double kSetBack = 1.0;  // [s] no network holds a sample back for so long
  static constexpr int kPatience = 10;     // older stamps in a row: more than a burst of disorder

  Verdict accept(double time, Verdict verdict) {
    last_ = time;
    older_ = 0;
    return verdict;
  }

  double last_ = 0.0;  // the newest sample's [s]
  int older_ = 0;      // stamps in a row that were older
  bool running_ = false;
};

// A sample on its way, with its numbers.
struct Arrived {
  double arrival = 0.0;    // [s] of `monotonic_seconds`
  long long sequence = 0;  // its number at the source
  double time = 0.0;       // [s] of the sensors' clock
  std::vector<double> signals;  // q (n), qd (n), tau (n), wrench (k, 6)
  std::vector<double> ages;     // (k) how much older than `time` each wrench is [s]

  Sample sample(std::size_t joints) const {
    const double* q = signals.data();
    return {time, q, q + joints, q + 2 * joints, q + 3 * joints};
  }
};

// A thread that takes each sample, in the order in which they were pushed.
class Runner {
 public:
  using Take = std::function<void(const Arrived&)>;

  // `slots` samples may wait. `take` is called in the runner's thread and must not throw.
  Runner(std::size_t joints, std::size_t sensors, std::size_t slots, Take take)
      : ring_(slots, blank(3 * joints + 6 * sensors, sensors)), take_(std::move(take)), thread_([this] { work(); }) {}

  Runner(const Runner&) = delete;
  Runner& operator=(const Runner&) = delete;
  ~Runner() { stop(); }

  // Hands a sample on; called by one thread at a time. False, and counted, where the ring is full.
  template <class Fill>
  bool push(Fill&& fill) {
    Arrived* slot = ring_.vacant();
    if (slot == nullptr) {
      overrun_.fetch_add(1, std::memory_order_relaxed);
      return false;
    }
    fill(*slot);
    ring_.publish();
    wake();
    return true;
  }

  // Takes what still waits, and ends the thread.
  void stop() {
    stopping_.store(true);
    wake();
    if (thread_.joinable()) thread_.join();
  }

  std::size_t overrun() const { return overrun_.load(); }  // samples that found no room
  std::size_t taken() const { return taken_.load(); }
  // The longest time from one sample to the next, since the last call [s].
  double longest_gap() { return longest_gap_.exchange(0.0); }

 private:
  static Arrived blank(std::size_t signals, std::size_t sensors) {
    Arrived made;
    made.signals.assign(signals, 0.0);
    made.ages.assign(sensors, 0.0);
    return made;
  }

  // Only a runner that sleeps, or is about to, has to be woken. Exchanges have one order: of this one and
  // that of `sleep` the later sees the earlier, so that either the runner sees the sample or this its sleep.
  void wake() {
    if (!asleep_.exchange(false, std::memory_order_acq_rel)) return;
    { const std::lock_guard<std::mutex> nobody_between_look_and_wait(napping_); }
    wake_.notify_one();
  }

  void sleep() {
    std::unique_lock<std::mutex> lock(napping_);
    asleep_.exchange(true, std::memory_order_acq_rel);
    wake_.wait(lock, [this] { return !ring_.empty() || stopping_.load(); });
    asleep_.store(false, std::memory_order_relaxed);
  }

  void work() {
    double last = 0.0;
    while (true) {
      if (const Arrived* sample = ring_.front()) {
        take_(*sample);
        ring_.release();
        taken_.fetch_add(1, std::memory_order_relaxed);
        const double now = monotonic_seconds();
        if (last > 0.0 && now - last > longest_gap_.load()) longest_gap_.store(now - last);
        last = now;
      } else if (stopping_.load()) {
        return;
      } else {
        sleep();
      }
    }
  }

  Ring<Arrived> ring_;
  Take take_;
  std::atomic<bool> stopping_{false}, asleep_{false};
  std::atomic<std::size_t> overrun_{0}, taken_{0};
  std::atomic<double> longest_gap_{0.0};
  std::mutex napping_;
  std::condition_variable wake_;
  std::thread thread_;  // last: it uses all of the others
};

}  // namespace touchline
