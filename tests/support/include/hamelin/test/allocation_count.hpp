#pragma once
#include <catch2/catch.hpp>

/// The count of heap allocations. One source file of the program includes allocations.hpp, which
/// makes them counted; any number of files may include this one.

#if defined(__GLIBC__) && !defined(HAMELIN_SANITIZED)  // sanitizers replace the heap
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

/// Whether allocations are counted in this build; if not, it warns that the test is skipped.
inline bool counts_allocations() {
  if (HAMELIN_COUNTS_ALLOCATIONS == 0) WARN("skipped: this build does not count allocations");
  return HAMELIN_COUNTS_ALLOCATIONS != 0;
}

}  // namespace hamelin::test
