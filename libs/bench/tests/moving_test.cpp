#include "hamelin/bench/moving.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <map>
#include <numbers>
#include <set>

#include "hamelin/bench/families.hpp"
#include "hamelin/bench/moving_scene.hpp"
#include "hamelin/bench/results.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::bench;
using Eigen::Vector3d;

namespace {

namespace fs = std::filesystem;

const fs::path sources = HAMELIN_SOURCE_DIR;
const fs::path moving_file = sources / "data" / "bench" / "moving.json";
// As docs/benchmark.md publishes it. It changes only with the name of the set.
const std::string moving_sha256 =
    "ff24d526bdae45beb086d2974131d077f7c553266ee6b9c9a02f19d6d330436e";

const ProblemSet& moving_set() {
  static const ProblemSet read = read_problem_set(moving_file);
  return read;
}

const sweep::JudgedArm& arm() {
  static const sweep::JudgedArm judged = judged_arm(moving_set().robot);
  return judged;
}

std::vector<Problem> first_of_each_cell(std::size_t count) {
  Selection selection;
  selection.per_cell = count;
  return select(moving_set(), selection);
}

scene::Scene scene_of(const Problem& problem, const fs::path& folder) {
  return scene::read_scene(
      write_moving_scenes(moving_set(), {problem}, {std::nullopt}, folder, moving_file.string())
          .front());
}

// The points of an obstacle that are fastest: corners of a box, ends of a capsule. The surface of a
// sphere is as fast as its centre, as spheres do not turn.
std::vector<Vector3d> outer_points(const scene::Obstacle& o) {
  if (o.shape == scene::Shape::sphere) return {Vector3d::Zero()};
  if (o.shape == scene::Shape::capsule) {
    const double end = 0.5 * o.length_m;
    return {{0, 0, end}, {0, 0, -end}, {o.radius_m, 0, end}, {-o.radius_m, 0, -end}};
  }
  std::vector<Vector3d> corners;
  for (const double x : {-0.5, 0.5})
    for (const double y : {-0.5, 0.5})
      for (const double z : {-0.5, 0.5})
        corners.emplace_back(o.size_m.cwiseProduct(Vector3d(x, y, z)));
  return corners;
}

// The largest speed of a point between samples 5 ms apart [m/s].
double sampled_speed(const scene::Obstacle& o, double until_s) {
  constexpr double step_s = 5e-3;
  const auto points = outer_points(o);
  double most = 0.0;
  for (double t = 0.0; t < until_s; t += step_s)
    for (const auto& p : points)
      most = std::max(
          most,
          (scene::motion_at(o, t + step_s).pose * p - scene::motion_at(o, t).pose * p).norm() /
              step_s);
  return most;
}

}  // namespace

TEST_CASE("the published set of moving obstacles has not changed", "[bench][unit]") {
  CHECK(moving_set().sha256 == moving_sha256);
  CHECK_THAT(read_file(sources / "docs" / "benchmark.md"), Catch::Contains(moving_sha256));
  CHECK(to_text(moving_set(), moving_file.parent_path()) == read_file(moving_file));
  std::map<std::string, std::size_t> count;
  for (const auto& problem : moving_set().problems) ++count[problem.family];
  for (const auto& family : moving_families()) CHECK(count[family] == 10 * cells(family).size());
}

TEST_CASE("problems with moving obstacles are made with the published bytes", "[bench][unit]") {
  for (const auto& problem : first_of_each_cell(1)) {
    CAPTURE(problem.name);
    CHECK(sha256_hex(moving_problem_text(problem, arm())) == problem.sha256);
  }
}

TEST_CASE("another seed gives other obstacles", "[bench][unit]") {
  std::set<std::string> texts;
  for (Problem problem : first_of_each_cell(1)) {
    if (problem.obstacles == 0) continue;
    texts.insert(moving_problem_text(problem, arm()));
    problem.seed += 1'000'000'000;
    texts.insert(moving_problem_text(problem, arm()));
  }
  CHECK(texts.size() == 2 * (first_of_each_cell(1).size() - 1));
  CHECK_THROWS_AS(cells("crowds"), Error);
  CHECK_THROWS_AS(describe_movers("shelf"), Error);
}

TEST_CASE("start and goal are clear at the start, and no obstacle is faster than stated",
          "[bench][unit]") {
  const test::TemporaryFolder folder;
  for (const auto& problem : first_of_each_cell(1)) {
    CAPTURE(problem.name);
    const scene::Scene scene = scene_of(problem, folder.path());
    const auto feasible = sweep::feasibility(scene, {});
    CHECK(feasible.feasible);
    CAPTURE(feasible.reason);
    double fastest = 0.0;
    std::size_t movers = 0;
    for (const auto& o : scene.obstacles) {
      if (!o.motion) continue;
      ++movers;
      CAPTURE(o.name);
      const double speed = sampled_speed(o, scene.duration_s);
      CHECK(speed <= problem.speed_max_m_s + 1e-3);
      fastest = std::max(fastest, speed);
    }
    // people have four limbs that move
    CHECK(movers == problem.obstacles * (problem.family == "people" ? 4 : 1));
    if (problem.obstacles > 0) CHECK(fastest > 0.4 * problem.speed_max_m_s);
  }
}

TEST_CASE("cubes stay in the workspace and away from the base of the arm", "[bench][unit]") {
  const test::TemporaryFolder folder;
  // half the time of a turn at the largest speed: the centre cuts corners by less
  constexpr double corner_s = 0.06;
  // by which curves between way-points may leave the lines and turns that they are made from
  constexpr double curve_m = 5e-3;
  for (const auto& problem : first_of_each_cell(1)) {
    if (problem.family != "cubes") continue;
    CAPTURE(problem.name);
    const double corner_m = corner_s * problem.speed_max_m_s;
    for (const auto& cube : scene_of(problem, folder.path()).obstacles) {
      if (!cube.motion) continue;
      const double side = cube.size_m.x(), base_m = 0.12 + side * std::numbers::sqrt3;
      CAPTURE(cube.name, side);
      CHECK((side >= 0.01 && side <= 0.1));
      double way_m = 0.0;
      for (double t = 0.0; t <= 10.0; t += 0.01) {
        const Vector3d p = scene::motion_at(cube, t).pose.p(), center(0.0, 0.0, 0.267);
        REQUIRE((p - center).norm() <= 1.5 + curve_m);
        REQUIRE(p.z() >= -curve_m);
        REQUIRE((p - center).norm() >= base_m - corner_m - curve_m);
        if (p.z() < center.z()) REQUIRE(p.head<2>().norm() >= base_m - corner_m - curve_m);
        way_m += (scene::motion_at(cube, t + 0.01).pose.p() - p).norm();
      }
      // A cube moves all the time, at its own speed but for turns.
      CHECK(way_m <= 10.01 * problem.speed_max_m_s);
    }
  }
}

TEST_CASE("people and pendulums never touch an arm that stays at its start or goal",
          "[bench][unit]") {
  const test::TemporaryFolder folder;
  for (const auto& problem : first_of_each_cell(1)) {
    if (problem.family == "cubes") continue;
    CAPTURE(problem.name);
    const scene::Scene scene = scene_of(problem, folder.path());
    for (const Eigen::VectorXd& q :
         {Eigen::VectorXd(problem.path.leftCols(1)), Eigen::VectorXd(problem.path.rightCols(1))}) {
      sweep::Judge judge(scene);
      for (double t = 0.0; t < scene.duration_s; t += 0.04) judge.add_node(t, q);
      CHECK(judge.verdict().obstacles->clearance_m > 0.02);
    }
  }
}

TEST_CASE("the obstacles are in the way: the straight joint motion meets some of them",
          "[bench][unit]") {
  const test::TemporaryFolder folder;
  std::size_t met = 0, all = 0;
  for (const auto& problem : first_of_each_cell(1)) {
    if (problem.obstacles == 0) continue;
    ++all;
    sweep::Judge judge(scene_of(problem, folder.path()));
    constexpr double duration_s = 4.0;
    for (int i = 0; i <= 100; ++i) {
      const double s = i / 100.0;
      judge.add_node(s * duration_s,
                     (1.0 - s) * problem.path.leftCols(1) + s * problem.path.rightCols(1));
    }
    if (judge.verdict().contact()) ++met;
  }
  CAPTURE(met, all);
  CHECK(3 * met > all);
}

TEST_CASE("another prediction changes what planners are told and nothing else", "[bench][unit]") {
  const test::TemporaryFolder folder;
  Selection selection;
  selection.families = {"pendulums"};
  selection.per_family = 1;
  const auto problems = select(moving_set(), selection);
  const auto files =
      write_moving_scenes(moving_set(), problems,
                          {std::nullopt, scene::Prediction::path, scene::Prediction::speed_bound},
                          folder.path(), moving_file.string());
  REQUIRE(files.size() == 3);
  CHECK(files[2].filename() == problems[0].name + "-speed-bound.json");
  Json drawn = read_json(files[0]), told = read_json(files[2]);
  for (std::size_t i = 1; i < drawn["obstacles"].size(); ++i) {
    CHECK(drawn["obstacles"][i]["prediction"] == "constant-acceleration");
    const double bound = told["obstacles"][i]["prediction"]["speed_max"];
    CHECK(bound <= 1.02 * problems[0].speed_max_m_s + 0.01);
    for (Json* document : {&drawn, &told}) (*document)["obstacles"][i].erase("prediction");
  }
  CHECK(drawn == told);
  CHECK(scene::read_scene(files[1]).obstacles[1].prediction == scene::Prediction::path);
}

TEST_CASE("sets say which problems have maps, and changed seeds are refused", "[bench][unit]") {
  const test::TemporaryFolder folder;
  for (const char* file : {"robots/desk6.urdf", "robots/desk6.spheres.json"})
    folder.put(file, read_file(sources / "data" / file));
  const fs::path copy = folder.put("bench/moving.json", read_file(moving_file));
  Json document = read_json(copy);
  document["problems"][0]["map_sha256"] = std::string(64, '0');
  folder.put("bench/moving.json", document.dump());
  CHECK_THAT(test::error_of([&] { (void)read_problem_set(copy); }),
             Catch::EndsWith("/problems/0/map_sha256: is given, expected none of the family "
                             "'cubes'"));
  document["problems"][0].erase("map_sha256");
  Json& last = document["problems"].back();
  last["seed"] = last["seed"].get<std::uint64_t>() + 1;
  folder.put("bench/moving.json", document.dump());
  const ProblemSet changed = read_problem_set(copy);
  CHECK_THAT(test::error_of([&] {
               (void)write_moving_scenes(changed, {changed.problems.back()}, {std::nullopt},
                                         folder.path() / "out", copy.string());
             }),
             Catch::Contains("this build makes it with SHA-256"));
  CHECK_FALSE(fs::exists(folder.path() / "out"));
}
