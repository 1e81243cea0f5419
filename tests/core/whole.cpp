// SPDX-License-Identifier: Apache-2.0
// The programs that hold a whole pipeline, as one: what they share is most of their code, and is
// compiled once. The first argument names the program. The example stands first: it must include all
// that it needs.
#define main replay
#include "../../core/example/replay.cpp"
#undef main

// `counting.cpp` is linked with those that count.
long allocations = 0;

#define main broadcaster
#include "broadcaster.cpp"
#undef main
#define main known_fit
#include "known_fit.cpp"
#undef main
#define main pipeline_no_allocation
#include "pipeline_no_allocation.cpp"
#undef main
#define main robot_file_damaged
#include "robot_file.cpp"
#undef main

int main(int count, char** arguments) {
  const std::string name = count > 1 ? arguments[1] : "";
  --count, ++arguments;  // as if it were called by its own name
  if (name == "replay") return replay(count, arguments);
  if (name == "broadcaster") return broadcaster(count, arguments);
  if (name == "known_fit") return known_fit(count, arguments);
  if (name == "pipeline_no_allocation") return pipeline_no_allocation(count, arguments);
  if (name == "robot_file") return robot_file_damaged(count, arguments);
  return std::fprintf(stderr, "no program is called '%s'\n", name.c_str()), 2;
}
