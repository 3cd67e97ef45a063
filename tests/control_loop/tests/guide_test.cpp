#include <catch2/catch.hpp>
#include <chrono>
#include <thread>

#include "../loop.hpp"
#include "guide/guidance.hpp"
#include "guide/guide_search.hpp"
#include "hamelin/control/plan_paths.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/test/allocations.hpp"

using namespace hamelin;
using Eigen::VectorXd;
using test::Loop;
using test::sampled;

namespace {

scene::Scene guided_scene() {
  scene::Scene scene = sampled("clutter.json");
  scene.guide.type = scene::GuideType::rrt_connect;
  return scene;
}

const Json no_escape{{"escape", "none"}};

}  // namespace

TEST_CASE("a controller follows paths that its guide's thread finds, without allocating in ticks",
          "[control][guide][threads]") {
  Loop loop(guided_scene(), {}, no_escape);
  control::ControlState state = control::ControlState::running;
  long allocations = 0;
  for (long k = 0; k < 60000 && state == control::ControlState::running; ++k) {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (k > 0) allocations += made;
    state = answer->state;
    loop.step(answer->torque);
    if (k > 0) CHECK(loop.controller.verdict()->certified);
    // The thread runs in real time, the loop does not.
    if (loop.controller.guide_figures()->found == 0)
      std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
  CHECK(state == control::ControlState::reached);
  CHECK(loop.controller.guide_figures()->found > 0);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

TEST_CASE("without a thread the guide searches when it is told to, and the arm waits until then",
          "[control][guide]") {
  control::Controller::Options options;
  options.guide_thread = false;
  Loop loop(guided_scene(), options, no_escape);
  const VectorXd start = loop.state.q;
  for (int k = 0; k < 300; ++k) loop.step(loop.tick().torque);
  CHECK((loop.state.q - start).lpNorm<Eigen::Infinity>() < 1e-3);
  CHECK(loop.controller.guide_figures()->searches == 0);
  CHECK(loop.controller.guide_figures()->waited_s == Approx(0.3));
  loop.controller.run_guide();
  for (int k = 0; k < 500; ++k) loop.step(loop.tick().torque);
  CHECK((loop.state.q - start).lpNorm<Eigen::Infinity>() > 0.05);
  CHECK(loop.controller.guide_figures()->found == 1);
}

TEST_CASE("a path that stays clear is kept where the world changes, and searched again where not",
          "[control][guide]") {
  control::Controller::Options options;
  options.guide_thread = false;
  Loop loop(guided_scene(), options, no_escape);
  const auto ticks = [&](int count) {
    for (int k = 0; k < count; ++k) {
      loop.step(loop.tick().torque);
      loop.controller.run_guide();
    }
  };
  ticks(400);
  const control::GuideFigures& figures = *loop.controller.guide_figures();
  REQUIRE(figures.found == 1);
  scene::Obstacle ball;
  ball.name = "ball";
  ball.radius_m = 0.05;
  ball.pose = {Eigen::Matrix3d::Identity(), {0.0, 0.0, 1.9}};  // out of reach
  loop.controller.world().set_obstacle(ball);
  ticks(100);
  CHECK(figures.kept == 1);
  CHECK(figures.searches == 1);
  // where the tip is to be
  dynamics::Workspace ws(loop.arm);
  const scene::Goal& goal = loop.controller.goals().goal();
  geometry::SE3 place = goal.pose;
  if (goal.type == scene::GoalType::joint) {
    dynamics::forward_kinematics(loop.arm, ws, goal.q);
    place = dynamics::tip_pose(loop.arm, ws);
  }
  ball.pose = place;
  loop.controller.world().set_obstacle(ball);
  ticks(100);
  CHECK(figures.searches == 2);
  CHECK(figures.kept == 1);
}

TEST_CASE("new goals, a new start and a load begin with a search of their own",
          "[control][guide]") {
  control::Controller::Options options;
  options.guide_thread = false;
  options.payload_reach_m = 0.3;
  options.payload_shapes_max = 2;
  Loop loop(guided_scene(), options, no_escape);
  const auto ticks = [&](int count) {
    for (int k = 0; k < count; ++k) {
      loop.step(loop.tick().torque);
      loop.controller.run_guide();
    }
  };
  const control::GuideFigures& figures = *loop.controller.guide_figures();
  ticks(50);
  CHECK(figures.searches == 1);
  loop.controller.set_goal(scene::joint_goal(loop.state.q + VectorXd::Constant(7, 0.1)));
  ticks(50);
  CHECK(figures.searches == 2);
  scene::Payload cup;
  cup.name = "cup";
  cup.mass_kg = 0.1;
  cup.spheres = {{{0.0, 0.0, 0.05}, 0.02}};
  loop.controller.attach(cup, loop.state.q);
  ticks(50);
  CHECK(figures.searches == 3);
  loop.controller.reset();
  ticks(50);
  CHECK(loop.controller.guide_figures()->searches == 1);  // since the new start
}

TEST_CASE("a planner asks for a path at each goal, as often as the scene allows",
          "[control][guide]") {
  control::Controller::Options options;
  options.guide_thread = false;
  scene::Scene scene = guided_scene();
  scene.guide.type = scene::GuideType::on_request;
  Loop loop(scene, options);
  const control::GuideFigures& figures = *loop.controller.guide_figures();
  const auto ticks = [&](int count, bool search) {
    for (int k = 0; k < count; ++k) {
      loop.step(loop.tick().torque);
      if (search) loop.controller.run_guide();
    }
  };
  const VectorXd start = loop.state.q;
  ticks(100, false);
  CHECK(figures.waited_s == Approx(0.099));  // it asks in the first tick
  CHECK((loop.state.q - start).lpNorm<Eigen::Infinity>() < 1e-3);
  ticks(300, true);
  CHECK(figures.searches == 1);
  CHECK(figures.found == 1);
  loop.controller.set_goal(scene::joint_goal(loop.state.q + VectorXd::Constant(7, 0.1)));
  ticks(50, true);
  CHECK(figures.searches == 2);
  scene.guide.type = scene::GuideType::none;
  Loop alone(scene, options);
  CHECK(alone.controller.guide_figures() == nullptr);
  CHECK(alone.tick().state == control::ControlState::running);
  scene.guide.type = scene::GuideType::on_request;
  Loop reactive(scene, options, no_escape);
  for (int k = 0; k < 100; ++k) reactive.step(reactive.tick().torque);
  CHECK(reactive.controller.guide_figures()->waited_s == 0.0);
}

TEST_CASE("another goal in motion is gone to at speed, without a jump of the acceleration's bound",
          "[control][guide][allocation]") {
  control::Controller::Options options;
  options.guide_thread = false;
  const scene::Scene scene = guided_scene();
  Loop loop(scene, options, no_escape);
  long allocations = 0;
  double largest_change = 0.0;
  const auto advance = [&] {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (loop.state.k > 0) allocations += made;
    const control::ControlState state = answer->state;
    const VectorXd before = loop.v;
    loop.step(answer->torque);
    largest_change = std::max(largest_change, (loop.v - before).lpNorm<Eigen::Infinity>());
    loop.controller.run_guide();
    return state;
  };
  while (loop.v.norm() < 1.2 && loop.state.k < 2000) (void)advance();
  const double speed = loop.v.norm();
  REQUIRE(speed >= 1.2);
  scene::Goal other = scene.goals.front();
  REQUIRE(other.type == scene::GoalType::joint);
  other.q[0] += 0.2;
  loop.controller.set_goal(other);
  double slowest = speed;
  for (int k = 0; k < 40; ++k) {
    (void)advance();
    slowest = std::min(slowest, loop.v.norm());
  }
  CHECK(slowest > 0.95 * speed);
  control::ControlState state = control::ControlState::running;
  while (state == control::ControlState::running && loop.state.k < 6000) state = advance();
  CHECK(state == control::ControlState::reached);
  CHECK(loop.controller.guide_figures()->waited_s < 0.05);
  constexpr double acceleration = 40.0;  // that of motions by default
  CHECK(largest_change < 1.05 * 0.001 * acceleration);
  if (test::counts_allocations()) CHECK(allocations == 0);
}

TEST_CASE("a goal that is passed does not stop the arm, and other goals in between are taken",
          "[control][guide][allocation]") {
  scene::Scene scene = guided_scene();
  const scene::Goal last = scene.goals.front();
  const Eigen::MatrixXd path = control::plan_paths(scene).goals.front().path.points;
  VectorXd between = 0.5 * (path.col(0) + path.rightCols<1>());
  between[0] += 0.15;
  scene::Goal passed = scene::joint_goal(between);
  passed.passes = true;
  scene.goals = {passed, last};
  control::Controller::Options options;
  options.guide_thread = false;
  Loop loop(scene, options, no_escape);
  long allocations = 0;
  double slowest = infinity;
  const auto advance = [&](bool searches) {
    const control::Answer* answer = nullptr;
    const long made = test::allocations_in([&] { answer = &loop.tick(); });
    if (loop.state.k > 0) allocations += made;
    const control::ControlState state = answer->state;
    loop.step(answer->torque);
    const double away = (loop.state.q - passed.q).lpNorm<Eigen::Infinity>();
    if (away < 0.2 && loop.state.k > 50) slowest = std::min(slowest, loop.v.norm());
    if (searches) loop.controller.run_guide();
    return state;
  };
  SECTION("to the end") {
    control::ControlState state = control::ControlState::running;
    while (state == control::ControlState::running && loop.state.k < 6000) state = advance(true);
    CHECK(state == control::ControlState::reached);
    CHECK(slowest > 0.3);
    CHECK(loop.controller.guide_figures()->waited_s < 0.1);
  }
  SECTION("other goals before the guide has answered") {
    while (loop.controller.guide_figures()->found == 0 && loop.state.k < 2000) (void)advance(true);
    for (int k = 0; k < 30; ++k) (void)advance(false);
    scene::Goal other = last;
    other.q[0] += 0.2;
    loop.controller.set_goal(other);
    control::ControlState state = control::ControlState::running;
    while (state == control::ControlState::running && loop.state.k < 9000) state = advance(true);
    CHECK(state == control::ControlState::reached);
    CHECK((loop.state.q - other.q).lpNorm<Eigen::Infinity>() < other.tolerance_rad);
  }
  SECTION("another world before the guide has answered") {
    while (loop.controller.guide_figures()->found == 0 && loop.state.k < 2000) (void)advance(true);
    scene::Obstacle far;
    far.name = "far";
    far.radius_m = 0.05;
    far.pose = {Eigen::Matrix3d::Identity(), {0.0, 0.0, 3.0}};
    for (int k = 0; k < 30; ++k) (void)advance(false);
    loop.controller.world().set_obstacle(far);
    control::ControlState state = control::ControlState::running;
    while (state == control::ControlState::running && loop.state.k < 9000) state = advance(true);
    CHECK(state == control::ControlState::reached);
  }
  if (test::counts_allocations()) CHECK(allocations == 0);
}

TEST_CASE("planners that follow no paths are shown their way-points", "[control][guide]") {
  const scene::GuideSpec spec{scene::GuideType::rrt_connect, {}, 1000, 0, 1, 0.0};
  CHECK(planning::find_plugin("hybrid", {HAMELIN_TEST_PLUGIN_DIR}).follows_paths());
  CHECK_FALSE(planning::find_plugin("apf", {HAMELIN_TEST_PLUGIN_DIR}).follows_paths());
  scene::Scene scene = guided_scene();
  scene.planner->name = "apf";
  control::Controller::Options options;
  options.guide_thread = false;
  Loop loop(scene, options);
  control::GuideSearch search(
      loop.arm, loop.controller.world(), loop.controller.view(),
      std::make_unique<control::MotionSearch>(
          loop.arm,
          control::guide_settings(scene, loop.arm, loop.controller.view(), {}, Json::object()),
          nullptr, 0),
      64, false);
  const auto goals = std::make_shared<const std::vector<scene::Goal>>(scene.goals);
  const control::ReferenceState rest{};
  for (const bool follows : {true, false}) {
    control::Guidance guidance(spec, loop.arm.dof(), 64, follows, false);
    VectorXd q = scene.start_q;
    const auto update = [&](double time_s) {
      const auto news = guidance.update(
          {time_s, 0.001, q, goals, 0, follows ? 1U : 2U, 0, 0, nullptr, nullptr, nullptr, rest},
          search);
      search.run();
      return news;
    };
    CHECK(update(0.0) == control::Guidance::News::none);
    REQUIRE(guidance.goal() != nullptr);  // holds its place
    CHECK(VectorXd::Map(guidance.goal()->q, q.size()) == q);
    CHECK(update(0.001) == control::Guidance::News::path);
    const std::size_t points = guidance.goal()->path_points;
    if (follows) {
      CHECK(points >= 2);
      continue;
    }
    CHECK(points == 0);
    // An arm that jumps to whatever it is shown passes the way-points one after the other.
    const Eigen::MatrixXd path = search.take().path.points;
    for (int k = 2; k < 100; ++k) {
      (void)update(0.001 * k);
      q = VectorXd::Map(guidance.goal()->q, q.size());
      bool on_path = false;
      for (Eigen::Index i = 0; i < path.cols(); ++i) on_path = on_path || path.col(i) == q;
      CHECK(on_path);
    }
    CHECK(q == path.rightCols(1));
  }
}
