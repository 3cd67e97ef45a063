#pragma once
// Eigen comes first: its includes declare posix_memalign again, which clang refuses after the
// definition below.
#include <Eigen/Core>
#include <cerrno>
#include <cstdlib>

#include "hamelin/test/allocation_count.hpp"

/// Counts the heap allocations of a test program: calls of malloc and related functions, which
/// operator new and Eigen use. This header replaces them in the whole program, so include it in
/// exactly one source file.

#if HAMELIN_COUNTS_ALLOCATIONS

// The replacements call the C library's heap by its internal names. They are visible, so that
// allocations of shared libraries and plugins are counted too. free() stays that of the C library.
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
  void* const memory = __libc_memalign(alignment, size);
  if (memory == nullptr) return ENOMEM;
  *p = memory;
  return 0;
}
#undef HAMELIN_COUNTED

#endif
