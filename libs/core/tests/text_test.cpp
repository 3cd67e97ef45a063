#include "hamelin/core/text.hpp"

#include <catch2/catch.hpp>

using namespace hamelin;

TEST_CASE("utf8_prefix ends at the first byte that is not UTF-8", "[core][unit]") {
  CHECK(utf8_prefix("") == 0);
  CHECK(utf8_prefix("plain") == 5);
  CHECK(utf8_prefix("é€😀") == 9);
  CHECK(utf8_prefix("ab\xe9 cd") == 2);          // Latin-1
  CHECK(utf8_prefix("\xc0\xaf") == 0);           // overlong
  CHECK(utf8_prefix("\xe0\x80\xaf") == 0);       // overlong
  CHECK(utf8_prefix("\xed\xa0\x80") == 0);       // half of a surrogate pair
  CHECK(utf8_prefix("a\xf4\x90\x80\x80") == 1);  // beyond U+10FFFF
  CHECK(utf8_prefix("a\xf0\x9f\x98") == 1);      // cut
}

TEST_CASE("the nearest name is one within a third of its letters, or none", "[core][unit]") {
  const std::vector<std::string> names{"duration_s", "step_s", "seed"};
  CHECK(nearest_name("duraton_s", names) == "duration_s");
  CHECK(nearest_name("sdee", {"sxex", "step_s"}).empty());  // two changes in four letters
  CHECK(nearest_name("sed", names) == "seed");
  CHECK(nearest_name("gravity", names).empty());
  CHECK(nearest_name("step_s", names) == "step_s");
  CHECK(nearest_name("", names).empty());
  CHECK(nearest_name("x", {}).empty());
}

TEST_CASE("two swapped neighbours count as one edit, and capitals as none", "[core][unit]") {
  CHECK(nearest_name("sede", {"seed", "step_s"}) == "seed");
  CHECK(nearest_name("rnu", {"run", "robot"}) == "run");
  // One edit from two names: the first is taken.
  CHECK(nearest_name("--setp", {"--set", "--step", "--seed"}) == "--set");
  CHECK(nearest_name("RK4", {"hamel", "rk4"}) == "rk4");
  CHECK(nearest_name("abcd", {"badc"}).empty());  // two swaps in four letters
}

TEST_CASE("a name that shares less than half of its letters is not near", "[core][unit]") {
  CHECK(nearest_name("x", {"y"}).empty());
  CHECK(nearest_name("q0", {"v0"}).empty());
  CHECK(nearest_name("a", {"ab"}).empty());
  CHECK(nearest_name("rn", {"run"}) == "run");
  // Too long to be typed by hand.
  CHECK(nearest_name(std::string(100000, 'x'), {"x", std::string(100000, 'x')}).empty());
}

TEST_CASE("an error message ends with the nearest name, if there is one", "[core][unit]") {
  CHECK(did_you_mean("sede", {"seed", "step_s"}) == "; did you mean 'seed'?");
  CHECK(did_you_mean("gravity", {"seed", "step_s"}).empty());
}

TEST_CASE("the names of a list keep its order", "[core][unit]") {
  struct Named {
    std::string name;
  };
  CHECK(names_of(std::vector<Named>{{"b"}, {"a"}}) == std::vector<std::string>{"b", "a"});
  CHECK(names_of(std::vector<Named>{}).empty());
}
