#include <catch2/catch.hpp>

#include "cases.hpp"

using namespace hamelin;
using namespace hamelin::hard_cases;

// Bounds are the figures of docs/hard_cases.md, with some room for another machine's rounding, and
// the motion itself by another scheme. docs/hard_cases.md also names the tests of other libraries.
namespace {

/// Runs a motion, which may end at a step without a root, but never with a state that is not
/// finite.
Outcome run_checked(const Motion& motion, const std::string& scheme) {
  const Outcome outcome = run(motion, scheme);
  CAPTURE(scheme, outcome.steps, outcome.completed);
  CHECK(outcome.q.allFinite());
  CHECK(std::isfinite(outcome.energy_error_J));
  return outcome;
}

/// Checks, for the motion of `duration_s` that make(step, steps) sets up, that the error against
/// the reference is at most `bound` and falls as the square of the step.
template <class F>
void check_second_order(F&& make, double step_s, double duration_s, double bound) {
  const long steps = std::lround(duration_s / step_s);
  const Motion coarse = make(step_s, steps), fine = make(0.5 * step_s, 2 * steps);
  const VectorXd truth = reference_end(coarse);
  const auto error = [&](const Motion& motion) {
    const Outcome outcome = run(motion, "hamel-variational");
    return outcome.completed ? (outcome.q - truth).lpNorm<Eigen::Infinity>() : INFINITY;
  };
  const double first = error(coarse), second = error(fine);
  CAPTURE(step_s, duration_s, first, second);
  CHECK((truth - coarse.q0).lpNorm<Eigen::Infinity>() > 1e4 * bound);  // it moves
  CHECK(first < bound);
  CHECK(first / second == Approx(4.0).epsilon(0.03));
}

}  // namespace

TEST_CASE("a stretched arm falls out of its singular pose with its energy", "[hard]") {
  const Outcome variational = run_checked(stretched(7, 1e-3, 1000), "hamel-variational");
  REQUIRE(variational.completed);
  CHECK(variational.q.norm() > 0.5);  // it fell
  CHECK(variational.energy_error_J < 1e-3);
  CHECK(run_checked(stretched(7, 1e-3, 1000), "hamel").energy_error_J >
        100.0 * variational.energy_error_J);
  check_second_order([](double h, long steps) { return stretched(7, h, steps); }, 1e-3, 0.3, 2e-5);
}

TEST_CASE("joints that turn past pi again and again keep their energy", "[hard]") {
  const Outcome variational =
      run_checked(turn_through_half_turns(1e-3, 10000), "hamel-variational");
  REQUIRE(variational.completed);
  CHECK(variational.q.cwiseAbs().maxCoeff() > 10.0 * M_PI);
  CHECK(variational.energy_error_J < 2e-3);
  CHECK(variational.late_over_early < 1.5);
  // The same motion with each joint a full turn further: only sine and cosine of an angle may
  // matter.
  Motion again = turn_through_half_turns(1e-3, 500);
  const VectorXd here = run(again, "hamel-variational").q;
  again.q0.array() -= 2.0 * M_PI;
  CHECK((run(again, "hamel-variational").q.array() + 2.0 * M_PI - here.array()).abs().maxCoeff() <
        1e-9);
  check_second_order(turn_through_half_turns, 2.5e-4, 1.0, 1e-4);
}

TEST_CASE(
    "chains of 100 and 200 links take at most three corrections per step, and one factorisation",
    "[hard]") {
  for (const int links : {100, 200}) {
    CAPTURE(links);
    const Outcome variational = run_checked(stretched(links, 1e-3, 200), "hamel-variational");
    REQUIRE(variational.completed);
    CHECK(variational.halvings == 0);
    CHECK(variational.updates_max <= 3);
    CHECK(variational.factorizations_mean < 1.2);
    CHECK(variational.energy_error_J < 1e-6 * variational.energy_scale_J);
    check_second_order([&](double h, long steps) { return stretched(links, h, steps); }, 2.5e-4,
                       0.2, 5e-6);
  }
  CHECK(run_checked(stretched(200, 1e-3, 200), "hamel").updates_max > 10);
}

TEST_CASE(
    "a link a million times as heavy as the others is integrated, or the motion ends at a step "
    "without a root",
    "[hard]") {
  const Outcome first = run_checked(mass_ratio(0, 1e-3, 1000), "hamel-variational");
  REQUIRE(first.completed);
  CHECK(first.energy_error_J < 1e-4 * first.energy_scale_J);
  check_second_order([](double h, long steps) { return mass_ratio(0, h, steps); }, 1e-3, 0.1, 1e-5);
  // With such a heavy tip the light links move too fast for steps of 1 ms; 0.1 ms resolves the
  // motion.
  const Outcome tip = run_checked(mass_ratio(6, 1e-3, 1000), "hamel-variational");
  CHECK(tip.halvings > 0);
  CHECK(tip.energy_error_J < 0.1 * tip.energy_scale_J);  // up to where it ended
  check_second_order([](double h, long steps) { return mass_ratio(6, h, steps); }, 2.5e-5, 0.1,
                     2e-5);
  const Outcome fine = run_checked(mass_ratio(6, 1e-4, 3000), "hamel-variational");
  REQUIRE(fine.completed);
  CHECK(fine.energy_error_J < 1e-3 * fine.energy_scale_J);
}

TEST_CASE("gauss under step control carries a tip a million times as heavy at ticks of 1 ms",
          "[hard]") {
  const auto options = controlled(1e-9);
  const Outcome tip = run(mass_ratio(6, 1e-3, 1000), "gauss:8", options);
  REQUIRE(tip.completed);
  CHECK(tip.energy_error_J < 1e-5 * tip.energy_scale_J);
  const Motion calm = mass_ratio(6, 1e-3, 400);
  CHECK((run(calm, "gauss:8", options).q - reference_end(calm)).lpNorm<Eigen::Infinity>() < 1e-6);
  // From 0.45 s on the light links whip at up to 2.6e4 rad/s, and only the heavy tip is
  // predictable.
  const Motion whipping = mass_ratio(6, 1e-3, 600);
  dynamics::Workspace ws(whipping.model);
  const auto potential = [&](const VectorXd& q) {
    return dynamics::potential_energy(whipping.model, ws, q);
  };
  CHECK(potential(run(whipping, "gauss:8", options).q) ==
        Approx(potential(reference_end(whipping))).epsilon(1e-3));
}

TEST_CASE(
    "the grid of steps from 1e-6 to 0.1 s: the error falls as the square of the step while motion "
    "is resolved",
    "[hard]") {
  double last = 0.0;
  for (const double h : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
    CAPTURE(h);
    const Outcome variational =
        run_checked(stretched(7, h, std::min(2000L, std::lround(1.0 / h))), "hamel-variational");
    REQUIRE(variational.completed);
    CHECK(variational.halvings == 0);
    if (last > 0.0) CHECK(variational.energy_error_J < 0.02 * last);
    last = variational.energy_error_J;
  }
  // 0.1 s does not resolve the motion: steps are halved.
  const Outcome coarse = run_checked(stretched(7, 0.1, 10), "hamel-variational");
  REQUIRE(coarse.completed);
  CHECK(coarse.halvings > 0);
  CHECK(coarse.energy_error_J < 2.0);
}

TEST_CASE("a stiff barrier that the step resolves is not passed through and keeps the energy",
          "[hard]") {
  // Impacts have up to 2.8 J, so the depth is at most √(2 · 2.8 / stiffness). h ω = 0.06 and 0.6.
  for (const double stiffness : {1e4, 1e6}) {
    CAPTURE(stiffness);
    const Outcome variational =
        run_checked(falling_on_barrier(stiffness, 1e-3, 10000), "hamel-variational");
    REQUIRE(variational.completed);
    CHECK(variational.deepest > 0.0);
    CHECK(variational.deepest < 1.1 * std::sqrt(2.0 * 2.8 / stiffness));
    CHECK(variational.late_over_early < 1.1);  // bounded
    CHECK(variational.energy_error_J < 0.1 * 2.8);
  }
}

TEST_CASE("10^6 steps of example 5.1 keep the initial energy", "[hard]") {
  const Outcome variational = run_checked(million_steps(), "hamel-variational");
  REQUIRE(variational.completed);
  CHECK(variational.energy_error_J < 1.8e-4);
  CHECK(variational.late_over_early < 1.01);
  CHECK(variational.halvings == 0);
}
