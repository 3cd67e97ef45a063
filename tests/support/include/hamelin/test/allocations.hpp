#pragma once
#include <catch2/catch.hpp>

#include "hamelin/core/allocation_count.hpp"

namespace hamelin::test {

/// Allocations made by f() on this thread.
template <class F>
long allocations_in(F&& f) {
  const long before = allocation_count();
  f();
  return allocation_count() - before;
}

/// Whether allocations are counted in this build; if not, it warns that the test is skipped.
inline bool counts_allocations() {
  if (!hamelin::counts_allocations()) WARN("skipped: this build does not count allocations");
  return hamelin::counts_allocations();
}

}  // namespace hamelin::test
