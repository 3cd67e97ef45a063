#pragma once
/// Counts calls of operator new in this program. Include in exactly one source file of a test program.
#include <cstdlib>
#include <new>

namespace hamelin::test {
inline thread_local long allocation_count = 0;

/// Allocations made by f() on this thread.
template <class F>
long allocations_in(F&& f) {
  const long before = allocation_count;
  f();
  return allocation_count - before;
}
}  // namespace hamelin::test

#ifndef HAMELIN_SANITIZED  // sanitizers bring their own operator new
// noinline: GCC 12 otherwise takes the malloc inside for a mismatch with delete
[[gnu::noinline]] void* operator new(std::size_t size) {
  ++hamelin::test::allocation_count;
  if (void* p = std::malloc(size)) return p;
  throw std::bad_alloc();
}
[[gnu::noinline]] void operator delete(void* p) noexcept {
  std::free(p);
}
[[gnu::noinline]] void operator delete(void* p, std::size_t) noexcept {
  std::free(p);
}
#endif
