// SPDX-License-Identifier: Apache-2.0
// One pipeline per thread, all at once: each says what the first one says.
#include <cmath>
#include <cstdio>
#include <thread>
#include <vector>

#include "touchline/touchline.hpp"

namespace {

using namespace touchline;

constexpr int kThreads = 4, kSamples = 400;

// An arm at rest; after half of the samples its wrenches and torques jump.
double said(const Robot& robot) {
  Pipeline pipeline(robot);
  const std::size_t n = robot.joints.size(), k = robot.sensors.size();
  std::vector<double> q(n, 0.3), qd(n, 0.0), tau(n, 0.0), wrench(6 * k, 0.0);
  double sum = 0.0;
  for (int i = 0; i < kSamples; ++i) {
    for (double& x : wrench) x = 2 * i < kSamples ? 0.0 : 7.0;
    const Result result = pipeline.update({i * 1e-3, q.data(), qd.data(), tau.data(), wrench.data()});
    for (const Contact& contact : result.contacts) sum += std::fabs(contact.wrench[0]) + contact.event;
    for (const EventChange& change : result.events) sum += change.event.detected;
  }
  return sum;
}

}  // namespace

int main(int, char** arguments) {
  const Robot robot = read_robot(arguments[1]);
  std::vector<double> sums(kThreads);
  std::vector<std::thread> threads;
  for (int i = 0; i < kThreads; ++i)
    threads.emplace_back([&sums, &robot, i] { sums[i] = said(robot); });
  for (std::thread& thread : threads) thread.join();
  for (const double sum : sums) std::printf("%.17g\n", sum);
  return 0;
}
