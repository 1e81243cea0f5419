// SPDX-License-Identifier: Apache-2.0
// Reads every damaged variant of an exported robot: each must be refused with a message, or be a
// robot that a pipeline can be built from. Prints how many were refused by what.
#include <algorithm>
#include <cstdio>
#include <map>
#include <random>
#include <string>
#include <utility>
#include <vector>

#include "touchline/touchline.hpp"

namespace {

using namespace touchline;

std::map<std::string, int> outcomes;

void try_to_read(const std::string& content, bool build) {
  try {
    Robot robot = robot_file::parse(content);
    if (build) RedundantPipeline pipeline(std::move(robot));
    ++outcomes["accepted"];
  } catch (const std::invalid_argument& error) {
    ++outcomes[std::string(error.what()).substr(0, 24)];
  }
}

// With a checksum that fits, so that what stands in it is looked at.
std::string sealed(std::string content) {
  const char* begin = content.data() + robot_file::kHeader;
  robot_file::Writer sum;
  sum.bytes(content.size() - robot_file::kHeader, 8);
  sum.bytes(robot_file::checksum(begin, content.data() + content.size()), 8);
  return content.replace(12, 16, sum.data);
}

}  // namespace

int main(int, char** arguments) {
  Robot robot = read_robot(arguments[1]);
  robot.stand_ins.resize(1);
  for (Robot* of : {&robot, &robot.stand_ins[0].robot}) {
    for (LinkSurface& surface : of->surfaces) {  // a few triangles of each are soon read
      std::vector<Triangle> few = surface.mesh.triangles();
      few.resize(std::min<std::size_t>(few.size(), 6));
      surface.mesh = Mesh(std::move(few));
    }
  }
  const std::string good = robot_bytes(std::move(robot));
  std::mt19937 random(0);
  for (std::size_t size = 0; size < good.size(); size += size < 200 ? 1 : good.size() / 97)
    try_to_read(good.substr(0, size), false);
  for (int i = 0; i < 300; ++i) {  // one bit, which the checksum tells
    std::string bad = good;
    bad[random() % bad.size()] ^= static_cast<char>(1 << random() % 8);
    try_to_read(bad, false);
  }
  for (int i = 0; i < 1000; ++i) {  // some bytes, with a checksum that fits
    std::string bad = good;
    for (int k = 0; k < 3; ++k)
      bad[robot_file::kHeader + random() % (bad.size() - robot_file::kHeader)] =
          static_cast<char>(random());
    try_to_read(sealed(bad), i % 50 == 0);
  }
  for (int i = 0; i < 100; ++i)  // an end that is cut off, with a checksum that fits
    try_to_read(sealed(good.substr(0, robot_file::kHeader + random() % (good.size() / 2))), false);
  for (const auto& [what, count] : outcomes) std::printf("%6d %s\n", count, what.c_str());
  return 0;
}
