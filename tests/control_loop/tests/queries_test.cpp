// Planners that query the world on threads of their own.
#include <atomic>
#include <catch2/catch.hpp>
#include <thread>

#include "../loop.hpp"

using namespace hamelin;

TEST_CASE("eight threads of a planner query the world while ticks go on and the world changes",
          "[control][query]") {
  scene::Scene scene = test::sampled("clutter.json");
  scene.planner->name = "querying";
  scene.planner->params = Json::object();
  scene.model.self_collision = true;
  control::Controller::Options options;
  options.obstacles_max = 8;
  test::Loop loop(scene, options);
  REQUIRE(loop.controller.series().size() == 2);
  CHECK(loop.controller.series()[0].name == "rounds");
  std::atomic<bool> stop{false};
  std::thread changes([&] {
    for (int i = 0; !stop; ++i) {
      scene::Obstacle ball;
      ball.name = "ball " + std::to_string(i % 4);
      ball.radius_m = 0.05;
      ball.pose = {Eigen::Matrix3d::Identity(), {0.6 + 0.02 * (i % 10), 0.3, 0.5}};
      loop.controller.world().set_obstacle(ball);
      if (i % 3 == 0)
        loop.controller.world().move_obstacle(ball.name, ball.pose, {0.1, 0.0, 0.0}, 0.0);
      if (i % 5 == 0) {
        scene::MapChangeSpec change;
        (i % 2 == 0 ? change.occupied_m : change.free_m) = {{{0.7, 0.7, 0.0}, {0.8, 0.8, 0.1}}};
        loop.controller.world().change_map(change);
      }
    }
  });
  double rounds = 0.0, world = 0.0;
  constexpr long ticks_max = 2'000'000;
  for (long k = 0; (rounds < 400.0 || world < 50.0) && k < ticks_max; ++k) {
    const control::Answer& answer = loop.tick();
    INFO(answer.cause);
    REQUIRE(answer.state == control::ControlState::running);
    REQUIRE(answer.series.size() == 2);
    rounds = answer.series[0];
    world = answer.series[1];
    loop.step(answer.torque);
  }
  stop = true;
  changes.join();
  CHECK(rounds >= 400.0);
  CHECK(world >= 50.0);
}
