#include "hamelin/bench/problem_set.hpp"

#include <catch2/catch.hpp>
#include <filesystem>
#include <map>

#include "hamelin/bench/families.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/sweep/judge.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::bench;

namespace {

namespace fs = std::filesystem;

const fs::path source_dir = HAMELIN_SOURCE_DIR;
const fs::path published = source_dir / "data" / "bench" / "v1.json";
// As docs/benchmark.md publishes it. It changes only with the name of the set.
const std::string published_sha256 =
    "e1440d10f3f2a4d21140cd15a27db941965fa5b8488aedf372240c35cb0e5b98";

const ProblemSet& set() {
  static const ProblemSet read = read_problem_set(published);
  return read;
}

scene::Scene make_scene(const Problem& problem, const fs::path& folder) {
  scene::ProblemOptions options;
  options.robot = set().robot.robot;
  options.spheres = set().robot.spheres;
  options.tip = set().robot.tip;
  options.resolution_m = set().resolution_m;
  options.output = folder / (problem.name + "-scene.json");
  const auto files = write_problems({problem}, folder, published.string());
  scene::make_scene_from_problem(files.front(), options);
  return scene::read_scene(options.output);
}

sweep::Verdict judge(const scene::Scene& scene, const Eigen::MatrixXd& path) {
  sweep::Judge judge(scene);
  for (Eigen::Index i = 0; i < path.cols(); ++i)
    judge.add_node(static_cast<double>(i), path.col(i));
  return judge.verdict();
}

// The clearance of the arm from the map, by the judge's own code.
double map_clearance(const scene::Scene& scene, const Eigen::VectorXd& q) {
  const sweep::JudgedArm arm(scene);
  const sweep::JudgedMap map(*scene.map);
  std::vector<Eigen::Vector3d> centers;
  arm.place(q, centers);
  double clearance = 1.0;
  for (std::size_t i = 0; i < centers.size(); ++i) {
    // balls of the base are in the list where self-collision is modelled
    if (arm.balls()[i].link < 0) continue;
    clearance = std::min(clearance, map.distance(centers[i]) - arm.balls()[i].radius);
  }
  return clearance;
}

}  // namespace

TEST_CASE("the published set has not changed", "[bench][unit]") {
  CHECK(set().sha256 == published_sha256);
  CHECK_THAT(read_file(source_dir / "docs" / "benchmark.md"), Catch::Contains(published_sha256));
  CHECK(set().problems.size() == 100);
  std::map<std::string, int> count;
  for (const auto& problem : set().problems) ++count[problem.family];
  for (const auto& family : families()) CHECK(count[family] == 10);
  CHECK(to_text(set(), published.parent_path()) == read_file(published));
  const DrawCounts& drawn = set().drawn;
  CHECK(drawn.candidates == set().problems.size() + drawn.no_start_or_goal +
                                drawn.straight_is_free + drawn.path_unknown);
}

TEST_CASE("all problems are made with the published bytes", "[bench][unit]") {
  for (const auto& problem : set().problems)
    CHECK(sha256_hex(problem_text(problem)) == problem.sha256);
}

TEST_CASE("by the judge, every problem has a solution, and its straight motion has contact",
          "[bench][unit]") {
  const test::TemporaryFolder folder;
  for (const auto& problem : set().problems) {
    CAPTURE(problem.name);
    // the judge uses the primitives, so the map may be coarse
    scene::ProblemOptions options;
    options.robot = set().robot.robot;
    options.spheres = set().robot.spheres;
    options.tip = set().robot.tip;
    options.resolution_m = 0.1;
    options.output = folder.path() / "scene.json";
    scene::make_scene_from_problem(folder.put("problem.json", problem_text(problem)), options);
    const scene::Scene scene = scene::read_scene(options.output);
    const sweep::Verdict path = judge(scene, problem.path);
    CHECK_FALSE(path.contact());
    CHECK(path.obstacles->clearance_m > 0.0);
    Eigen::MatrixXd ends(problem.path.rows(), 2);
    ends << problem.path.leftCols(1), problem.path.rightCols(1);
    CHECK(judge(scene, ends).contact());
  }
}

TEST_CASE("by the judge, start and goal keep the stated clearance from the map", "[bench][unit]") {
  const test::TemporaryFolder folder;
  Selection selection;
  selection.per_family = 1;
  for (const auto& problem : select(set(), selection)) {
    CAPTURE(problem.name);
    const scene::Scene scene = make_scene(problem, folder.path());
    CHECK(sha256_of_file(scene.map->file) == problem.map_sha256);
    CHECK(map_clearance(scene, problem.path.leftCols(1)) >= set().clearance_m - 1e-9);
    CHECK(map_clearance(scene, problem.path.rightCols(1)) >= set().clearance_m - 1e-9);
    for (const Eigen::MatrixXd& end :
         {Eigen::MatrixXd(problem.path.leftCols(1)), Eigen::MatrixXd(problem.path.rightCols(1))}) {
      const sweep::Verdict verdict = judge(scene, end);
      REQUIRE(verdict.self);
      CHECK(verdict.self->clearance_m >= set().self_clearance_m - 1e-9);
    }
  }
}

TEST_CASE("families and numbers of problems are selected", "[bench][unit]") {
  Selection selection;
  selection.families = {"cage", "shelf"};
  selection.per_family = 2;
  const auto problems = select(set(), selection);
  REQUIRE(problems.size() == 4);
  CHECK(problems[0].name == "shelf-01");
  CHECK(problems[3].name == "cage-02");
  selection.families = {"maze"};
  CHECK_THROWS_WITH(select(set(), selection), Catch::Contains("--family maze"));
}

TEST_CASE("a set with another seed, path or robot is refused by one line", "[bench][unit]") {
  const test::TemporaryFolder folder;
  const fs::path out = folder.path() / "problems";
  Problem problem = set().problems.front();
  ++problem.seed;
  CHECK_THROWS_WITH(write_problems({set().problems[1], problem}, out, "set.json"),
                    Catch::StartsWith("set.json: problem 'shelf-01': this build makes it with "
                                      "SHA-256 "));
  CHECK_FALSE(fs::exists(out));
  problem = set().problems.front();
  problem.path(0, 0) += 1e-4;
  CHECK_THROWS_AS(write_problems({problem}, out, "set.json"), Error);

  folder.put("robots/arm7.urdf", read_file(set().robot.robot) + "\n");
  folder.put("robots/arm7.spheres.json", read_file(set().robot.spheres));
  const fs::path copy = folder.put("bench/v1.json", read_file(published));
  CHECK_THROWS_WITH(read_problem_set(copy),
                    Catch::Contains("arm7.urdf: SHA-256 is ") && Catch::Contains(", expected "));
  folder.put("robots/arm7.urdf", read_file(set().robot.robot));
  CHECK_NOTHROW(read_problem_set(copy));
  Json document = read_json(copy);
  document["problems"][1]["name"] = document["problems"][0]["name"];
  folder.put("bench/v1.json", document.dump());
  CHECK_THROWS_WITH(read_problem_set(copy), Catch::Contains("/problems/1/name: 'shelf-01' occurs "
                                                            "twice"));
  document["problems"].erase(1);
  document["problems"][0]["path"][1].erase(0);
  folder.put("bench/v1.json", document.dump());
  CHECK_THROWS_WITH(read_problem_set(copy), Catch::Contains("/problems/0/path/1: 6 values given"));
  document["problems"][0]["family"] = "maze";
  folder.put("bench/v1.json", document.dump());
  CHECK_THROWS_WITH(read_problem_set(copy), Catch::Contains("family 'maze' is not known"));
  document["problems"][0].erase("seed");
  folder.put("bench/v1.json", document.dump());
  CHECK_THROWS_WITH(read_problem_set(copy), Catch::Contains("/problems/0"));
}

TEST_CASE("a plan with another map is refused", "[bench][unit]") {
  const Problem& problem = set().problems.front();
  sweep::Plan plan;
  plan.inputs.push_back({"scenes/" + problem.name + ".bt", problem.map_sha256});
  CHECK_NOTHROW(check_maps({problem}, plan, "set.json"));
  plan.inputs.front().sha256[0] = plan.inputs.front().sha256[0] == '0' ? '1' : '0';
  CHECK_THROWS_WITH(check_maps({problem}, plan, "set.json"),
                    Catch::StartsWith("set.json: the map of problem 'shelf-01'"));
}
