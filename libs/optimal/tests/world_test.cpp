#include <catch2/catch.hpp>
#include <filesystem>

#include "hamelin/control/preparation.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/optimal/scene_motion.hpp"
#include "hamelin/optimal/world_clearance.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::optimal;
using Eigen::Index;

namespace {

const std::filesystem::path scenes = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes";

// An arm that turns around a pillar which stands in its way.
Json pillar_scene() {
  return read_json(scenes / "pillar.json");
}

scene::Scene scene_of(const Json& document) {
  return scene::scene_from_json(document, scenes, "scene");
}

}  // namespace

TEST_CASE("gradients of clearances agree with differences", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  const model::Model model = control::load_model(scene);
  control::WorldView view(scene, model, 0.4);
  WorldClearance clearance(model, view);
  const Index rows = clearance.rows();
  REQUIRE(rows > 20);
  VectorXd d(rows), ahead(rows), back(rows);
  MatrixXd gradients(7, rows), unused(7, rows);
  Rng rng(3);
  int compared = 0;
  for (int i = 0; i < 20; ++i) {
    const VectorXd q = scene.start_q + test::random_joints(rng, 7, 0.8);
    clearance.evaluate(q, d, gradients);
    const VectorXd direction = test::random_joints(rng, 7, 1.0);
    constexpr double step = 1e-6;
    clearance.evaluate(q + step * direction, ahead, unused);
    clearance.evaluate(q - step * direction, back, unused);
    for (Index r = 0; r < rows; ++r) {
      // not where the nearest point jumps in between
      if (std::abs(ahead[r] + back[r] - 2.0 * d[r]) > 1e-9) continue;
      CHECK((ahead[r] - back[r]) / (2.0 * step) ==
            Approx(gradients.col(r).dot(direction)).margin(1e-5));
      compared += gradients.col(r).isZero(0.0) ? 0 : 1;
    }
  }
  CHECK(compared > 100);
}

TEST_CASE("an arm goes around a pillar, proved clear", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  SceneMotionOptions options;
  options.objective = GENERATE(Objective::effort, Objective::time);
  const SceneMotion motion = optimize_scene(scene, options);
  REQUIRE(motion.valid());
  const GoalMotion& goal = motion.goals[0];
  CHECK(goal.found.proof.margin_m > 0.0);
  CHECK(goal.found.torque_share <= 1.0);

  // the straight guess meets the pillar
  const VectorXd middle = 0.5 * (scene.start_q + scene.goals[0].q);
  control::WorldView view(scene, motion.model, 0.1);
  view.look(middle, 0.0);
  CHECK(view.touching());
  // and the motion keeps the margin wherever it is examined
  const TimedMotion& m = goal.found.motion;
  VectorXd q, v, a;
  for (int i = 0; i <= 2000; ++i) {
    m.at(m.duration_s() * i / 2000.0, q, v, a);
    view.look(q, 0.0);
    CHECK(view.clearance_m() > 0.0);
    CHECK(view.self_clearance_m() > 0.0);
  }
  // points at a rate contain the ends, and the same torques as the motion
  const auto points = motion.points(100.0);
  CHECK(points.front().time_s == 0.0);
  CHECK(points.back().time_s == motion.duration_s());
  CHECK((points.back().q - scene.goals[0].q).norm() < 1e-12);
  CHECK(motion.points().size() == 51);
}

TEST_CASE("motions are the same bits each time", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  const SceneMotion once = optimize_scene(scene, {}), again = optimize_scene(scene, {});
  CHECK(once.goals[0].found.motion.control == again.goals[0].found.motion.control);
  CHECK(to_json(once, {}) == to_json(again, {}));
}

TEST_CASE("scenes that cannot be optimised are refused in one line", "[optimal][world]") {
  const auto message = [](auto&& change) {
    Json document = pillar_scene();
    change(document);
    return test::error_of([&] { (void)optimize_scene(scene_of(document), {}); });
  };
  using Catch::Contains;
  CHECK_THAT(message([](Json& d) { d["model"]["joint_damping"] = 0.1; }),
             Contains("scene: /model: damping"));
  CHECK_THAT(message([](Json& d) {
               d["goals"] = {{{"type", "position"}, {"position_m", {0.5, 0.2, 0.4}}}};
             }),
             Contains("/goals/0: is a position") && Contains("--guide"));
  CHECK_THAT(message([](Json& d) { d["goals"][0]["q"][3] = 1.0; }),
             Contains("/goals/0") && Contains("joint"));
  CHECK_THAT(message([](Json& d) {
               d["obstacles"][0]["position_m"] = {0.4, -0.41, 0.3};
             }),
             Contains("/goals/0: start: the clearance is"));
}
