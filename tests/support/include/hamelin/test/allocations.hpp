#pragma once
#include "hamelin/core/allocation_count.hpp"
#include "hamelin/test/skip.hpp"

namespace hamelin::test {

/// Allocations made by f() on this thread.
template <class F>
long allocations_in(F&& f) {
  const long before = allocation_count();
  f();
  return allocation_count() - before;
}

using hamelin::counts_allocations;  // for a test of which this is a small part

/// Skips the test if allocations are not counted in this build.
inline void require_allocation_count() {
  skip_unless(counts_allocations(), "this build does not count allocations");
}

}  // namespace hamelin::test
