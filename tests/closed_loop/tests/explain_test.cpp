// Contacts with moving obstacles, explained after the run. Motions that the search finds are
// checked with formulas for the planar arm that share no code with it.
#include "hamelin/simulation/explain.hpp"

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <fstream>

#include "../scratch_scene.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"

using namespace hamelin;
using simulation::Avoidability;
using simulation::Evasion;
using simulation::Explanation;
using test::TemporaryFolder;

namespace {

constexpr double effort_Nm = 150.0, ball_radius_m = 0.2;

// The straight arm rests; a ball comes straight to the middle of its last link.
const Eigen::Vector2d ball_start(3.5, 1.5), ball_velocity(0.0, -1.0);

Json moving_ball() {
  Json ball = test::ball("ball", ball_start.x(), ball_start.y(), ball_radius_m);
  ball["motion"] = {{"type", "linear"},
                    {"velocity_m_s", {ball_velocity.x(), ball_velocity.y(), 0.0}}};
  return ball;
}

Json resting_arm(const Json& obstacle) {
  Json scene = test::scene_52();
  scene["obstacles"] = Json::array({obstacle});
  scene["planner"] = {{"name", "probe"}, {"params", {{"velocity", {0.0, 0.0, 0.0, 0.0}}}}};
  scene["model"]["torque_limits"] = true;
  scene["safety"] = {{"type", "none"}};
  scene["step_s"] = 0.001;
  scene["duration_s"] = 3.0;
  return scene;
}

std::filesystem::path logged(const TemporaryFolder& folder, const Json& scene,
                             const std::string& name = "run.jsonl", double effort = effort_Nm) {
  log::RunLog log(folder.path() / name);
  simulation::Watch watch;
  watch.log = &log;
  (void)test::run_scene(folder, scene, watch, test::strong(effort));
  return log.file();
}

Explanation explained(const Json& scene, const simulation::ExplainOptions& options = {}) {
  const TemporaryFolder folder;
  const Explanation explanation = simulation::explain(logged(folder, scene), options);
  CHECK(explanation.nothing == "");
  Json document = to_json(explanation);
  CHECK_NOTHROW(check_shipped_schema(document, "explanation", "explanation"));
  return explanation;
}

// Distance of planar4's spheres from the ball.
double distance_from_ball(const Eigen::VectorXd& q, const Eigen::Vector2d& ball) {
  double nearest = 1e9, angle = 0.0;
  Eigen::Vector2d joint = Eigen::Vector2d::Zero();
  for (Eigen::Index link = 0; link < q.size(); ++link) {
    angle += q[link];
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    for (int k = 0; k < 25; ++k)
      nearest = std::min(nearest, (joint + (k + 0.5) / 25.0 * along - ball).norm());
    joint += along;
  }
  return nearest - 0.02 - ball_radius_m;
}

// Smallest distance from the moving ball, from the start of the evasion to a time.
double distance_on(const Evasion& evasion, double until_s) {
  Evasion::State state;
  double nearest = 1e9;
  for (double t = evasion.start_s; t < until_s; t += 2.5e-4) {
    evasion.at(t - evasion.start_s, state);
    nearest = std::min(nearest, distance_from_ball(state.q, ball_start + t * ball_velocity));
  }
  return nearest;
}

void check_torques(const Evasion& evasion) {
  const model::Model model(test::strong(effort_Nm));
  dynamics::Workspace ws(model);
  Evasion::State state, later;
  Eigen::VectorXd torque = Eigen::VectorXd::Zero(model.dof());
  constexpr double h = 1e-5;
  for (double t = 0.0; t + h < evasion.duration_s; t += 1e-3) {
    evasion.at(t, state);
    evasion.at(t + h, later);
    CHECK(((later.q - state.q) / h - 0.5 * (state.v + later.v)).norm() < 1e-5);
    CHECK(((later.v - state.v) / h - 0.5 * (state.a + later.a)).norm() < 1e-3);
    CHECK(((later.a - state.a) / h - 0.5 * (state.jerk + later.jerk)).norm() < 0.1);
    dynamics::inverse_dynamics(model, ws, state.q, state.v, state.a, torque);
    CHECK(torque.cwiseAbs().maxCoeff() <= effort_Nm + 1e-9);
  }
  evasion.at(evasion.duration_s, state);
  CHECK((state.q - evasion.end()).norm() < 1e-12);
  CHECK(state.v.norm() < 1e-12);
}

void check_evasion(const Explanation::Found& found, double contact_s) {
  CHECK(distance_on(found.evasion, contact_s + 0.5) > 0.0);
  check_torques(found.evasion);
  Evasion none = found.evasion;  // the check itself can fail
  none.v.setZero();
  none.way.setZero();
  CHECK(distance_on(none, contact_s + 0.5) < 0.0);
}

}  // namespace

TEST_CASE("a slow ball that a resting arm knows of is avoidable", "[explain]") {
  const Explanation explanation = explained(resting_arm(moving_ball()));
  CHECK(explanation.verdict == Avoidability::avoidable);
  CHECK(explanation.known_since_s == 0.0);
  const double contact_s = explanation.contact["time_s"].get<double>();
  CHECK(std::abs(contact_s - (1.5 - 0.22)) < 0.002);  // spheres of 0.02 m
  REQUIRE(explanation.latest);
  REQUIRE(explanation.latest_foreseen);
  CHECK(explanation.latest_foreseen->looked_clear);
  CHECK(explanation.latest_foreseen->contact_predicted);
  CHECK(explanation.latest_foreseen->evasion.start_s <= explanation.latest->evasion.start_s);
  CHECK(explanation.search.last_s == Approx(contact_s - 0.001));
  check_evasion(*explanation.latest, contact_s);
  check_evasion(*explanation.latest_foreseen, contact_s);
}

TEST_CASE("a ball that the arm does not know of is avoidable in hindsight only", "[explain]") {
  Json ball = moving_ball();
  ball["known"] = false;
  const Explanation explanation = explained(resting_arm(ball));
  CHECK(explanation.verdict == Avoidability::avoidable_in_hindsight);
  CHECK_FALSE(explanation.known_since_s);
  CHECK_FALSE(explanation.latest_foreseen);
  REQUIRE(explanation.latest);
  CHECK_FALSE(explanation.latest->known);
  check_evasion(*explanation.latest, explanation.contact["time_s"].get<double>());

  // Seen from 1 m on, which is early enough, or from 0.05 m on, which is not.
  ball["visible_within_m"] = 1.0;
  const Explanation seen = explained(resting_arm(ball));
  CHECK(seen.verdict == Avoidability::avoidable);
  REQUIRE(seen.known_since_s);
  CHECK(std::abs(*seen.known_since_s - (1.5 - 0.22 - 1.0)) < 0.003);
  REQUIRE(seen.latest_foreseen);
  CHECK(seen.latest_foreseen->decided_s >= *seen.known_since_s);
  ball["visible_within_m"] = 0.01;
  const Explanation late = explained(resting_arm(ball));
  CHECK(late.verdict == Avoidability::avoidable_in_hindsight);
  REQUIRE(late.known_since_s);
  REQUIRE(late.latest);
  CHECK(late.latest->evasion.start_s < *late.known_since_s);
}

TEST_CASE("a ball that was predicted to pass is avoidable in hindsight only", "[explain]") {
  // It moves along the arm at a distance of 0.5 m, and 0.02 s before the contact it jumps aside.
  Json ball = moving_ball();
  ball.erase("position_m");  // way-points are in the frame that it gives
  ball["motion"] = {{"type", "waypoints"},
                    {"waypoints",
                     {{{"time_s", 0.0}, {"position_m", {2.0, 0.72, 0.0}}},
                      {{"time_s", 1.0}, {"position_m", {3.0, 0.72, 0.0}}},
                      {{"time_s", 1.02}, {"position_m", {3.02, 0.2, 0.0}}},
                      {{"time_s", 2.0}, {"position_m", {4.0, 0.2, 0.0}}}}}};
  const Explanation explanation = explained(resting_arm(ball));
  CHECK(explanation.verdict == Avoidability::avoidable_in_hindsight);
  REQUIRE(explanation.latest);
  CHECK(explanation.latest->known);
  CHECK_FALSE(explanation.latest->contact_predicted);
  CHECK(explanation.latest->evasion.start_s <= 1.0);

  ball["prediction"] = "path";
  CHECK(explained(resting_arm(ball)).verdict == Avoidability::avoidable);
}

TEST_CASE("a delay of the actuation moves the decision, not the start", "[explain]") {
  Json scene = resting_arm(moving_ball());
  scene["actuation"] = {{"type", "sampled"}, {"control_period_s", 0.001}, {"delay_s", 0.02}};
  const Explanation explanation = explained(scene);
  CHECK(explanation.verdict == Avoidability::avoidable);
  REQUIRE(explanation.latest);
  CHECK(explanation.latest->decided_s == Approx(explanation.latest->evasion.start_s - 0.02));
}

TEST_CASE("an obstacle that appears beside the arm is unavoidable", "[explain]") {
  Json ball = test::ball("ball", 3.5, 0.02 + ball_radius_m + 0.01 + 3.0, ball_radius_m);
  ball["motion"] = {{"type", "linear"}, {"velocity_m_s", {0.0, -3.0, 0.0}}};
  ball["appears_s"] = 1.0;
  const Explanation beside = explained(resting_arm(ball));
  CHECK(beside.verdict == Avoidability::unavoidable);
  CHECK_FALSE(beside.latest);
  CHECK(beside.search.starts >= 1);
  CHECK(beside.search.motions > 100);
  CHECK(beside.search.first_s >= 1.0);

  ball["position_m"] = {3.5, 3.1, 0.0};  // inside the arm
  const Explanation inside = explained(resting_arm(ball));
  CHECK(inside.verdict == Avoidability::unavoidable);
  CHECK(inside.search.starts == 0);
  CHECK(inside.search.motions == 0);
}

TEST_CASE("an arm that is weaker has to begin earlier", "[explain]") {
  // The arm turns towards the ball, which comes to meet it.
  Json scene = resting_arm(moving_ball());
  scene["start"] = {{"v", {0.2, 0.0, 0.0, 0.0}}};
  scene["planner"]["params"]["velocity"] = {0.2, 0.0, 0.0, 0.0};
  const TemporaryFolder folder;
  const auto with_effort = [&](double effort) {
    return simulation::explain(logged(folder, scene, "run.jsonl", effort), {});
  };
  const Explanation strong = with_effort(effort_Nm), weak = with_effort(0.3 * effort_Nm);
  REQUIRE(strong.latest);
  REQUIRE(weak.latest);
  CHECK(weak.contact["time_s"] == strong.contact["time_s"]);
  CHECK(weak.latest->evasion.start_s < strong.latest->evasion.start_s - 0.05);
  CHECK(strong.latest->evasion.v[0] == Approx(0.2).margin(0.01));
  check_evasion(*strong.latest, strong.contact["time_s"].get<double>());
}

TEST_CASE("stops of the shield in the last second are listed", "[explain]") {
  // The arm turns towards a post, where the shield stops it, and is hit from behind.
  Json scene = resting_arm(test::ball("post", 3.5, 1.0, ball_radius_m));
  Json ball = test::ball("ball", 3.5, -3.0, ball_radius_m);
  ball["motion"] = {{"type", "linear"}, {"velocity_m_s", {0.0, 2.0, 0.0}}};
  ball["known"] = false;
  scene["obstacles"].push_back(ball);
  scene["start"] = {{"v", {0.3, 0.0, 0.0, 0.0}}};
  scene["planner"]["params"]["velocity"] = {0.3, 0.0, 0.0, 0.0};
  scene.erase("safety");
  const Explanation explanation = explained(scene);
  const double contact_s = explanation.contact["time_s"].get<double>();
  REQUIRE_FALSE(explanation.stops.empty());
  for (const auto& stop : explanation.stops) {
    CHECK(stop.what == "obstacle");
    CHECK(stop.from_s >= contact_s - 1.0);
    CHECK(stop.to_s >= stop.from_s);
    CHECK(stop.to_s <= contact_s);
  }
}

TEST_CASE("two searches give the same bytes, another seed tries other motions", "[explain]") {
  const TemporaryFolder folder;
  const Json scene = resting_arm(moving_ball());
  const auto plain = logged(folder, scene), packed = logged(folder, scene, "run.jsonl.zst");
  const std::string first = to_json(simulation::explain(plain, {})).dump();
  CHECK(to_json(simulation::explain(plain, {})).dump() == first);
  CHECK(to_json(simulation::explain(packed, {})).dump() == first);
  simulation::ExplainOptions other;
  other.seed = 2;
  CHECK(to_json(simulation::explain(plain, other)).dump() != first);
}

TEST_CASE("logs without a contact with a moving obstacle have nothing to explain", "[explain]") {
  const TemporaryFolder folder;
  Json scene = resting_arm(moving_ball());
  scene["duration_s"] = 0.5;
  const auto reason = [&](const Json& document) {
    const Explanation explanation = simulation::explain(logged(folder, document), {});
    CHECK_NOTHROW(check_shipped_schema(to_json(explanation), "explanation", "explanation"));
    return explanation.nothing;
  };
  CHECK(reason(scene) == "the run ended without contact (timeout)");

  Json standing = resting_arm(test::ball("post", 3.5, 1.0, ball_radius_m));
  standing["start"] = {{"v", {1.0, 0.0, 0.0, 0.0}}};
  standing["planner"]["params"]["velocity"] = {1.0, 0.0, 0.0, 0.0};
  CHECK_THAT(reason(standing),
             Catch::StartsWith("the contact is not with an obstacle that moves or appears: ") &&
                 Catch::Contains("post"));
}

TEST_CASE("damaged logs, and logs whose robot has changed, are refused", "[explain]") {
  const TemporaryFolder folder;
  const auto log = logged(folder, resting_arm(moving_ball()));
  const std::string text = read_file(log);
  const auto refused = [&](const std::string& content, const std::string& message) {
    const auto file = folder.path() / "damaged.jsonl";
    std::ofstream(file, std::ios::binary) << content;
    CHECK_THROWS_WITH(simulation::explain(file, {}), Catch::Contains(message));
  };
  refused("", "has no complete line");
  refused("not a log\n", "line 1");
  std::string altered = text;
  altered.replace(altered.find("\"type\":\"tick\""), 13, "\"type\":\"tock\"");
  refused(altered, "line 4: type \"tock\"");
  // without the last tick, which is at the contact
  const auto result = text.rfind('\n', text.size() - 2) + 1;
  const auto tick = text.rfind('\n', result - 2) + 1;
  refused(text.substr(0, tick) + text.substr(result), "expected one at the contact");

  // the result names another obstacle
  altered = text;
  const auto contact = altered.find("\"obstacle\":\"ball\"", result);
  REQUIRE(contact != std::string::npos);
  altered.replace(contact, 17, "\"obstacle\":\"bell\"");
  refused(altered, "damaged.jsonl: obstacle 'bell' is not near the arm");

  // an unfinished log has no result
  const auto cut = folder.path() / "cut.jsonl";
  std::ofstream(cut, std::ios::binary) << text.substr(0, result);
  CHECK_THAT(simulation::explain(cut, {}).nothing, Catch::Contains("no result"));

  std::ofstream(folder.path() / "robot.json", std::ios::app) << "\n";
  CHECK_THROWS_WITH(simulation::explain(log, {}), Catch::Contains("has changed"));
}
