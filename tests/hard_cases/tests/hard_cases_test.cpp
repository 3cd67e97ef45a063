#include <catch2/catch.hpp>

#include "cases.hpp"

using namespace hamelin;
using namespace hamelin::hard_cases;

// Bounds are the figures of docs/hard_cases.md with some room for another machine's rounding, and the motion itself, by
// another scheme. What other libraries test of the hard cases is named there too.
namespace {

/// Complete, or ended at a step without a root; never with a state that is no number.
Outcome sound(const Motion& motion, const std::string& scheme) {
  const Outcome outcome = run(motion, scheme);
  CAPTURE(scheme, outcome.steps, outcome.completed);
  CHECK(outcome.q.allFinite());
  CHECK(std::isfinite(outcome.energy_error_J));
  return outcome;
}

/// By the motion of `duration` that make(step, steps) sets up: the error against the reference is at most `bound` and
/// falls as the square of the step.
template <class F>
void follows(F&& make, double step_s, double duration_s, double bound) {
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
  const Outcome ours = sound(stretched(7, 1e-3, 1000), "hamel-variational");
  REQUIRE(ours.completed);
  CHECK(ours.q.norm() > 0.5);  // it did fall
  CHECK(ours.energy_error_J < 1e-3);
  CHECK(sound(stretched(7, 1e-3, 1000), "hamel").energy_error_J > 100.0 * ours.energy_error_J);
  follows([](double h, long steps) { return stretched(7, h, steps); }, 1e-3, 0.3, 2e-5);
}

TEST_CASE("joints that turn past pi again and again are nothing special", "[hard]") {
  const Outcome ours = sound(turning(1e-3, 10000), "hamel-variational");
  REQUIRE(ours.completed);
  CHECK(ours.q.cwiseAbs().maxCoeff() > 10.0 * M_PI);
  CHECK(ours.energy_error_J < 2e-3);
  CHECK(ours.late_over_early < 1.5);
  // the same motion with each joint a full turn on: only sine and cosine of an angle may count
  Motion again = turning(1e-3, 500);
  const VectorXd here = run(again, "hamel-variational").q;
  again.q0.array() -= 2.0 * M_PI;
  CHECK((run(again, "hamel-variational").q.array() + 2.0 * M_PI - here.array()).abs().maxCoeff() < 1e-9);
  follows(turning, 2.5e-4, 1.0, 1e-4);
}

TEST_CASE("chains of 100 and 200 links take three corrections a step at most, and one factorisation", "[hard]") {
  for (const int links : {100, 200}) {
    CAPTURE(links);
    const Outcome ours = sound(stretched(links, 1e-3, 200), "hamel-variational");
    REQUIRE(ours.completed);
    CHECK(ours.halvings == 0);
    CHECK(ours.updates_max <= 3);
    CHECK(ours.factorizations_mean < 1.2);
    CHECK(ours.energy_error_J < 1e-6 * ours.energy_scale_J);
    follows([&](double h, long steps) { return stretched(links, h, steps); }, 2.5e-4, 0.2, 5e-6);
  }
  CHECK(sound(stretched(200, 1e-3, 200), "hamel").updates_max > 10);
}

TEST_CASE("a link that weighs a million times the others is followed, or the motion ends at a named step", "[hard]") {
  const Outcome first = sound(mass_ratio(0, 1e-3, 1000), "hamel-variational");
  REQUIRE(first.completed);
  CHECK(first.energy_error_J < 1e-4 * first.energy_scale_J);
  follows([](double h, long steps) { return mass_ratio(0, h, steps); }, 1e-3, 0.1, 1e-5);
  // with the tip so heavy the light links whip faster than 1 ms shows; a tenth of it does
  const Outcome tip = sound(mass_ratio(6, 1e-3, 1000), "hamel-variational");
  CHECK(tip.halvings > 0);
  CHECK(tip.energy_error_J < 0.1 * tip.energy_scale_J);  // also where it ended
  follows([](double h, long steps) { return mass_ratio(6, h, steps); }, 2.5e-5, 0.1, 2e-5);
  const Outcome fine = sound(mass_ratio(6, 1e-4, 3000), "hamel-variational");
  REQUIRE(fine.completed);
  CHECK(fine.energy_error_J < 1e-3 * fine.energy_scale_J);
}

TEST_CASE("the grid of steps from 1e-6 to 0.1 s: the error falls as the square of the step where motion is resolved",
          "[hard]") {
  double last = 0.0;
  for (const double h : {1e-2, 1e-3, 1e-4, 1e-5, 1e-6}) {
    CAPTURE(h);
    const Outcome ours = sound(stretched(7, h, std::min(2000L, std::lround(1.0 / h))), "hamel-variational");
    REQUIRE(ours.completed);
    CHECK(ours.halvings == 0);
    if (last > 0.0) CHECK(ours.energy_error_J < 0.02 * last);
    last = ours.energy_error_J;
  }
  const Outcome coarse = sound(stretched(7, 0.1, 10), "hamel-variational");  // not resolved: halved
  REQUIRE(coarse.completed);
  CHECK(coarse.halvings > 0);
  CHECK(coarse.energy_error_J < 2.0);
}

TEST_CASE("a stiff barrier is not tunnelled through where the step resolves it, and keeps the energy", "[hard]") {
  // hits at up to 2.8 J: no deeper than √(2 · 2.8 / stiffness), h ω = 0.06, 0.6
  for (const double stiffness : {1e4, 1e6}) {
    CAPTURE(stiffness);
    const Outcome ours = sound(falling_on_barrier(stiffness, 1e-3, 10000), "hamel-variational");
    REQUIRE(ours.completed);
    CHECK(ours.deepest > 0.0);
    CHECK(ours.deepest < 1.1 * std::sqrt(2.0 * 2.8 / stiffness));
    CHECK(ours.late_over_early < 1.1);  // bounded
    CHECK(ours.energy_error_J < 0.1 * 2.8);
  }
}

TEST_CASE("10^6 steps of example 5.1 keep the energy of the first", "[hard]") {
  const Outcome ours = sound(million_steps(), "hamel-variational");
  REQUIRE(ours.completed);
  CHECK(ours.energy_error_J < 1.8e-4);
  CHECK(ours.late_over_early < 1.01);
  CHECK(ours.halvings == 0);
}
