#include <catch2/catch.hpp>

#include "hamelin/identification/identify.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/readme.hpp"
#include "motions.hpp"

using namespace hamelin;

TEST_CASE("the README's example identifies an arm", "[identification][unit]") {
  const model::Model truth(test::with_friction(model::make_chain({3, "x,z,x"}), 0.5, 0.3));
  const model::Model arm(test::wrong_prior(truth.robot(), 0.3));
  const test::Recording recording{.duration_s = 8.0, .period_s = 2e-3, .q_noise = 1e-4};
  const identification::Record record =
      test::simulated_record(truth, test::SineMotion(truth, 1), recording);
  const identification::Record other =
      test::simulated_record(truth, test::SineMotion(truth, 2), recording);
  // clang-format off
  // [example]
const auto found = identification::identify(arm, record, {});  // arm: a model::Model
const double known_motion = found.held_out.all.share;          // of the torques, 0.01 is 1 %
const auto errors = identification::test(arm, found, other, {});
const model::Model identified(found.robot, arm.base(), arm.gravity());
  // [example]
  // clang-format on
  CHECK(known_motion <= 0.02);
  CHECK(errors.all.share <= 0.02);
  CHECK(identified.robot().links[1].joint.damping > 0.0);
  test::check_readme_example("libs/identification");
}
