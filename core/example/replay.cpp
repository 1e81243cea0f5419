// SPDX-License-Identifier: Apache-2.0
// Replays a log through the pipeline of an exported robot; prints all that is said of contacts and
// of events, as numbers to the last bit (`visit_fields` tells what they are).
//
//   touchline export sara --out sara.touchline
//   c++ -std=c++17 -O2 -ffp-contract=off -I core/include core/example/replay.cpp -o replay
//   ./replay sara.touchline log.csv
//
// The log: a line with names, then per sample time, q, qd, tau and wrenches; "nan": not measured.
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <fstream>
#include <string>
#include <vector>

#include "touchline/touchline.hpp"

template <class T>
void print(const char* what, double time, const T& value) {
  static double numbers[256];
  std::printf("%s %.17g", what, time);
  const double* end = touchline::write_numbers(value, numbers);
  for (const double* x = numbers; x != end; ++x) std::printf(" %.17g", *x);
  std::printf("\n");
}

int main(int argc, char** argv) try {
  if (argc != 3) return std::fprintf(stderr, "usage: %s ROBOT LOG\n", argv[0]), 2;
  touchline::RedundantPipeline pipeline(touchline::read_robot(argv[1]));
  const std::size_t n = pipeline.robot().joints.size(), k = pipeline.robot().sensors.size();
  std::ifstream log(argv[2]);
  std::string line;
  std::getline(log, line);  // names
  double time = 0.0;
  while (std::getline(log, line)) {
    std::vector<double> x;
    for (char *at = line.data(), *end = at; *at != '\0'; at = end + (*end == ',')) {
      x.push_back(std::strtod(at, &end));
      if (end == at) break;
    }
    if (x.size() != 1 + 3 * n + 6 * k) return std::fprintf(stderr, "%s: %s\n", argv[2], line.c_str()), 2;
    const double *q = x.data() + 1, *qd = q + n, *tau = qd + n;
    time = x[0];
    const touchline::Result result = pipeline.update({time, q, qd, tau, tau + n});
    for (const touchline::Contact& contact : result.contacts) print("contact", time, contact);
    for (const touchline::EventChange& change : result.events) {
      if (change.happened == touchline::Happened::ended) print("event", time, change.event);
    }
  }
  pipeline.visit_lasting([&](const touchline::Event& event) { print("event", time, event); });
  return 0;
} catch (const std::exception& error) {
  return std::fprintf(stderr, "%s\n", error.what()), 1;
}
