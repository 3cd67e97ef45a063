#include <catch2/catch.hpp>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example names the misspelt key and draws a number", "[core][unit]") {
  // clang-format off
  // [example]
std::string message;
try {
  const std::string key = "stp_s";
  throw Error(ErrorCode::invalid,
              "scene.json: /: unknown key '" + key + "'" + did_you_mean(key, {"step_s", "seed"}));
} catch (const Error& error) {
  message = error.what();  // scene.json: /: unknown key 'stp_s'; did you mean 'step_s'?
}
Rng rng(1);
const double x = rng.uniform(-1.0, 1.0);  // 0.6232243177637695 on every platform
  // [example]
  // clang-format on
  CHECK(message == "scene.json: /: unknown key 'stp_s'; did you mean 'step_s'?");
  CHECK(x == 0.6232243177637695);
  test::check_readme_example("libs/core");
}
