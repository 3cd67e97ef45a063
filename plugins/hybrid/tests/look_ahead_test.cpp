#include "../src/look_ahead.hpp"

#include <catch2/catch.hpp>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/random_mass.hpp"
#include "hamelin/test/reactive_scene.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::Vector4d;
using Eigen::VectorXd;
using hybrid::Act;
using hybrid::Evasion;
using hybrid::LookAhead;
using hybrid::Trail;
using hybrid::Way;

namespace {

constexpr double lead_s = 0.02;
constexpr hybrid::LookAheadParams params{10.0, 10.0, 6.0, 15.0, 16.0};
constexpr int enough = 100000;  // configurations

/// Looks of an arm at rest at q.
struct Looks {
  explicit Looks(const test::Task& task, VectorXd at = VectorXd::Zero(4))
      : scene(task),
        law(scene.setup, scene.model, test::law_params),
        look(scene.setup, scene.model, law, scene.margins, scene.planner_host()),
        trail(4, 64, hybrid::trail_spacing),
        own(4),
        q(std::move(at)),
        v(VectorXd::Zero(4)),
        ws(scene.model),
        shapes(scene.model) {
    look.set_params(params);
    way.goal = &scene.goal();
  }
  [[nodiscard]] bool is_near() {
    dynamics::forward_kinematics(scene.model, ws, q);
    shapes.place(scene.model, ws);
    return look.is_near(shapes.view(), moving_count);
  }
  void begin(int budget = enough) { begin(own, false, budget); }
  void begin(const Evasion& in_force, bool keep, int budget = enough) {
    dynamics::Workspace at(scene.model);
    MatrixXd M(4, 4);
    dynamics::mass_matrix(scene.model, at, q, M);
    const MatrixXd M_inv = M.inverse();
    REQUIRE(is_near());
    look.begin(q, v, M, M_inv, way, trail, in_force, keep, lead_s, budget);
  }
  const Evasion& run(int units = enough) {
    for (long before = -1; !look.done() && look.units() != before;) {
      before = look.units();
      look.advance(units);
    }
    REQUIRE(look.done());
    return look.result();
  }
  /// The least distance from the moving obstacles on an evasion's way, docs/theory.md (10.35),
  /// where no row and no limit acts.
  [[nodiscard]] double simulated(const Evasion& evasion) {
    VectorXd at = q + lead_s * v, speed = v, u(4);
    Eigen::Index age = 0;
    double least = 1.0;
    for (int k = 0;; ++k) {
      least = std::min(least, scene.mover_clearance(at, lead_s + 0.05 * k));
      if (k == 20) return least;
      hybrid::evasion_velocity(evasion, trail, at, age, u);
      speed += (u - speed).cwiseMin(8.0 * 0.05).cwiseMax(-8.0 * 0.05);
      at += 0.05 * speed;
    }
  }

  std::size_t moving_count = 1;
  test::ReactiveScene scene;
  hybrid::Law law;
  LookAhead look;
  Trail trail;
  Evasion own;
  Way way;
  VectorXd q, v;
  dynamics::Workspace ws;
  scene::PlacedShapes shapes;
};

test::Task task_with(const VectorXd& goal, scene::Obstacle mover,
                     std::vector<test::Ball> balls = {}) {
  auto task = test::joint_task(goal, std::move(balls));
  task.goal.speed_max = 0.05;
  task.movers = {std::move(mover)};
  return task;
}

// Falls onto the arm along the x-axis and crosses it after 0.6 s.
scene::Obstacle falling() {
  return test::moving_ball({0.6, 0.6, 0.0}, 0.1, {0.0, -1.0, 0.0});
}

void check_equal(const Evasion& a, const Evasion& b) {
  CHECK(a.act == b.act);
  CHECK(a.rows == b.rows);
  CHECK(a.clear == b.clear);
  if (a.act == Act::aside) CHECK(a.aside == b.aside);
}

}  // namespace

TEST_CASE("an obstacle counts as near if it comes near within a second", "[hybrid][look]") {
  const VectorXd goal = Vector4d(1.0, 0.0, 0.0, 0.0);
  const auto near = [&](const scene::Obstacle& mover) {
    return Looks(task_with(goal, mover)).is_near();
  };
  CHECK(near(test::moving_ball({0.5, 0.35, 0.0}, 0.1, {0.0, 1.0, 0.0})));       // now
  CHECK_FALSE(near(test::moving_ball({0.5, 0.5, 0.0}, 0.1, {0.0, 1.0, 0.0})));  // moves away
  CHECK(near(test::moving_ball({0.5, 1.2, 0.0}, 0.1, {0.0, -1.0, 0.0})));       // at 1 s
  CHECK_FALSE(near(test::moving_ball({0.5, 2.0, 0.0}, 0.1, {0.0, -1.0, 0.0})));
}

TEST_CASE("the own way is taken where it stays clear, after one simulation", "[hybrid][look]") {
  // The arm turns away from an obstacle that follows it slowly.
  Looks looks(task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                        test::moving_ball({0.7, -0.3, 0.0}, 0.1, {0.0, 0.1, 0.0})));
  looks.begin();
  const Evasion& result = looks.run();
  CHECK(result.act == Act::own);
  CHECK(result.clear);
  CHECK_FALSE(result.rows);
  CHECK(looks.look.clearance() == Approx(looks.scene.mover_clearance(looks.q, lead_s)));
  CHECK(looks.look.units() == 21);
}

TEST_CASE("an obstacle that will hit the arm where it waits is evaded on a way that is clear",
          "[hybrid][look]") {
  Looks looks(task_with(Vector4d(1.0, 0.0, 0.0, 0.0), falling()));
  looks.way.waits = true;
  Evasion stand(4);
  stand.act = Act::stop;
  REQUIRE(looks.simulated(stand) < 0.0);
  looks.begin();
  const Evasion result = looks.run();
  REQUIRE(result.clear);
  CHECK(looks.look.clearance() >= 0.01);
  CHECK((result.act != Act::own || result.rows));
  if (!result.rows) CHECK(looks.look.clearance() == Approx(looks.simulated(result)).margin(1e-9));
}

TEST_CASE("random ways are simulated as the theory says", "[hybrid][look]") {
  // Way after way without rows, until there are enough to compare.
  int compared = 0;
  for (std::uint64_t seed = 1; seed <= 40; ++seed) {
    CAPTURE(seed);
    auto task = task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                          test::moving_ball({0.6, 0.5, 0.0}, 0.15, {0.0, -1.5, 0.0}));
    task.seed = seed;
    Looks looks(task);
    looks.way.waits = true;
    looks.begin();
    const Evasion result = looks.run();
    if (result.act != Act::aside || result.rows) continue;
    ++compared;
    CHECK(looks.look.clearance() == Approx(looks.simulated(result)).margin(1e-9));
  }
  CHECK(compared > 5);
}

TEST_CASE("an arm at its goal evades as well", "[hybrid][look]") {
  Looks looks(task_with(VectorXd::Zero(4), falling()));
  looks.begin();
  const Evasion& result = looks.run();
  CHECK(result.clear);
  CHECK((result.act != Act::own || result.rows));
  CHECK(looks.look.clearance() >= 0.01);
  CHECK(looks.look.clearance() < 0.6);  // it looked until the obstacle came
}

TEST_CASE("a way that ends at the goal before the obstacle comes there is clear",
          "[hybrid][look]") {
  const VectorXd goal = Vector4d(0.05, 0.0, 0.0, 0.0);
  Looks looks(task_with(goal, test::moving_ball({0.6, 1.3, 0.0}, 0.1, {0.0, -1.4, 0.0})));
  looks.begin();
  const Evasion& result = looks.run();
  CHECK(result.act == Act::own);
  CHECK_FALSE(result.rows);
  CHECK(looks.look.units() < 21);
  looks.way.waits = true;
  looks.begin();
  CHECK((looks.run().act != Act::own || looks.look.result().rows));
}

TEST_CASE("going back along the trail is tried before random ways", "[hybrid][look]") {
  // A wide obstacle comes from ahead, and rows do not help; the trail leads away from it.
  scene::Obstacle wall;
  wall.shape = scene::Shape::box;
  wall.size_m = Vector3d(0.2, 3.0, 1.0);
  wall.pose = {Eigen::Matrix3d::Identity(), {1.5, 0.0, 0.0}};
  wall.motion =
      scene::ObservedMotion{0.0, Vector3d(-0.7, 0.0, 0.0), Vector3d::Zero(), Vector3d::Zero()};
  Looks looks(task_with(Vector4d(0.0, 0.0, 0.0, 0.1), wall));
  looks.way.waits = true;
  for (int i = 40; i >= 0; --i)  // unfolds
    looks.trail.add(0.05 * i * Vector4d(0.5, -1.0, 1.0, -1.0));
  looks.begin();
  const Evasion result = looks.run();
  REQUIRE(result.clear);
  CHECK((result.act == Act::back || (result.rows && result.act != Act::aside)));
  Evasion back(4);
  back.act = Act::back;
  if (looks.simulated(back) >= 0.01) CHECK(looks.look.units() <= 21 * 6);
}

TEST_CASE("an evasion in force is tried first while it is kept, else after the own way",
          "[hybrid][look]") {
  Looks looks(task_with(Vector4d(1.0, 0.0, 0.0, 0.0), falling()));
  looks.way.waits = true;
  Evasion in_force(4);
  in_force.act = Act::aside;
  in_force.rows = false;
  in_force.aside = Vector4d(-0.9, 0.0, 0.0, 0.0);
  looks.v = Vector4d(-0.3, 0.2, -0.1, 0.4);
  REQUIRE(looks.simulated(in_force) >= 0.01);
  looks.begin(in_force, true);
  check_equal(looks.run(), in_force);
  CHECK(looks.look.units() == 21);
  CHECK(looks.look.clearance() == Approx(looks.simulated(in_force)).margin(1e-9));

  // The own way is clear again: it is taken unless the evasion is kept.
  Looks again(task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                        test::moving_ball({0.6, -0.3, 0.0}, 0.1, {0.0, -0.2, 0.0})));
  again.begin(in_force, false);
  CHECK(again.run().act == Act::own);
  in_force.aside = Vector4d(0.5, 0.0, 0.0, 0.0);
  again.begin(in_force, true);
  check_equal(again.run(), in_force);
}

TEST_CASE("the result of a look does not depend on how its work is split", "[hybrid][look]") {
  for (const int budget : {21, 50, 200, enough}) {
    for (std::uint64_t seed = 1; seed <= 5; ++seed) {
      CAPTURE(budget, seed);
      auto task = task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                            test::moving_ball({0.6, 0.5, 0.0}, 0.2, {0.0, -1.5, 0.0}),
                            {{{0.5, -0.25, 0.0}, 0.1}});
      task.seed = seed;
      Looks whole(task);
      whole.begin(budget);
      const Evasion expected = whole.run();
      const double clearance = whole.look.clearance();
      for (const int units : {1, 7, 40}) {
        CAPTURE(units);
        Looks split(task);
        split.begin(budget);
        check_equal(split.run(units), expected);
        CHECK(split.look.clearance() == clearance);
        CHECK(split.look.units() == whole.look.units());
      }
    }
  }
}

TEST_CASE("a look that uses up its budget returns the best way so far", "[hybrid][look]") {
  // Nothing is clear: the ball encloses the base.
  const auto task = task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                              test::moving_ball({0.0, 0.8, 0.0}, 0.5, {0.0, -1.5, 0.0}));
  double last = -1e9;
  for (const int budget : {21, 60, 120, 250, 1000}) {
    CAPTURE(budget);
    Looks looks(task);
    looks.begin(budget);
    const Evasion& result = looks.run();
    CHECK_FALSE(result.clear);
    CHECK(looks.look.units() <= budget + 1);
    CHECK(std::isfinite(looks.look.clearance()));
    CHECK(looks.look.clearance() < 0.01);
    CHECK(looks.look.clearance() >= last);
    last = looks.look.clearance();
  }
}

TEST_CASE("looks after a reset repeat", "[hybrid][look]") {
  Looks looks(task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                        test::moving_ball({0.6, 0.5, 0.0}, 0.15, {0.0, -1.5, 0.0})));
  looks.way.waits = true;
  std::vector<Evasion> first;
  std::vector<double> clearances;
  for (int i = 0; i < 20; ++i) {
    looks.begin();
    first.push_back(looks.run());
    clearances.push_back(looks.look.clearance());
  }
  // Each look draws other random ways.
  std::vector<double> asides;
  for (const Evasion& evasion : first)
    if (evasion.act == Act::aside) asides.push_back(evasion.aside[0]);
  REQUIRE(asides.size() > 2);
  CHECK(asides[0] != asides[1]);
  looks.begin();
  looks.look.advance(30);
  looks.look.reset();
  CHECK(looks.look.done());
  for (std::size_t i = 0; i < first.size(); ++i) {
    CAPTURE(i);
    looks.begin();
    check_equal(looks.run(), first[i]);
    CHECK(looks.look.clearance() == clearances[i]);
  }
}

TEST_CASE("ways do not lead through what stands still", "[hybrid][look]") {
  // The obstacle comes from above, and the way down is free or not.
  Looks open(task_with(Vector4d(1.0, 0.0, 0.0, 0.0), falling()));
  Looks shut(task_with(Vector4d(1.0, 0.0, 0.0, 0.0), falling(), {{{0.6, -0.2, 0.0}, 0.1}}));
  for (Looks* looks : {&open, &shut}) {
    looks->way.waits = true;
    looks->begin();
    (void)looks->run();
  }
  CHECK(open.look.result().clear);
  CHECK_FALSE(shut.look.result().clear);
  CHECK(shut.look.clearance() < 0.0);
}

TEST_CASE("a look does not allocate", "[hybrid][look][allocation]") {
  test::require_allocation_count();
  Looks looks(task_with(Vector4d(1.0, 0.0, 0.0, 0.0),
                        test::moving_ball({0.0, 0.8, 0.0}, 0.5, {0.0, -1.5, 0.0}),
                        {{{0.6, -0.2, 0.0}, 0.1}}));
  for (int i = 40; i >= 0; --i) looks.trail.add(0.05 * i * Vector4d(0.5, -1.0, 1.0, -1.0));
  const MatrixXd M = MatrixXd::Identity(4, 4);
  dynamics::forward_kinematics(looks.scene.model, looks.ws, looks.q);
  looks.shapes.place(looks.scene.model, looks.ws);
  CHECK(test::allocations_in([&] {
          if (!looks.look.is_near(looks.shapes.view(), 1)) return;
          looks.look.begin(looks.q, looks.v, M, M, looks.way, looks.trail, looks.own, false, lead_s,
                           400);
          while (!looks.look.done()) looks.look.advance(7);
        }) == 0);
  CHECK(looks.look.units() > 60);
}
