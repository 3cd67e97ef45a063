#include "hamelin/core/allocation_count.hpp"

#include <cerrno>
#include <cstddef>
#include <cstdlib>

#if defined(__GLIBC__) && !defined(HAMELIN_SANITIZED)
#define HAMELIN_COUNTS_ALLOCATIONS 1
#else
#define HAMELIN_COUNTS_ALLOCATIONS 0
#endif

namespace {

thread_local long count_of_thread = 0;

}  // namespace

namespace hamelin {

long allocation_count() noexcept {
  return count_of_thread;
}

bool counts_allocations() noexcept {
  return HAMELIN_COUNTS_ALLOCATIONS != 0;
}

}  // namespace hamelin

#if HAMELIN_COUNTS_ALLOCATIONS

// The program's own definitions replace those of the C library, which does the work under its
// internal names. They are visible, so that shared libraries and plugins use them too. free() stays
// that of the C library.
#define HAMELIN_COUNTED extern "C" [[gnu::visibility("default")]]
// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): names of the C library
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

HAMELIN_COUNTED void* malloc(std::size_t size) noexcept {
  ++count_of_thread;
  return __libc_malloc(size);
}
HAMELIN_COUNTED void* calloc(std::size_t count, std::size_t size) noexcept {
  ++count_of_thread;
  return __libc_calloc(count, size);
}
HAMELIN_COUNTED void* realloc(void* p, std::size_t size) noexcept {
  ++count_of_thread;
  return __libc_realloc(p, size);
}
HAMELIN_COUNTED void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++count_of_thread;
  return __libc_memalign(alignment, size);
}
HAMELIN_COUNTED void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++count_of_thread;
  return __libc_memalign(alignment, size);
}
HAMELIN_COUNTED int posix_memalign(void** p, std::size_t alignment, std::size_t size) noexcept {
  ++count_of_thread;
  void* const memory = __libc_memalign(alignment, size);
  if (memory == nullptr) return ENOMEM;
  *p = memory;
  return 0;
}
#undef HAMELIN_COUNTED

#endif
