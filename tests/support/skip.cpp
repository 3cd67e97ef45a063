#define CATCH_CONFIG_EXTERNAL_INTERFACES  // for listeners
#include "hamelin/test/skip.hpp"

#include <catch2/catch.hpp>
#include <iostream>

namespace hamelin::test {

namespace {

// Why the test in progress was skipped; empty if it was not.
std::string& reason_of_skip() {
  static std::string reason;
  return reason;
}

// Catch2 2 cannot skip tests. CTest counts a test as skipped that prints this line, also if it
// failed. Therefore it is printed at the end of a test, and only if all its assertions held.
struct SkipReporter final : Catch::TestEventListenerBase {
  using TestEventListenerBase::TestEventListenerBase;

  void testCaseStarting(const Catch::TestCaseInfo& info) override {
    TestEventListenerBase::testCaseStarting(info);
    reason_of_skip().clear();
  }
  void testCaseEnded(const Catch::TestCaseStats& stats) override {
    TestEventListenerBase::testCaseEnded(stats);
    if (!reason_of_skip().empty() && stats.totals.assertions.failed == 0)
      std::cout << "test skipped: " << reason_of_skip() << std::endl;
  }
};
CATCH_REGISTER_LISTENER(SkipReporter)

}  // namespace

void skip(const std::string& reason) {
  reason_of_skip() = reason;
  // This is how REQUIRE ends a test; without a failed assertion, the test has not failed.
  throw Catch::TestFailureException();
}

}  // namespace hamelin::test
