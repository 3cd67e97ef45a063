#include <catch2/catch.hpp>

#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example writes a robot and reads it back", "[description][unit]") {
  // clang-format off
  // [example]
model::ChainOptions options;
options.links = 3;
const model::Robot chain = model::make_chain(options);
const Json document = description::robot_to_json(chain);
const model::Robot same = description::robot_from_json(document, "chain.json");
  // [example]
  // clang-format on
  CHECK(document["links"].size() == 3);
  CHECK(description::robot_to_json(same) == document);
  test::check_readme_example("libs/description");
}
