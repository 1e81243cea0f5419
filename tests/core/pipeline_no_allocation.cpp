// SPDX-License-Identifier: Apache-2.0
// An exported robot follows a log, sample by sample and in parts of several sizes. Prints for each
// way: allocations after construction, contacts, events that ended, and a checksum of all that was
// said, which tells every bit.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <string>
#include <vector>

#include "touchline/touchline.hpp"

extern long allocations;  // counting.cpp

namespace {

using namespace touchline;

struct Log {
  std::vector<double> time, q, qd, tau, wrench;
};

Log read_log(const char* path, std::size_t n, std::size_t k) {
  Log log;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    char* at = line.data();
    const auto take = [&at](std::vector<double>& to, std::size_t count) {
      for (std::size_t i = 0; i < count; ++i) {
        to.push_back(std::strtod(at, &at));
        if (*at == ',') ++at;
      }
    };
    take(log.time, 1), take(log.q, n), take(log.qd, n), take(log.tau, n), take(log.wrench, 6 * k);
  }
  return log;
}

struct Said {
  std::size_t contacts = 0, ended = 0;
  std::uint64_t sum = 1469598103934665603u;
  double numbers[512];

  void add(const double* begin, const double* end) {
    const char *from = reinterpret_cast<const char*>(begin), *to = reinterpret_cast<const char*>(end);
    sum ^= robot_file::checksum(from, to) + 0x9e3779b97f4a7c15u + (sum << 6) + (sum >> 2);
  }
  void take(const Result& result) {
    const Span<double> row = result.estimate.row();
    add(row.begin(), row.end());
    add(result.normalized.begin(), result.normalized.end());
    add(result.drift.begin(), result.drift.end());
    for (const Reset& reset : result.resets) {
      numbers[0] = reset.count;
      add(numbers, std::copy_n(reset.jump, 6, numbers + 1));
    }
    for (const Contact& contact : result.contacts) add(numbers, write_numbers(contact, numbers));
    for (const EventChange& change : result.events) {
      add(numbers, write_numbers(change.event, numbers));
      ended += change.happened == Happened::ended;
    }
    contacts += result.contacts.size();
  }
};

}  // namespace

int main(int, char** arguments) {
  const Robot robot = read_robot(arguments[1]);
  const std::size_t n = robot.joints.size(), k = robot.sensors.size();
  const Log log = read_log(arguments[2], n, k);
  const std::size_t count = log.time.size();
  if (allocations == 0) return std::fprintf(stderr, "nothing is counted\n"), 1;
  for (const std::size_t part : {std::size_t{0}, std::size_t{1}, std::size_t{7}, count}) {
    RedundantPipeline pipeline(robot);
    std::vector<double> rows(count * pipeline.row_layout().width());
    Said said;
    const long before = allocations;
    for (std::size_t i = 0; i < count; i += part > 0 ? part : 1) {
      const Sample first{log.time[i], &log.q[i * n], &log.qd[i * n], &log.tau[i * n],
                         &log.wrench[6 * i * k]};
      if (part == 0) {
        said.take(pipeline.update(first));
      } else {
        pipeline.run(std::min(part, count - i), &log.time[i], first, rows.data(),
                     [&said](const Result& result) { said.take(result); });
      }
    }
    pipeline.visit_lasting([&said](const Event& event) {
      said.add(said.numbers, write_numbers(event, said.numbers));
    });
    const long counted = allocations - before;
    std::printf("%ld %zu %zu %llu\n", counted, said.contacts, said.ended,
                static_cast<unsigned long long>(said.sum));
  }
  return 0;
}
