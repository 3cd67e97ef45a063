#include <atomic>
#include <catch2/catch.hpp>

#include "hamelin/core/error.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/chains.hpp"

using namespace hamelin;
using simulation::FreeMotion;

namespace {

FreeMotion rest(int n, double step_s, double duration_s) {
  FreeMotion motion;
  motion.q0 = motion.v0 = Eigen::VectorXd::Zero(n);
  motion.step_s = step_s;
  motion.duration_s = duration_s;
  return motion;
}

}  // namespace

TEST_CASE("example 5.1 keeps its energy to the published figure", "[simulation][golden]") {
  const model::Model arm(test::planar3());
  const auto result = simulation::integrate(arm, rest(3, 0.01, 100.0), {});
  CHECK(result.outcome == log::Outcome::completed);
  CHECK(result.steps == 10000);
  CHECK(result.energy_error_max_J > 1e-5);
  CHECK(result.energy_error_max_J <= 1.8e-4);
  CHECK(result.solver.steps == 10000);
}

TEST_CASE("damping is booked, so that the energy account still closes", "[simulation][energy]") {
  const model::Model arm(test::planar3());
  auto motion = rest(3, 0.01, 10.0);
  motion.damping = Eigen::VectorXd::Constant(3, 0.5);
  const auto result = simulation::integrate(arm, motion, {});
  CHECK(result.energy_initial_J - result.energy_final_J ==
        Approx(result.dissipated_J).margin(result.energy_error_max_J));
  CHECK(result.dissipated_J > 0.1);
  CHECK(result.energy_error_max_J < 1e-3);
}

TEST_CASE(
    "a duration that is not a multiple of the step, and vectors of the wrong size, are refused",
    "[simulation][input]") {
  const model::Model arm(test::planar3());
  CHECK_THROWS_WITH(simulation::integrate(arm, rest(3, 0.003, 0.01), {}),
                    Catch::Contains("not an integer multiple of the step"));
  CHECK_THROWS_WITH(simulation::integrate(arm, rest(2, 0.001, 0.01), {}),
                    Catch::Contains("q0: 2 values given, expected 3"));
  CHECK_THROWS_AS(simulation::integrate(arm, rest(3, 0.0, 1.0), {}), Error);
  CHECK_THROWS_AS(simulation::integrate(arm, rest(3, 0.001, -1.0), {}), Error);
  // 0.3/0.1 is not 3 in floating point.
  CHECK(simulation::integrate(arm, rest(3, 0.1, 0.3), {}).steps == 3);
}

TEST_CASE("under step control the last step ends exactly at any duration",
          "[simulation][step-control]") {
  const model::Model arm(test::planar3());
  auto motion = rest(3, 0.01, 10.0 + 1.0 / 3.0);
  motion.integrator = "dop853";
  motion.options.rtol = motion.options.atol = 1e-9;
  const auto result = simulation::integrate(arm, motion, {});
  CHECK(result.outcome == log::Outcome::completed);
  CHECK(result.time_s == motion.duration_s);
  CHECK(result.steps == result.solver.steps);
  CHECK(result.steps < 100);
  CHECK(result.solver.evaluations == 12 * result.steps + 11 * result.solver.rejected);
  CHECK(result.energy_error_max_J < 1e-7);
  motion.step_s = 5.0;  // far too long for a first step: rejected
  CHECK(simulation::integrate(arm, motion, {}).solver.rejected > 0);
}

TEST_CASE("an explicit scheme whose state becomes infinite ends as diverged and names the step",
          "[simulation][outcome]") {
  const model::Model arm(test::spatial_chain(7));
  auto motion = rest(7, 0.5, 500.0);
  motion.q0.setConstant(0.3);
  motion.v0.setConstant(1e3);
  motion.integrator = "rk4";
  const auto result = simulation::integrate(arm, motion, {});
  CHECK(result.outcome == log::Outcome::diverged);
  CHECK_THAT(result.cause, Catch::Contains("the state is no longer finite"));
}

TEST_CASE("free motion can be stopped from outside", "[simulation][outcome]") {
  const model::Model arm(test::planar3());
  std::atomic<bool> stop = false;
  simulation::Watch watch;
  watch.stop = &stop;
  watch.progress = [&](double time_s, double) { stop = time_s >= 2.0; };
  const auto result = simulation::integrate(arm, rest(3, 0.001, 10.0), watch);
  CHECK(result.outcome == log::Outcome::interrupted);
  CHECK(result.steps == 2000);
}

TEST_CASE("unknown keys and values of integrator parameters are refused", "[simulation][unit]") {
  CHECK_THROWS_WITH(simulation::integrator_options(Json{{"tolerence", 1e-9}}, "scene.json"),
                    Catch::Contains("tolerance"));
  CHECK_THROWS_AS(simulation::integrator_options(Json{{"alpha", 1.5}}, "scene.json"), Error);
}
