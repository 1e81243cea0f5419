// SPDX-License-Identifier: Apache-2.0
// One thread at a time: an object of the core that two Python threads call lets the second wait.
#pragma once

#include <nanobind/nanobind.h>

#include <mutex>
#include <utility>

namespace touchline::guard {

namespace nb = nanobind;

// A turn at an object. Who waits for it lets other Python threads go on: the one at work may need
// the interpreter to finish.
class Turn {
 public:
  explicit Turn(std::mutex& mutex) : lock_(mutex, std::try_to_lock) {
    if (lock_.owns_lock()) return;
    nb::gil_scoped_release release;
    lock_.lock();
  }

 private:
  std::unique_lock<std::mutex> lock_;
};

// An object with its turn.
template <class T>
struct Shared {
  template <class A, class B, class... Rest>
  Shared(A&& a, B&& b, Rest&&... rest)
      : value(std::forward<A>(a), std::forward<B>(b), std::forward<Rest>(rest)...) {}
  Shared(const Shared&) = delete;

  T value;
  std::mutex turn;
};

// An object that reads another one, and so takes its turns there.
template <class T>
struct Attached {
  template <class... Args>
  explicit Attached(std::mutex& of, Args&&... args)
      : value(std::forward<Args>(args)...), turn(of) {}
  Attached(const Attached&) = delete;

  T value;
  std::mutex& turn;
};

}  // namespace touchline::guard
