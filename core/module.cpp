// SPDX-License-Identifier: Apache-2.0
// The module `touchline._core`. It takes the build of the core that fits the processor.
#include <nanobind/nanobind.h>

#include <cstdlib>
#include <cstring>

namespace touchline::bindings {
void bind(nanobind::module_& m);
}
#if defined(TOUCHLINE_AVX2)
namespace touchline_avx2::bindings {
void bind(nanobind::module_& m);
}
#endif

namespace {

// With TOUCHLINE_INSTRUCTIONS=baseline in the environment every processor counts as the oldest.
bool avx2() {
#if defined(TOUCHLINE_AVX2)
  const char* wanted = std::getenv("TOUCHLINE_INSTRUCTIONS");
  return __builtin_cpu_supports("avx2") && !(wanted && std::strcmp(wanted, "baseline") == 0);
#else
  return false;
#endif
}

}  // namespace

NB_MODULE(_core, m) {
  m.attr("INSTRUCTIONS") = avx2() ? "avx2" : "baseline";
#if defined(TOUCHLINE_AVX2)
  if (avx2()) return touchline_avx2::bindings::bind(m);
#endif
  touchline::bindings::bind(m);
}
