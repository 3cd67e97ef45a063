#include <catch2/catch.hpp>

#include "hamelin/log/read_log.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/readme.hpp"

using namespace hamelin;

TEST_CASE("the README's example runs a second and logs every hundredth step",
          "[simulation][unit]") {
  const auto file = std::filesystem::path(HAMELIN_TEST_BINARY_DIR) / "simulation_readme.jsonl";
  std::filesystem::remove(file);
  // clang-format off
  // [example]
const model::Model arm(model::make_chain({}));  // seven links of 0.2 m, gravity along -z
simulation::FreeMotion motion;
motion.name = "falling chain";
motion.q0 = Eigen::VectorXd::Constant(7, 0.3);
motion.v0 = Eigen::VectorXd::Zero(7);
motion.duration_s = 1.0;
log::RunLog log(file);
simulation::Watch watch;
watch.log = &log;
watch.every = 100;
const log::Result result = simulation::integrate(arm, motion, watch);
  // [example]
  // clang-format on
  CHECK(result.outcome == log::Outcome::completed);
  CHECK(result.steps == 1000);
  CHECK(result.energy_error_max_J < 0.1);
  const auto summary = log::check_log(file);
  CHECK(summary.ticks == 11);
  CHECK(summary.has_result);
  test::check_readme_example("libs/simulation");
}
