#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/control/plan_paths.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/read_log.hpp"
#include "hamelin/search/search.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;

namespace {

scene::Scene shelf(const std::vector<std::string>& settings) {
  const std::filesystem::path file =
      std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/scenes/shelf.json";
  Json document = read_json(file);
  for (const auto& setting : settings) scene::set_pointer(document, setting);
  return scene::scene_from_json(document, file.parent_path(), file.string());
}

log::Result run(const std::vector<std::string>& settings, const simulation::Watch& watch = {}) {
  return simulation::run(shelf(settings), {HAMELIN_TEST_PLUGIN_DIR}, watch);
}

std::vector<Json> logged_ticks(const std::vector<std::string>& settings) {
  const test::TemporaryFolder folder;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  watch.every = 10;
  (void)run(settings, watch);
  std::vector<Json> ticks;
  for (auto& line : log::read_log(log.file()).lines)
    if (line["type"] == "tick" || line["type"] == "event") {
      line.erase("timing");
      ticks.push_back(std::move(line));
    }
  return ticks;
}

const std::string connect = "/planner/guide=rrt-connect";

}  // namespace

TEST_CASE("planners reach all goals on searched paths, clear and certified",
          "[closed_loop][guide]") {
  const auto planner = GENERATE(as<std::string>{}, "hybrid", "mppi", "apf");
  CAPTURE(planner);
  // one asks for paths, the other is given its way-points
  const std::string type = planner == "apf" ? "rrt-connect" : "on-request";
  const log::Result result = run(
      {R"(/planner={"name": ")" + planner + R"("})", "/planner/guide=" + type, "/duration_s=60"});
  CHECK(result.outcome == log::Outcome::reached);
  CHECK(*result.min_clearance_m > 0.0);
  CHECK(result.certified_share == 1.0);
  REQUIRE(result.guide);
  CHECK(result.guide->type == type);
  CHECK(result.guide->searches >= 5);  // one per goal
  CHECK(result.guide->found == result.guide->searches);
  CHECK(result.guide->kept == 0);
  CHECK(*result.guide->length > 0.0);
}

TEST_CASE("who asks for paths gets none where the scene has no guide", "[closed_loop][guide]") {
  const log::Result result = run({"/planner/guide=none", "/duration_s=1"});
  CHECK_FALSE(result.guide);
}

TEST_CASE("a planner that is to escape by itself asks for no paths", "[closed_loop][guide]") {
  const log::Result result = run({"/planner/params/escape=none", "/duration_s=1"});
  REQUIRE(result.guide);
  CHECK(result.guide->searches == 0);
}

TEST_CASE("guided runs repeat themselves to the byte", "[closed_loop][guide]") {
  const std::vector<Json> first = logged_ticks({connect}), again = logged_ticks({connect});
  REQUIRE(first.size() > 100);
  CHECK(first == again);
  CHECK(first != logged_ticks({connect, "/seed=2"}));
}

TEST_CASE("the charge of a search delays its path", "[closed_loop][guide]") {
  const std::string one_goal =
      R"(/goals=[{"type": "joint", "q": [0.3, -0.4, 0, -1.5, 0, 1.4, 0]}])";
  for (const double check_s : {0.0, 1e-4, 1e-3}) {
    CAPTURE(check_s);
    const log::Result result =
        run({connect, one_goal, "/planner/guide_options/check_time_s=" + std::to_string(check_s)});
    CHECK(result.outcome == log::Outcome::reached);
    REQUIRE(result.guide);
    CHECK(result.guide->searches == 1);
    // docs/theory.md (17.5); an answer arrives at the next tick
    const double charge = check_s * static_cast<double>(result.guide->checks);
    CHECK(result.guide->waited_s >= charge - 1e-9);
    CHECK(result.guide->waited_s < charge + 0.0025);
  }
}

TEST_CASE("a guided run whose map changes in its way searches again", "[closed_loop][guide]") {
  const scene::Scene scene = shelf({connect});
  const control::PathPlan plan = control::plan_paths(scene);
  REQUIRE(plan.found());
  CHECK(plan.goals.size() == 5);
  // A change far away from the arm: the paths stay clear.
  const std::string map = R"(/map/changes=[{"time_s": 0.5, "occupied_boxes_m": [[)";
  const log::Result away = run({connect, map + R"(-0.8, -0.8, 0.0, -0.78, -0.78, 0.02]]}])"});
  CHECK(away.outcome == log::Outcome::reached);
  REQUIRE(away.guide);
  CHECK(away.guide->kept == 1);
  CHECK(away.guide->searches == 5);
}

TEST_CASE("maps that change in the way of a proved path stop the arm, or lead it around",
          "[closed_loop][guide]") {
  const std::string sampled = R"(/actuation={"type": "sampled", "control_period_s": 0.001})";
  const std::vector<Json> ticks = logged_ticks({sampled});
  const scene::Scene scene = shelf({});
  const model::Model arm = control::load_model(scene);
  dynamics::Workspace ws(arm);
  const auto tip_at = [&](double time_s) {
    const auto at = std::find_if(ticks.begin(), ticks.end(), [&](const Json& line) {
      return line["type"] == "tick" && line["time_s"] >= time_s;
    });
    REQUIRE(at != ticks.end());
    const auto q = (*at)["q"].get<std::vector<double>>();
    dynamics::forward_kinematics(arm, ws, Eigen::Map<const Eigen::VectorXd>(q.data(), arm.dof()));
    return Eigen::Vector3d(dynamics::tip_pose(arm, ws).p());
  };
  int blocked = 0, reached = 0, led_around = 0;
  for (int k = 0; k < 20; ++k) {
    const double time_s = 0.1 + 0.2 * k;
    CAPTURE(time_s);
    const Eigen::Vector3d tip = tip_at(time_s + 0.25);
    if ((tip - tip_at(time_s)).norm() < 0.15) continue;  // in or beside the arm as it is
    ++blocked;
    Json box = Json::array();
    for (const double half : {-0.015, 0.015})
      for (int i = 0; i < 3; ++i) box.push_back(tip[i] + half);
    const Json change{{{"time_s", time_s}, {"occupied_boxes_m", Json::array({box})}}};
    const log::Result result = run({sampled, "/map/changes=" + change.dump(), "/duration_s=8"});
    REQUIRE(result.shield);
    CHECK((result.outcome != log::Outcome::collision || result.shield->overtaken > 0));
    if (result.outcome == log::Outcome::collision) continue;
    CHECK(result.certified_share == 1.0);
    reached += result.outcome == log::Outcome::reached ? 1 : 0;
    led_around += result.guide->searches > 5 ? 1 : 0;
  }
  CHECK(blocked >= 6);
  CHECK(2 * reached > blocked);
  CHECK(2 * led_around > blocked);
}

TEST_CASE("plans have a certificate for each line and chain from goal to goal",
          "[closed_loop][guide]") {
  const control::PathPlan plan = control::plan_paths(shelf({connect}));
  const Json document = control::to_json(plan);
  check_shipped_schema(document, "path", "plan");
  for (std::size_t i = 0; i < plan.goals.size(); ++i) {
    const Eigen::MatrixXd& points = plan.goals[i].path.points;
    REQUIRE(plan.goals[i].clearance_m.size() + 1 == static_cast<std::size_t>(points.cols()));
    for (const double clearance : plan.goals[i].clearance_m) CHECK(clearance > 0.0);
    if (i > 0) CHECK(points.col(0) == plan.goals[i - 1].path.points.rightCols(1));
  }
  const Json again = control::to_json(control::plan_paths(shelf({connect})));
  CHECK(again["paths"][0]["q"] == document["paths"][0]["q"]);
  CHECK(test::error_of([] { (void)control::plan_paths(shelf({"/planner/guide=none"})); })
            .ends_with("shelf.json: /planner/guide: is none, expected on-request or "
                       "rrt-connect"));
}
