#pragma once
#include <Eigen/Core>  // first: its includes declare posix_memalign once more, which clang refuses after a definition
#include <catch2/catch.hpp>
#include <cerrno>
#include <cstdlib>

/// Counts what a test program takes from the heap: malloc and its kin, which operator new and Eigen come down to. They
/// are replaced in the whole program, so include this in exactly one source file of it.

#if defined(__GLIBC__) && !defined(HAMELIN_SANITIZED)  // sanitizers bring a heap of their own
#define HAMELIN_COUNTS_ALLOCATIONS 1
#else
#define HAMELIN_COUNTS_ALLOCATIONS 0
#endif

namespace hamelin::test {

inline thread_local long allocation_count = 0;

/// Allocations made by f() on this thread.
template <class F>
long allocations_in(F&& f) {
  const long before = allocation_count;
  f();
  return allocation_count - before;
}

/// Whether allocations are counted in this build; where they are not, the test at hand says that it was skipped.
inline bool counts_allocations() {
  if (HAMELIN_COUNTS_ALLOCATIONS == 0) WARN("skipped: this build does not count allocations");
  return HAMELIN_COUNTS_ALLOCATIONS != 0;
}

}  // namespace hamelin::test

#if HAMELIN_COUNTS_ALLOCATIONS

// The C library's own heap under its second names. Visible, so that shared libraries and plugins are counted as well;
// memory goes back by the library's free(), which is the same for all of them.
#define HAMELIN_COUNTED extern "C" [[gnu::visibility("default")]]
extern "C" {
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);
}

HAMELIN_COUNTED void* malloc(std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  return __libc_malloc(size);
}
HAMELIN_COUNTED void* calloc(std::size_t count, std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  return __libc_calloc(count, size);
}
HAMELIN_COUNTED void* realloc(void* p, std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  return __libc_realloc(p, size);
}
HAMELIN_COUNTED void* memalign(std::size_t alignment, std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  return __libc_memalign(alignment, size);
}
HAMELIN_COUNTED void* aligned_alloc(std::size_t alignment, std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  return __libc_memalign(alignment, size);
}
HAMELIN_COUNTED int posix_memalign(void** p, std::size_t alignment, std::size_t size) noexcept {
  ++hamelin::test::allocation_count;
  void* const made = __libc_memalign(alignment, size);
  if (made == nullptr) return ENOMEM;
  *p = made;
  return 0;
}
#undef HAMELIN_COUNTED

#endif
