#pragma once
#include <string>

namespace hamelin::test {

/// Ends the test in progress, which CTest then counts as skipped, or as failed if one of its
/// assertions failed before. All tests that cannot run here end by this function, so that none of
/// them counts as passed. `tests/may_skip.txt` lists the tests that may do so.
/// @param reason why the test cannot run, e.g. "this build is without Ipopt"
[[noreturn]] void skip(const std::string& reason);

/// Skips the rest of the test unless a condition holds.
inline void skip_unless(bool condition, const std::string& reason) {
  if (!condition) skip(reason);
}

}  // namespace hamelin::test
