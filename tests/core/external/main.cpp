// SPDX-License-Identifier: Apache-2.0
// A program of a user: which version, and the joints of an exported robot.
#include <cstdio>
#include <touchline/touchline.hpp>

int main(int, char** arguments) {
  const touchline::Pipeline pipeline(touchline::read_robot(arguments[1]));
  std::printf("%s %zu\n", touchline::kVersion, pipeline.robot().joints.size());
}
