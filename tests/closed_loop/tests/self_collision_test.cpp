#include <catch2/catch.hpp>
#include <cmath>
#include <limits>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"

using namespace hamelin;
using log::Outcome;
using test::ball;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

// The four links of the arm form a square, except for an angle that the last link's swing closes.
Json closing_square(double speed, double open = 0.3) {
  Json scene = scene_52();
  const double right = 0.5 * std::acos(-1.0);
  scene["start"] = {{"q", {0.0, right, right, right - open}}, {"v", {0.0, 0.0, 0.0, speed}}};
  scene["model"]["self_collision"] = true;
  scene["safety"] = {{"type", "certificate"}};  // a shield would stop the arm
  scene["planner"] = {{"name", "probe"}, {"params", {{"velocity", {0.0, 0.0, 0.0, speed}}}}};
  scene["step_s"] = 0.001;
  scene["duration_s"] = 1.0;
  return scene;
}

// Smallest distance between links that are not neighbours, with the spheres of planar4 placed by
// the test.
double self_distance(const Eigen::VectorXd& q, double radius = 0.02) {
  std::vector<std::vector<Eigen::Vector2d>> links;
  Eigen::Vector2d at = Eigen::Vector2d::Zero();
  double angle = 0.0;
  for (int i = 0; i < 4; ++i) {
    angle += q[i];
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    links.emplace_back();
    for (int k = 0; k < 25; ++k) links.back().push_back(at + (k + 0.5) / 25.0 * along);
    at += along;
  }
  double nearest = std::numeric_limits<double>::infinity();
  for (std::size_t a = 0; a < 4; ++a)
    for (std::size_t b = a + 2; b < 4; ++b)
      for (const auto& x : links[a])
        for (const auto& y : links[b]) nearest = std::min(nearest, (x - y).norm() - 2.0 * radius);
  return nearest;
}

}  // namespace

TEST_CASE("an arm that swings into itself ends in collision, and the cause names both parts",
          "[simulation][self]") {
  const TemporaryFolder folder;
  Json scene = closing_square(0.5);
  double last_apart = 0.0;
  simulation::Watch watch;
  watch.at_node = [&](double, const Eigen::VectorXd& q) {
    if (const double distance = self_distance(q); distance > 0.0) last_apart = distance;
  };
  const auto result = run_scene(folder, scene, watch);
  CAPTURE(result.cause);
  CHECK(result.outcome == Outcome::collision);
  CHECK_THAT(result.cause, Catch::Contains("the arm touches itself: 'link1' and 'link4'"));
  CHECK(self_distance(result.q) <= 0.0);
  CHECK(last_apart < 0.001);  // one step before it did not touch
  REQUIRE(result.min_self_clearance_m.has_value());
  CHECK(*result.min_self_clearance_m == Approx(self_distance(result.q)).margin(1e-12));
  CHECK_FALSE(result.min_clearance_m.has_value());
  CHECK_THAT(result.warnings.at(0), Catch::Contains("link1-link2"));

  scene["model"]["self_collision"] = false;
  const auto not_modelled = run_scene(folder, scene);
  CHECK(not_modelled.outcome == Outcome::timeout);
  CHECK_FALSE(not_modelled.min_self_clearance_m.has_value());
  CHECK_FALSE(not_modelled.certified_share.has_value());
}

TEST_CASE("a start in which the arm touches itself is refused", "[simulation][self]") {
  const TemporaryFolder folder;
  Json scene = closing_square(0.0);
  scene["start"]["q"][3] = 0.5 * std::acos(-1.0);
  const auto result = run_scene(folder, scene);
  CHECK(result.outcome == Outcome::refused);
  CHECK(result.steps == 0);
  CHECK_THAT(result.cause, Catch::Contains("'link1' and 'link4'"));
}

TEST_CASE("a self-contact between two nodes is found, and motion that stays apart is certified",
          "[simulation][self]") {
  const TemporaryFolder folder;
  // A ball at the tip, one at the start of the first link, and 0.6 rad per step: at the nodes the
  // tip is before and behind it.
  model::Robot balls = test::planar4(0);
  balls.links[0].spheres = {{Eigen::Vector3d(-1.0, 0.0, 0.0), 0.05}};
  balls.links[3].spheres = {{Eigen::Vector3d::Zero(), 0.05}};
  Json fast = closing_square(60.0);
  fast["step_s"] = 0.01;
  const auto hit = run_scene(folder, fast, {}, balls);
  CAPTURE(hit.cause);
  CHECK(hit.outcome == Outcome::collision);
  CHECK_THAT(hit.cause,
             Catch::Contains("contact of 'link1' and 'link4' between the nodes 0 and 1"));

  Json slow = closing_square(0.5);
  slow["duration_s"] = 0.5;  // ends 0.05 rad from the first link
  const auto clear = run_scene(folder, slow);
  CHECK(clear.outcome == Outcome::timeout);
  CHECK(clear.certified_share == 1.0);
  REQUIRE(clear.tightest_step_m.has_value());
  CHECK(*clear.tightest_step_m > 0.0);
  CHECK(*clear.tightest_step_m <= *clear.min_self_clearance_m);
  CHECK(*clear.min_self_clearance_m == Approx(self_distance(clear.q)).margin(1e-12));
  CHECK(*clear.min_self_clearance_m < 0.04);
}

TEST_CASE("clearances from obstacles and from the arm itself are reported separately",
          "[simulation][self]") {
  const TemporaryFolder folder;
  Json scene = closing_square(0.5);
  scene["duration_s"] = 0.5;
  scene["obstacles"] = Json::array({ball("post", 0.5, -0.2, 0.1)});
  const auto result = run_scene(folder, scene);
  CAPTURE(result.cause);
  CHECK(result.outcome == Outcome::timeout);
  CHECK(*result.min_clearance_m == Approx(0.2 - 0.1 - 0.02).margin(1e-4));
  CHECK(*result.min_self_clearance_m < 0.04);
}

TEST_CASE("self-collision requires collision shapes", "[simulation][self]") {
  const TemporaryFolder folder;
  CHECK_THROWS_WITH(run_scene(folder, closing_square(0.5), {}, test::planar4(0)),
                    Catch::Contains("/model/self_collision: 'planar4' has no collision spheres"));
}
