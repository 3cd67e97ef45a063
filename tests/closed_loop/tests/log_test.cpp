#include <catch2/catch.hpp>
#include <cmath>
#include <map>

#include "../scratch_scene.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/log/read_log.hpp"

using namespace hamelin;
using test::ball;
using test::run_scene;
using test::scene_52;
using test::TemporaryFolder;

namespace {

Json logged_scene(const Json& planner) {
  Json scene = scene_52();
  scene["obstacles"] = Json::array({ball("obstacle", 2.4, 2.2, 0.25)});
  scene["planner"] = planner;
  scene["step_s"] = 0.001;
  scene["duration_s"] = 2.5;
  return scene;
}

std::vector<Json> ticks_of(const TemporaryFolder& folder, const Json& scene, long every,
                           Json* result = nullptr) {
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  watch.every = every;
  (void)run_scene(folder, scene, watch);
  std::vector<Json> ticks;
  for (auto& line : log::read_log(log.file()).lines)
    if (line["type"] == "tick")
      ticks.push_back(std::move(line));
    else if (line["type"] == "result" && result != nullptr)
      *result = std::move(line);
  return ticks;
}

const Json gyro_published{{"name", "gyro"}, {"params", {{"algorithm", "published"}}}};

// The sum that stays constant, see docs/logs.md.
double balance(const Json& tick) {
  const auto energy = [&](const char* key) { return tick["energy"][key].get<double>(); };
  return energy("kinetic_J") + energy("potential_J") + energy("control_J") -
         energy("gyroscopic_work_J") - energy("held_work_J") + energy("dissipated_J") -
         energy("node_work_J");
}

}  // namespace

TEST_CASE("the logged torques are those that move the arm, in every channel", "[simulation][log]") {
  const TemporaryFolder folder;
  const model::Model model(test::planar4(), geometry::SE3{}, Eigen::Vector3d::Zero());
  dynamics::Workspace ws(model);
  const std::vector<std::pair<Json, std::vector<std::string>>> planners = {
      {{{"name", "apf"},
        {"params",
         {{"algorithm", "published"},
          {"mapping", "potential"},
          {"k_p", 5.0},
          {"eta", 1.0},
          {"joint_damping", 1.0}}}},
       {"potential", "damping"}},
      {gyro_published, {"held", "damping", "gyroscopic"}},
      {{{"name", "hybrid"}}, {"node"}}};
  for (const auto& [planner, channels] : planners) {
    CAPTURE(planner);
    const auto ticks = ticks_of(folder, logged_scene(planner), 1);
    REQUIRE(ticks.size() > 500);
    std::map<std::string, int> seen;
    double largest = 0.0, scale = 0.0;
    for (std::size_t i = 0; i + 2 < ticks.size(); ++i) {
      const auto q = test::vector_of(ticks[i]["q"]), v = test::vector_of(ticks[i]["v"]),
                 tau = test::vector_of(ticks[i]["tau"]);
      Eigen::VectorXd sum = Eigen::VectorXd::Zero(4), expected(4);
      for (const auto& [channel, torque] : ticks[i]["channels"].items()) {
        sum += test::vector_of(torque);
        ++seen[channel];
      }
      REQUIRE((sum - tau).norm() <= 1e-12 * (1.0 + tau.norm()));
      const Eigen::VectorXd moved = (test::vector_of(ticks[i + 1]["v"]) - v) / 0.001;
      dynamics::forward_dynamics(model, ws, q, v, tau, expected);
      largest = std::max(largest, (moved - expected).norm());
      scale = std::max(scale, expected.norm());
    }
    CAPTURE(largest, scale);
    CHECK(scale > 0.5);
    CHECK(largest < 0.05 * scale);  // one step's change of the acceleration
    for (const auto& channel : channels) CHECK(seen[channel] > 0);
  }
}

TEST_CASE("the energies in a log balance at every tick, including the last, in every channel",
          "[simulation][log]") {
  const TemporaryFolder folder;
  Json potential = {
      {"name", "apf"},
      {"params",
       {{"algorithm", "published"}, {"mapping", "potential"}, {"k_p", 5.0}, {"eta", 1.0}}}};
  for (const Json& planner : {potential, gyro_published, Json{{"name", "hybrid"}}}) {
    CAPTURE(planner);
    const auto ticks = ticks_of(folder, logged_scene(planner), 1);
    double error = 0.0, work = 0.0;
    for (const auto& tick : ticks) {
      error = std::max(error, std::abs(balance(tick) - balance(ticks[0])));
      for (const char* key : {"held_work_J", "node_work_J", "control_J"})
        work = std::max(work, std::abs(tick["energy"][key].get<double>()));
    }
    CHECK(work > 0.1);
    CHECK(error < 1e-3 * work);
  }
}

TEST_CASE("the extrema in a log with fewer ticks are those of the ticks between",
          "[simulation][log]") {
  const TemporaryFolder folder;
  const Json scene = logged_scene(gyro_published);
  Json result;
  const auto all = ticks_of(folder, scene, 1), few = ticks_of(folder, scene, 37, &result);
  REQUIRE(few.size() == (all.size() - 1 + 36) / 37 + 1);
  CHECK_FALSE(all[1].contains("extrema"));
  CHECK_FALSE(few[0].contains("extrema"));
  std::size_t from = 1;
  for (std::size_t i = 1; i < few.size(); ++i) {
    const Json& extrema = few[i]["extrema"];
    double clearance = 1e9, error = 0.0, speed = 0.0;
    int updates = 0;
    const auto to = few[i]["k"].get<std::size_t>();
    for (std::size_t k = from; k <= to; ++k) {
      clearance = std::min(clearance, all[k]["clearance_m"].get<double>());
      error = std::max(error, std::abs(balance(all[k]) - balance(all[0])));
      speed = std::max(speed, std::abs(all[k]["v"][2].get<double>()));
      updates = std::max(updates, all[k]["solver"]["updates"].get<int>());
    }
    CAPTURE(from, to);
    CHECK(extrema["clearance_m"] == clearance);
    CHECK(extrema["energy_error_J"].get<double>() == Approx(error).margin(1e-15));
    CHECK(extrema["v_abs"][2] == speed);
    CHECK(extrema["updates"] == updates);
    CHECK(few[i]["q"] == all[to]["q"]);
    from = to + 1;
  }
  double fastest = 0.0;
  for (const auto& tick : all) fastest = std::max(fastest, std::abs(tick["v"][2].get<double>()));
  CHECK(result["v_abs_max"][2] == fastest);
}

TEST_CASE("series that a planner declares are in the header and in each tick",
          "[simulation][log]") {
  const TemporaryFolder folder;
  Json scene = logged_scene({{"name", "probe"}, {"params", {{"series", true}}}});
  scene["duration_s"] = 0.01;
  log::RunLog log(folder.path() / "run.jsonl");
  simulation::Watch watch;
  watch.log = &log;
  const log::Result result = run_scene(folder, scene, watch);
  std::size_t ticks = 0;
  for (const auto& line : log::read_log(log.file()).lines) {
    log::check_line(line, "line");
    if (line["type"] == "header")
      CHECK(line["series"] == Json::parse(R"([{"name": "time", "unit": "s"},
                                              {"name": "even ticks", "unit": ""}])"));
    if (line["type"] != "tick" || !line.contains("channels")) continue;
    const long k = line["k"].get<long>();
    CHECK(line["series"] == Json::array({line["time_s"], k % 2 == 0 ? Json(2.0) : Json(nullptr)}));
    ++ticks;
  }
  CHECK(ticks == 10);

  scene["planner"]["params"] = Json::object();
  for (const auto& tick : ticks_of(folder, scene, 1)) CHECK_FALSE(tick.contains("series"));
  // the time of the planner is in the result, with the period as its deadline
  REQUIRE(result.planner_us.has_value());
  CHECK(result.planner_us->max >= result.planner_us->p50);
  CHECK(result.deadline_us == Approx(1000.0));
  scene["actuation"] = {{"deadline_s", 1e-9}};
  const log::Result late = run_scene(folder, scene);
  CHECK(late.deadline_us == Approx(1e-3));
  CHECK(late.late_ticks == 10);  // no planner answers within a nanosecond
  CHECK(late.outcome == result.outcome);
}

TEST_CASE("lines that a planner draws are in the next tick that is logged", "[simulation][log]") {
  const TemporaryFolder folder;
  Json scene = logged_scene({{"name", "probe"}, {"params", {{"draw_every", 4}}}});
  scene["duration_s"] = 0.012;
  std::vector<long> drawn;
  for (const auto& tick : ticks_of(folder, scene, 1))
    if (tick.contains("paths")) {
      const long k = tick["k"].get<long>();
      drawn.push_back(k);
      log::check_line(tick, "line");
      CHECK(tick["paths"] == Json({{k, 0.0, 0.1235, k, 1.0, 0.0}, {-k, 0.0, 0.0}}));
    }
  CHECK(drawn == std::vector<long>{0, 4, 8});
  // of the drawings since the last line, the last one
  drawn.clear();
  for (const auto& tick : ticks_of(folder, scene, 9))
    if (tick.contains("paths")) drawn.push_back(tick["paths"][0][0].get<long>());
  CHECK(drawn == std::vector<long>{0, 8});
}
