// SPDX-License-Identifier: Apache-2.0
// Counts what is allocated; sanitizers see no difference between `new` and `malloc` then.
#include <cstdlib>
#include <new>

extern long allocations;

void* operator new(std::size_t size) {
  ++allocations;
  if (void* p = std::malloc(size)) return p;
  throw std::bad_alloc();
}
void operator delete(void* p) noexcept { std::free(p); }
void operator delete(void* p, std::size_t) noexcept { std::free(p); }
