#include "../src/memory.hpp"

#include <catch2/catch.hpp>

#include "../src/stall.hpp"
#include "fixture.hpp"

using namespace hamelin;
using Eigen::Vector4d;
using Eigen::VectorXd;
using hybrid::Memory;
using hybrid::StallWatch;

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

TEST_CASE("way-points keep away from where the arm stalled and where it was sent", "[hybrid][memory]") {
  // with the same seed the candidates are the same; what is remembered makes the difference
  test::Scene scene(limited(7));
  Memory memory(scene.setup, scene.box, 60);
  std::vector<VectorXd> seen;
  double nearest = 1e9;
  for (int i = 0; i < 12; ++i) {
    const VectorXd stall = VectorXd::Constant(4, 0.02 * i);
    memory.next(stall, no_distance, all_clear);
    seen.push_back(stall);
    for (const auto& q : seen) nearest = std::min(nearest, (memory.via() - q).norm());
    seen.push_back(memory.via());
  }
  CHECK(memory.count() == 12);
  CHECK(nearest > 1.0);
}

TEST_CASE("among way-points equally far from what is known the one nearer to the goal is taken", "[hybrid][memory]") {
  const VectorXd goal = Vector4d(1.5, 1.5, -1.5, 0.0);
  double with = 0.0, without = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    test::Scene scene(limited(seed));
    Memory drawn(scene.setup, scene.box, 60), blind(scene.setup, scene.box, 60);
    const auto distance = [&](const VectorXd& q) { return (q - goal).norm(); };
    drawn.next(VectorXd::Zero(4), distance, all_clear);
    blind.next(VectorXd::Zero(4), no_distance, all_clear);
    with += distance(drawn.via());
    without += distance(blind.via());
  }
  CHECK(with < 0.7 * without);
}

TEST_CASE("way-points stand clear where one of the best does, and within the limits", "[hybrid][memory]") {
  test::Scene scene(limited(3));
  Memory memory(scene.setup, scene.box, 60);
  int asked = 0;
  memory.next(VectorXd::Zero(4), no_distance, [&](const VectorXd&) { return ++asked == 3; });
  CHECK(asked == 3);
  CHECK(memory.via().lpNorm<Eigen::Infinity>() <= 2.0);

  // none is clear: it asks no more than the best few, and takes the best
  Memory other(scene.setup, scene.box, 60), unasked(scene.setup, scene.box, 60);
  asked = 0;
  other.next(VectorXd::Zero(4), no_distance, [&](const VectorXd&) { return ++asked < 0; });
  CHECK(asked == 8);
  unasked.next(VectorXd::Zero(4), no_distance, all_clear);
  CHECK(other.via() == unasked.via());
}

TEST_CASE("the seed decides the way-points", "[hybrid][memory]") {
  const auto vias = [](std::uint64_t seed) {
    test::Scene scene(limited(seed));
    Memory memory(scene.setup, scene.box, 4);
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

TEST_CASE("at a new goal stalls are forgotten", "[hybrid][memory]") {
  test::Scene scene(limited(3));
  Memory memory(scene.setup, scene.box, 60);
  memory.next(VectorXd::Zero(4), no_distance, all_clear);
  memory.restart();
  CHECK(memory.count() == 0);
}

// ---- stalls

namespace {

constexpr double tick = 0.01, slow = 0.1, quick = 1.0, fast_law = 10.0;

/// When a watch that sees the same each tick, but a distance of its own, says that the arm stalled; −1 if it does not.
template <class Distance>
double stalls_at(Distance&& distance, double speed, double wanted, bool held, double until_s = 20.0) {
  StallWatch watch(0.3);
  watch.restart(0.0);
  for (int i = 0; i * tick <= until_s; ++i)
    if (watch.stalled(i * tick, distance(i * tick), speed, wanted, held)) return i * tick;
  return -1.0;
}
const auto stands = [](double) { return 1.0; };

}  // namespace

TEST_CASE("an arm that is slow and held back stalls after the short time", "[hybrid][stall]") {
  CHECK(stalls_at(stands, slow, fast_law, true) == Approx(0.3).margin(1.5 * tick));
}

TEST_CASE("an arm that is not held back, or moves, stalls after the long time", "[hybrid][stall]") {
  CHECK(stalls_at(stands, slow, fast_law, false) == Approx(1.5).margin(1.5 * tick));
  CHECK(stalls_at(stands, quick, fast_law, true) == Approx(1.5).margin(1.5 * tick));
}

TEST_CASE("an arm that makes progress does not stall", "[hybrid][stall]") {
  CHECK(stalls_at([](double t) { return 10.0 - 0.1 * t; }, slow, fast_law, true) == -1.0);
  // too little of it is none
  CHECK(stalls_at([](double t) { return 10.0 - 0.01 * t; }, slow, fast_law, true) > 0.0);
  // going to and fro is none
  CHECK(stalls_at([](double t) { return 1.0 + 0.5 * std::sin(20.0 * t); }, quick, fast_law, false) > 1.5);
  CHECK(stalls_at([](double t) { return 1.0 + 0.5 * std::sin(20.0 * t); }, quick, fast_law, false) < 2.0);
}

TEST_CASE("where the law itself is slow more time is given", "[hybrid][stall]") {
  // 0.01 at 0.05/s: three times 0.2 s
  CHECK(stalls_at(stands, slow, 0.05, true) == Approx(0.3 + 0.6).margin(1.5 * tick));
  CHECK(stalls_at(stands, slow, 0.05, false) == Approx(1.5 + 0.6).margin(1.5 * tick));
  // but not without end
  CHECK(stalls_at(stands, slow, 0.0, true) == Approx(0.3 + 8.0).margin(1.5 * tick));
  CHECK(stalls_at(stands, slow, 0.0, false) == Approx(1.5 + 8.0).margin(1.5 * tick));
}

TEST_CASE("a restarted watch waits anew, from a new best", "[hybrid][stall]") {
  StallWatch watch(0.3);
  watch.restart(0.0);
  CHECK_FALSE(watch.stalled(0.0, 1.0, slow, fast_law, true));
  CHECK(watch.stalled(0.4, 1.0, slow, fast_law, true));
  watch.restart(0.4);
  CHECK_FALSE(watch.stalled(0.5, 5.0, slow, fast_law, true));
  CHECK_FALSE(watch.stalled(0.75, 5.0, slow, fast_law, true));
  CHECK(watch.stalled(0.85, 5.0, slow, fast_law, true));
}
