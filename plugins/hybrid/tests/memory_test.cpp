#include "../src/memory.hpp"

#include <catch2/catch.hpp>

#include "../src/stall.hpp"
#include "fixture.hpp"

using namespace hamelin;
using Eigen::Vector4d;
using Eigen::VectorXd;
using hybrid::EscapeMemory;
using hybrid::StallDetector;

namespace {

const auto no_distance = [](const VectorXd&) { return 0.0; };
const auto all_clear = [](const VectorXd&) { return true; };

test::Task limited(std::uint64_t seed) {
  auto task = test::joint_task(VectorXd::Zero(4));
  task.joint_limit = 2.0;
  task.seed = seed;
  return task;
}

}  // namespace

TEST_CASE("way-points are far from earlier stalls and earlier way-points", "[hybrid][memory]") {
  // The seed fixes the candidates, so only the memory makes a difference.
  test::Scene scene(limited(7));
  EscapeMemory memory(scene.setup, scene.box, 60);
  std::vector<VectorXd> visited;
  double nearest = 1e9;
  for (int i = 0; i < 12; ++i) {
    const VectorXd stall = VectorXd::Constant(4, 0.02 * i);
    memory.next(stall, no_distance, all_clear);
    visited.push_back(stall);
    for (const auto& q : visited) nearest = std::min(nearest, (memory.via() - q).norm());
    visited.push_back(memory.via());
  }
  CHECK(memory.count() == 12);
  CHECK(nearest > 1.0);
}

TEST_CASE("way-points nearer to the goal are preferred", "[hybrid][memory]") {
  const VectorXd goal = Vector4d(1.5, 1.5, -1.5, 0.0);
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    test::Scene scene(limited(seed));
    EscapeMemory drawn(scene.setup, scene.box, 60), blind(scene.setup, scene.box, 60);
    const auto distance = [&](const VectorXd& q) { return (q - goal).norm(); };
    drawn.next(VectorXd::Zero(4), distance, all_clear);
    blind.next(VectorXd::Zero(4), no_distance, all_clear);
    with += distance(drawn.via());
    without += distance(blind.via());
  }
  CHECK(with < 0.7 * without);
}

TEST_CASE("a way-point is clear if one of the best is, and within the limits", "[hybrid][memory]") {
  test::Scene scene(limited(3));
  EscapeMemory memory(scene.setup, scene.box, 60);
  int checked = 0;
  memory.next(VectorXd::Zero(4), no_distance, [&](const VectorXd&) { return ++checked == 3; });
  CHECK(checked == 3);
  CHECK(memory.via().lpNorm<Eigen::Infinity>() <= 2.0);

  // If none is clear, only the best few are checked and the best is taken.
  EscapeMemory other(scene.setup, scene.box, 60), reference(scene.setup, scene.box, 60);
  checked = 0;
  other.next(VectorXd::Zero(4), no_distance, [&](const VectorXd&) { return ++checked < 0; });
  CHECK(checked == 8);
  reference.next(VectorXd::Zero(4), no_distance, all_clear);
  CHECK(other.via() == reference.via());
}

TEST_CASE("the seed decides the way-points", "[hybrid][memory]") {
  const auto vias = [](std::uint64_t seed) {
    test::Scene scene(limited(seed));
    EscapeMemory memory(scene.setup, scene.box, 4);
    Eigen::MatrixXd all(4, 20);  // more than it remembers
    for (int i = 0; i < 20; ++i) {
      memory.next(VectorXd::Constant(4, 0.1 * i), no_distance, all_clear);
      all.col(i) = memory.via();
    }
    return all;
  };
  CHECK(vias(5) == vias(5));
  CHECK(vias(5) != vias(6));
}

TEST_CASE("a restart forgets all stalls", "[hybrid][memory]") {
  test::Scene scene(limited(3));
  EscapeMemory memory(scene.setup, scene.box, 60);
  memory.next(VectorXd::Zero(4), no_distance, all_clear);
  memory.restart();
  CHECK(memory.count() == 0);
}

// ---- stalls

namespace {

constexpr double tick = 0.01, slow = 0.1, fast = 1.0, fast_law = 10.0;

/// The time at which a detector reports a stall, with constant arguments except for the distance;
/// −1 without a stall.
template <class Distance>
double stall_time(Distance&& distance, double speed, double closing_speed, bool held_back,
                  double until_s = 20.0) {
  StallDetector detector(0.3);
  detector.restart(0.0);
  for (int i = 0; i * tick <= until_s; ++i)
    if (detector.stalled(i * tick, distance(i * tick), speed, closing_speed, held_back))
      return i * tick;
  return -1.0;
}
const auto constant = [](double) { return 1.0; };

}  // namespace

TEST_CASE("a slow arm that is held back stalls after the short time", "[hybrid][stall]") {
  CHECK(stall_time(constant, slow, fast_law, true) == Approx(0.3).margin(1.5 * tick));
}

TEST_CASE("an arm that is not held back, or moves fast, stalls after the long time",
          "[hybrid][stall]") {
  CHECK(stall_time(constant, slow, fast_law, false) == Approx(1.5).margin(1.5 * tick));
  CHECK(stall_time(constant, fast, fast_law, true) == Approx(1.5).margin(1.5 * tick));
}

TEST_CASE("an arm that makes progress does not stall", "[hybrid][stall]") {
  CHECK(stall_time([](double t) { return 10.0 - 0.1 * t; }, slow, fast_law, true) == -1.0);
  // Too little progress does not count.
  CHECK(stall_time([](double t) { return 10.0 - 0.01 * t; }, slow, fast_law, true) > 0.0);
  // Oscillation does not count.
  CHECK(stall_time([](double t) { return 1.0 + 0.5 * std::sin(20.0 * t); }, fast, fast_law, false) >
        1.5);
  CHECK(stall_time([](double t) { return 1.0 + 0.5 * std::sin(20.0 * t); }, fast, fast_law, false) <
        2.0);
}

TEST_CASE("a slow law extends the times", "[hybrid][stall]") {
  // 0.01 at 0.05/s takes 0.2 s, three times that is added.
  CHECK(stall_time(constant, slow, 0.05, true) == Approx(0.3 + 0.6).margin(1.5 * tick));
  CHECK(stall_time(constant, slow, 0.05, false) == Approx(1.5 + 0.6).margin(1.5 * tick));
  // The extension is limited.
  CHECK(stall_time(constant, slow, 0.0, true) == Approx(0.3 + 8.0).margin(1.5 * tick));
  CHECK(stall_time(constant, slow, 0.0, false) == Approx(1.5 + 8.0).margin(1.5 * tick));
}

TEST_CASE("a restarted detector starts again with a new best", "[hybrid][stall]") {
  StallDetector detector(0.3);
  detector.restart(0.0);
  CHECK_FALSE(detector.stalled(0.0, 1.0, slow, fast_law, true));
  CHECK(detector.stalled(0.4, 1.0, slow, fast_law, true));
  detector.restart(0.4);
  CHECK_FALSE(detector.stalled(0.5, 5.0, slow, fast_law, true));
  CHECK_FALSE(detector.stalled(0.75, 5.0, slow, fast_law, true));
  CHECK(detector.stalled(0.85, 5.0, slow, fast_law, true));
}
