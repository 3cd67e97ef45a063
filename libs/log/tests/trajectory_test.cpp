#include "hamelin/log/trajectory.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/test/temporary.hpp"
#include "ticks.hpp"

using namespace hamelin;
using Catch::Matchers::Contains;

namespace {

std::filesystem::path file() {
  return test::temporary("run.jsonl.zst");
}

// Two joints, q = (t³, 1 − t²), so that cubic interpolation is exact.
log::Trajectory::Point at(double t) {
  log::Trajectory::Point point;
  point.time_s = t;
  point.q = Eigen::Vector2d(t * t * t, 1.0 - t * t);
  point.v = Eigen::Vector2d(3.0 * t * t, -2.0 * t);
  point.tau = Eigen::Vector2d(t, 0.0);
  return point;
}

void write_log(const std::vector<double>& times) {
  log::RunLog record(file());
  record.write("header", {{"program", "run"},
                          {"scene", "a.json"},
                          {"every", 1},
                          {"config", Json::object()},
                          {"joints",
                           {{{"name", "shoulder"}, {"type", "revolute"}},
                            {{"name", "rail, left"}, {"type", "prismatic"}}}},
                          {"provenance", Json::object()}});
  long k = 0;
  for (const double t : times) {
    const auto point = at(t);
    const auto array = [](const Eigen::VectorXd& x) { return Json({x[0], x[1]}); };
    Json fields = test::tick(k++);
    fields["time_s"] = t;
    fields["q"] = array(point.q);
    fields["v"] = array(point.v);
    fields["tau"] = array(point.tau);
    record.write("tick", fields);
  }
}

}  // namespace

TEST_CASE("a trajectory is the ticks of its log, bit for bit", "[log][trajectory]") {
  write_log({0.0, 0.1, 0.3});
  const auto trajectory = log::read_trajectory(file());
  CHECK(trajectory.joints == std::vector<std::string>{"shoulder", "rail, left"});
  REQUIRE(trajectory.points.size() == 3);
  for (const auto& point : trajectory.points) {
    CHECK(point.q == at(point.time_s).q);
    CHECK(point.v == at(point.time_s).v);
    CHECK(point.tau == at(point.time_s).tau);
  }
}

TEST_CASE("resampling reproduces a cubic motion and both ends", "[log][trajectory]") {
  write_log({0.0, 0.1, 0.3, 0.35, 1.0});
  const auto fine = log::resampled(log::read_trajectory(file()), 64.0);
  REQUIRE(fine.points.size() == 65);
  for (std::size_t i = 0; i < fine.points.size(); ++i) {
    const auto& point = fine.points[i];
    CHECK(point.time_s == Approx(static_cast<double>(i) / 64.0).margin(1e-15));
    CHECK((point.q - at(point.time_s).q).norm() < 1e-14);
    CHECK((point.v - at(point.time_s).v).norm() < 1e-13);
  }
  CHECK(fine.points.back().time_s == 1.0);
  const auto coarse = log::resampled(log::read_trajectory(file()), 0.7);
  REQUIRE(coarse.points.size() == 2);
  CHECK(coarse.points[1].time_s == 1.0);
  CHECK_THROWS_AS(log::resampled(fine, 0.0), Error);
  CHECK_THROWS_AS(log::resampled(fine, std::nan("")), Error);
}

TEST_CASE("CSV names its columns, quotes names where needed, and its numbers read back",
          "[log][trajectory]") {
  write_log({0.0, 0.1});
  const std::string text = log::to_csv(log::read_trajectory(file()));
  std::istringstream lines(text);
  std::string line;
  std::getline(lines, line);
  CHECK(
      line ==
      R"(time_s,q_shoulder,"q_rail, left",v_shoulder,"v_rail, left",tau_shoulder,"tau_rail, left")");
  std::getline(lines, line);
  std::getline(lines, line);
  std::vector<double> numbers;
  std::istringstream cells(line);
  for (std::string cell; std::getline(cells, cell, ',');) numbers.push_back(std::stod(cell));
  const auto point = at(0.1);
  CHECK(numbers == std::vector<double>{0.1, point.q[0], point.q[1], point.v[0], point.v[1],
                                       point.tau[0], point.tau[1]});
}

TEST_CASE("a joint trajectory has ROS's fields and strictly increasing times",
          "[log][trajectory]") {
  write_log({0.0, 0.1, 1.9999999999});
  auto trajectory = log::read_trajectory(file());
  const Json message = log::to_joint_trajectory(trajectory);
  CHECK(message["joint_names"] == Json({"shoulder", "rail, left"}));
  REQUIRE(message["points"].size() == 3);
  CHECK(message["points"][1]["positions"].size() == 2);
  CHECK(message["points"][1]["effort"][0] == 0.1);
  CHECK(message["points"][1]["time_from_start"] == Json({{"sec", 0}, {"nanosec", 100000000}}));
  CHECK(message["points"][2]["time_from_start"] == Json({{"sec", 2}, {"nanosec", 0}}));
  CHECK(message["header"]["frame_id"] == "");
  trajectory.points[1].v[0] = std::numeric_limits<double>::quiet_NaN();
  CHECK_THROWS_WITH(log::to_joint_trajectory(trajectory), Contains("v at 0.1 s: is not finite"));
  CHECK_THAT(log::to_csv(trajectory), Contains(",,"));
}

TEST_CASE("files that are not logs of a motion are refused", "[log][trajectory]") {
  write_log({});
  CHECK_THROWS_WITH(log::read_trajectory(file()), Contains("has no ticks"));
  write_log({0.0, 0.2, 0.1});
  CHECK_THROWS_WITH(log::read_trajectory(file()),
                    Contains("line 4: /time_s") && Contains("increasing"));
  std::ofstream(file()) << "{\"schema\":\"hamelin.scene/1\"}\n";
  CHECK_THROWS_WITH(log::read_trajectory(file()), Contains("no header"));
}
