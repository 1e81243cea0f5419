// SPDX-License-Identifier: Apache-2.0
// The same core for processors with AVX2, in a namespace of its own: nothing of it is shared with
// the other. Its numbers are the same.
#define touchline touchline_avx2
#include "bindings.cpp"
