#include <catch2/catch.hpp>
#include <filesystem>

#include "hamelin/control/preparation.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/optimal/scene_motion.hpp"
#include "hamelin/optimal/world_clearance.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/robots.hpp"
#include "hamelin/test/skip.hpp"

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
    clearance.evaluate_all(q, d, gradients);
    const VectorXd direction = test::random_joints(rng, 7, 1.0);
    constexpr double step = 1e-6;
    clearance.evaluate_all(q + step * direction, ahead, unused);
    clearance.evaluate_all(q - step * direction, back, unused);
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

TEST_CASE("distances at their bounds have no effect on the solution", "[optimal][world]") {
  // Gives all distances, also those at their bounds.
  struct AllOf final : Clearance {
    explicit AllOf(Clearance& of) : of_(of) {}
    [[nodiscard]] Index rows() const override { return of_.rows(); }
    [[nodiscard]] const VectorXd& far() const override { return of_.far(); }
    void evaluate(const VectorXd& q, NearDistances& near) override {
      VectorXd distances;
      MatrixXd gradients;
      of_.evaluate_all(q, distances, gradients);
      near.clear();
      for (Index r = 0; r < rows(); ++r) near.add(r, distances[r], gradients.col(r));
    }
    Clearance& of_;
  };
  const scene::Scene scene = scene_of(pillar_scene());
  const model::Model model = control::load_model(scene);
  control::WorldView view(scene, model, influence_of(0.005));
  WorldClearance clearance(model, view);
  AllOf all(clearance);
  SceneMotionOptions options;
  options.objective = GENERATE(Objective::effort, Objective::time);
  options.intervals = 20;
  Problem problem = problem_of(scene, options, model);
  problem.q_start = scene.start_q;
  problem.q_goal = scene.goals[0].q;
  problem.v_start = problem.v_goal = VectorXd::Zero(7);
  problem.duration_s = 3.0;
  MatrixXd ends(7, 2);
  ends << problem.q_start, problem.q_goal;
  problem.clearance = &clearance;
  const Solution few = solve(problem, guess_along(ends, 20));
  problem.clearance = &all;
  const Solution many = solve(problem, guess_along(ends, 20));
  REQUIRE(few.violation <= 1e-8);
  CHECK(few.cost == Approx(many.cost).epsilon(1e-7));
  CHECK((few.control - many.control).cwiseAbs().maxCoeff() < 0.01);  // where the cost is flat
}

TEST_CASE("least time to within a share of it takes fewer iterations", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  SceneMotionOptions options;
  options.objective = Objective::time;
  options.margin_m = GENERATE(0.002, 0.008);
  options.cost_tolerance = 0.0;
  const SceneMotion exact = optimize_scene(scene, options);
  options.cost_tolerance = 5e-3;
  const SceneMotion near = optimize_scene(scene, options);
  REQUIRE(exact.valid());
  REQUIRE(near.valid());
  CAPTURE(exact.duration_s(), near.duration_s());
  CHECK(near.duration_s() < 1.01 * exact.duration_s());
  CHECK(near.goals[0].found.iterations < exact.goals[0].found.iterations);
  CHECK(near.goals[0].found.torque_share <= 1.0);
}

TEST_CASE("an arm goes around a pillar, proved clear", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  SceneMotionOptions options;
  options.objective = GENERATE(Objective::effort, Objective::time);
  options.margin_m = GENERATE(0.005, 0.008);
  const SceneMotion motion = optimize_scene(scene, options);
  REQUIRE(motion.valid());
  const GoalMotion& goal = motion.goals[0];
  CHECK(goal.found.proof.margin_m >= options.margin_m);
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
    CHECK(view.clearance_m() >= options.margin_m);
    CHECK(view.self_clearance_m() >= options.margin_m);
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
               d["planner"] = {{"name", "hybrid"}, {"guide", "none"}};
             }),
             Contains("/goals/0: is a position") && Contains("--guide"));
  CHECK_THAT(message([](Json& d) { d["goals"][0]["q"][3] = 1.0; }),
             Contains("/goals/0") && Contains("joint"));
  CHECK_THAT(message([](Json& d) {
               d["obstacles"][0]["position_m"] = {0.4, -0.41, 0.3};
             }),
             Contains("/goals/0: start: the clearance is"));
  const auto refused = [](auto&& change) {
    SceneMotionOptions options;
    change(options);
    return test::error_of([&] { (void)optimize_scene(scene_of(pillar_scene()), options); });
  };
  CHECK_THAT(refused([](SceneMotionOptions& o) { o.margin_m = std::nan(""); }),
             Contains("margin: nan"));
  CHECK_THAT(refused([](SceneMotionOptions& o) { o.margin_m = 0.01; }),
             Contains("/goals/0: start: the clearance is 0.00902") && Contains("margin 0.01 m"));
  CHECK_THAT(refused([](SceneMotionOptions& o) { o.limit_share = 0.0; }),
             Contains("share of the limits: 0"));
  CHECK_THAT(refused([](SceneMotionOptions& o) { o.limit_share = std::nan(""); }),
             Contains("share of the limits: nan"));
}

TEST_CASE("the margin is kept with few knots too", "[optimal][world]") {
  SceneMotionOptions options;
  options.intervals = GENERATE(6, 8, 10);
  options.objective = GENERATE(Objective::effort, Objective::time);
  const scene::Scene scene = scene_of(pillar_scene());
  const SceneMotion motion = optimize_scene(scene, options);
  REQUIRE(motion.valid());
  CHECK(motion.goals[0].found.proof.margin_m >= options.margin_m);
  control::WorldView view(scene, motion.model, 0.1);
  const TimedMotion& m = motion.goals[0].found.motion;
  VectorXd q, v, a;
  for (int i = 0; i <= 2000; ++i) {
    m.at(m.duration_s() * i / 2000.0, q, v, a);
    view.look(q, 0.0);
    CHECK(std::min(view.clearance_m(), view.self_clearance_m()) >= options.margin_m);
  }
}

TEST_CASE("nothing is proved of what is no motion", "[optimal][world]") {
  const scene::Scene scene = scene_of(pillar_scene());
  const model::Model model = control::load_model(scene);
  control::WorldView view(scene, model, 0.1);
  const double nan = std::nan("");
  TimedMotion motion{0.1, scene.start_q.replicate(1, 9)};
  CHECK(prove(motion, view).certified);
  CHECK_FALSE(prove(motion, view, {0.01}).certified);  // 9 mm
  CHECK(prove(motion, view, {0.01}).margin_m == Approx(0.00902).margin(1e-4));
  for (const double step : {0.0, -0.1, nan, infinity}) {
    motion.step_s = step;
    const MotionProof proof = prove(motion, view);
    CHECK_FALSE(proof.certified);
    CHECK(proof.margin_m == -infinity);
  }
  motion.step_s = 0.1;
  motion.control(2, 4) = nan;
  CHECK_FALSE(prove(motion, view).certified);
  CHECK_FALSE(prove({}, view).certified);
  motion.control = scene.start_q.replicate(1, 3);  // no interval
  CHECK_FALSE(prove(motion, view).certified);
  VectorXd q, v, a;
  CHECK(test::error_of([&] { motion.at(0.0, q, v, a); }) != "no error");
  motion.control = scene.start_q.replicate(1, 9);
  for (const ProofOptions& wrong :
       {ProofOptions{nan}, ProofOptions{-1.0}, ProofOptions{0.0, nan}, ProofOptions{0.0, 0.0, 0.0}})
    CHECK(test::error_of([&] { (void)prove(motion, view, wrong); }) != "no error");

  CHECK_FALSE(MotionProof{}.certified);
  CHECK(Solution{}.violation == infinity);
  CHECK_FALSE(GoalMotion{}.valid());
  const SceneMotion empty{"", "", {}, model, {}, 0};
  CHECK_FALSE(empty.valid());
}

TEST_CASE("a margin that is not proved makes the motion invalid, in one line", "[optimal][world]") {
  // the rows know standing obstacles only, the proof also those that move
  Json document = pillar_scene();
  document["obstacles"].push_back(
      {{"name", "ball"},
       {"type", "sphere"},
       {"radius_m", 0.4},
       {"position_m", {0.45, 1.4, 0.45}},
       {"motion", {{"type", "linear"}, {"velocity_m_s", {0.0, -1.0, 0.0}}}}});
  const SceneMotion motion = optimize_scene(scene_of(document), {});
  CHECK_FALSE(motion.valid());
  const GoalMotion& goal = motion.goals[0];
  CHECK_FALSE(goal.found.proof.certified);
  CHECK(goal.found.solution.violation > 0.0);
  CHECK_THAT(goal.found.solution.violated, Catch::Contains("clearance") &&
                                               Catch::Contains("expected the margin 0.005 m") &&
                                               !Catch::Contains("\n"));
  // of a motion that begins later, when the ball is gone
  const scene::Scene scene = scene_of(document);
  control::WorldView view(scene, motion.model, 0.1);
  CHECK_FALSE(prove(goal.found.motion, view, {0.005, 0.0}).certified);
  CHECK(prove(goal.found.motion, view, {0.005, 10.0}).certified);
}

namespace {

// The shortest motion between two configurations in which only torques are limited.
void check_torques_between_knots(const std::vector<double>& from, const std::vector<double>& to,
                                 int intervals) {
  Json document = pillar_scene();
  document.erase("obstacles");
  document["model"] = {{"joint_limits", false}, {"velocity_limits", false}};
  document["start"]["q"] = from;
  document["goals"][0]["q"] = to;
  const scene::Scene scene = scene_of(document);
  SceneMotionOptions options;
  options.objective = Objective::time;
  options.intervals = intervals;
  options.duration_s = 1.0;
  options.limit_share = 1.0;
  const SceneMotion motion = optimize_scene(scene, options);
  const Optimized& found = motion.goals.at(0).found;
  CAPTURE(intervals, found.torque_share, found.solution.violated);
  CHECK(motion.valid());
  CHECK(found.torque_share <= 1.0);
  const VectorXd limit = Limits::of(motion.model).torque;
  dynamics::Workspace ws(motion.model);
  VectorXd torque;
  double most = 0.0;
  for (int i = 0; i <= 20000; ++i) {
    torque_at(motion.model, ws, found.motion, found.motion.duration_s() * i / 20000.0, torque);
    most = std::max(most, torque.cwiseQuotient(limit).lpNorm<Eigen::Infinity>());
  }
  CHECK(most <= 1.0 + 1e-4);
  CHECK(most >= 0.9);  // some limit binds
}

}  // namespace

TEST_CASE("torques between the knots keep their limits, whatever the number of knots",
          "[optimal][world]") {
  check_torques_between_knots({0.3, -0.5, 0.4, -1.2, 0.2, 0.9, -0.3},
                              {-0.9, 0.6, -0.4, 0.3, 1.5, -0.6, 2.0}, GENERATE(6, 12));
}

TEST_CASE("torques between the knots keep their limits in a motion of many iterations",
          "[optimal][world]") {
#ifdef HAMELIN_SANITIZED
  test::skip("1800 iterations take ten minutes under sanitizers");
#endif
  check_torques_between_knots({-1.0, 0.7, -0.2, 0.9, 0.0, -0.8, 0.5},
                              {1.1, -0.4, 0.8, -1.5, -2.0, 0.4, 0.0}, GENERATE(6, 12));
}
