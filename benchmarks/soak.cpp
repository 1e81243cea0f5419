// SPDX-License-Identifier: Apache-2.0
// The part of `soak.py --native` that runs for long: no Python, the pipeline of an exported robot.
//
//   ./soak ROBOT TOUCHED FREE SAMPLES
//
// TOUCHED and FREE are recordings of equally many samples at 1 kHz: doubles, per sample time, q, qd,
// tau and wrenches. TOUCHED, in which one link is pushed once, goes in by `update`; FREE by `run`, as
// often as makes a minute with it. A gap of half a second follows each: the next one begins elsewhere.
// Prints what it counted; ends with status 1 where a push was not one event, or memory was allocated
// between the first minute and the last.
#include <unistd.h>

#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <new>
#include <stdexcept>
#include <vector>

#include "touchline/touchline.hpp"

static long allocations = 0;

void* operator new(std::size_t size) {
  ++allocations;
  if (void* memory = std::malloc(size)) return memory;
  throw std::bad_alloc();
}
void operator delete(void* memory) noexcept { std::free(memory); }
void operator delete(void* memory, std::size_t) noexcept { std::free(memory); }

constexpr double kPeriod = 1e-3, kGap = 0.5, kMinute = 60.0;  // s
constexpr int kParts = 20;                                    // prints of the memory

// A recording, channel by channel.
struct Log {
  std::vector<double> time, q, qd, tau, wrench;
};

static Log read_log(const char* path, std::size_t n, std::size_t k) {
  std::ifstream file(path, std::ios::binary);
  if (!file) throw std::runtime_error(std::string(path) + ": cannot be read");
  std::vector<double> x(1 + 3 * n + 6 * k);
  Log log;
  const auto bytes = static_cast<std::streamsize>(x.size() * sizeof(double));
  while (file.read(reinterpret_cast<char*>(x.data()), bytes)) {
    const double* at = x.data();
    log.time.push_back(*at++);
    log.q.insert(log.q.end(), at, at + n);
    log.qd.insert(log.qd.end(), at + n, at + 2 * n);
    log.tau.insert(log.tau.end(), at + 2 * n, at + 3 * n);
    log.wrench.insert(log.wrench.end(), at + 3 * n, at + 3 * n + 6 * k);
  }
  return log;
}

// Of this process [MB].
static double resident() {
  long pages = 0, held = 0;
  std::ifstream("/proc/self/statm") >> pages >> held;
  return static_cast<double>(held) * static_cast<double>(sysconf(_SC_PAGESIZE)) / 1e6;
}

// Least squares [MB] over [h].
static double slope(const std::vector<double>& hours, const std::vector<double>& sizes) {
  double n = 0, x = 0, y = 0, xx = 0, xy = 0;
  for (std::size_t i = hours.size() / 2; i < hours.size(); ++i) {
    n += 1, x += hours[i], y += sizes[i], xx += hours[i] * hours[i], xy += hours[i] * sizes[i];
  }
  return (n * xy - x * y) / (n * xx - x * x);
}

int main(int argc, char** argv) try {
  if (argc != 5) return std::fprintf(stderr, "usage: %s ROBOT TOUCHED FREE SAMPLES\n", argv[0]), 2;
  touchline::RedundantPipeline pipeline(touchline::read_robot(argv[1]));
  const std::size_t n = pipeline.robot().joints.size(), k = pipeline.robot().sensors.size();
  const Log touched = read_log(argv[2], n, k), free = read_log(argv[3], n, k);
  const double samples = std::atof(argv[4]);
  const std::size_t length = free.time.size();
  std::vector<double> time(length), rows(length * pipeline.row_layout().width());
  std::vector<double> recorded, wall, sizes;
  long pushes = 0, events = 0, early = 0;
  double done = 0.0, shift = 0.0, force = 0.0, spread = 0.0;
  const auto began = std::chrono::steady_clock::now();
  const auto count = [&](const touchline::Result& result) {
    for (const touchline::EventChange& change : result.events) {
      if (change.happened != touchline::Happened::ended) continue;
      if (events++ == 0) force = change.event.torque_peak;
      spread = std::fmax(spread, std::fabs(change.event.torque_peak - force));
    }
  };
  while (done < samples) {
    for (double minute = 0.0; minute < kMinute; minute += static_cast<double>(length) * kPeriod) {
      const Log& log = minute == 0.0 ? touched : free;
      for (std::size_t i = 0; i < length; ++i) time[i] = log.time[i] + shift;
      if (minute == 0.0) {
        ++pushes;
        for (std::size_t i = 0; i < length; ++i) {
          count(pipeline.update({time[i], &log.q[i * n], &log.qd[i * n], &log.tau[i * n],
                                 log.wrench.data() + i * 6 * k}));
        }
      } else {
        pipeline.run(length, time.data(),
                     {time[0], log.q.data(), log.qd.data(), log.tau.data(), log.wrench.data()},
                     rows.data(), count);
      }
      shift += static_cast<double>(length) * kPeriod + kGap;
      done += static_cast<double>(length);
    }
    if (pushes == 1) early = allocations;
    if (done < samples * static_cast<double>(sizes.size() + 1) / kParts) continue;
    const std::chrono::duration<double> passed = std::chrono::steady_clock::now() - began;
    const long before = allocations;
    recorded.push_back(done * kPeriod / 3600.0);
    wall.push_back(passed.count() / 3600.0);
    sizes.push_back(resident());
    std::printf("%.2e samples, %.0f s: %.1f MB\n", done, passed.count(), sizes.back());
    std::fflush(stdout);
    early += allocations - before;  // of these prints
  }
  std::printf("%.3g samples, %ld pushes, %ld events, their peaks within %.3g Nm\n", done, pushes,
              events, spread);
  std::printf("%.3f MB an hour of 1 kHz, %.3f of wall time; %ld allocations after a minute\n",
              slope(recorded, sizes), slope(wall, sizes), allocations - early);
  return events != pushes || allocations != early;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
