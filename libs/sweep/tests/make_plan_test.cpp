#include "hamelin/sweep/make_plan.hpp"

#include <unistd.h>

#include <algorithm>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <map>
#include <set>
#include <string>
#include <vector>

#include "../src/sphere_on_path.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/judge.hpp"
#include "hamelin/test/temporary.hpp"

using namespace hamelin;
using namespace hamelin::sweep;

namespace {

namespace fs = std::filesystem;

const fs::path source_dir = HAMELIN_SOURCE_DIR;
const std::vector<fs::path> plugin_directories{HAMELIN_TEST_PLUGIN_DIR};

/// A directory with two small problems for arm7: one that hybrid can solve, and one whose goal is
/// inside a wall.
class Bench {
 public:
  Bench() {
    const Json home{0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785},
        away{1.2, -0.4, 0.0, -2.0, 0.0, 1.571, 0.785};
    const auto box = [](const Json& at) {
      return Json{{"name", "wall"},
                  {"type", "box"},
                  {"position", at},
                  {"quaternion_wxyz", {1, 0, 0, 0}},
                  {"size", {0.1, 0.1, 0.1}}};
    };
    put("free.json", {{"name", "free"},
                      {"family", "walls"},
                      {"start", home},
                      {"goal", away},
                      {"obstacles", {box({0.9, -0.9, 0.1})}}});
    put("blocked.json", {{"name", "blocked"},
                         {"family", "walls"},
                         {"start", home},
                         {"goal", away},
                         {"obstacles", {box({0.12, 0.31, 0.55}), box({0.2, 0.5, 0.5})}}});
  }
  void put(const std::string& file, const Json& document) const {
    folder_.put(file, document.dump());
  }
  [[nodiscard]] PlanOptions problems() const {
    PlanOptions options;
    options.files = {root_ / "free.json", root_ / "blocked.json"};
    options.problem.robot = source_dir / "data/robots/arm7.urdf";
    options.problem.spheres = source_dir / "data/robots/arm7.spheres.json";
    options.problem.tip = "flange";
    options.problem.resolution_m = 0.02;
    options.plugin_directories = plugin_directories;
    return options;
  }
  [[nodiscard]] fs::path dir(const std::string& name) const { return root_ / name; }

 private:
  test::TemporaryFolder folder_;
  fs::path root_ = folder_.path();
};

/// All files below a directory with their bytes.
std::map<std::string, std::string> bytes_below(const fs::path& directory) {
  std::map<std::string, std::string> all;
  for (const auto& entry : fs::recursive_directory_iterator(directory))
    if (entry.is_regular_file())
      all[entry.path().lexically_relative(directory).string()] = read_file(entry.path());
  return all;
}

std::string message_of(const fs::path& directory, const PlanOptions& options) {
  try {
    (void)make_plan(directory, options);
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

}  // namespace

TEST_CASE("a plan has each problem, goal, planner, combination of values and seed once",
          "[sweep][unit]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.goals = {scene::GoalType::joint, scene::GoalType::pose};
  options.planners = {"hybrid", "apf:k_p=3,law=wang2018"};
  options.vary = {"/step_s=0.001,0.002", "/model/joint_damping=0,[1,1,1,1,1,1,1],2"};
  options.set = {"/model/self_collision=false"};
  options.seeds = {1, 2};
  options.duration_s = 5.0;
  const Plan plan = make_plan(bench.dir("a"), options);
  CHECK(plan.scenes.size() == 4);
  CHECK(plan.runs.size() == 2 * 2 * 2 * 2 * 3 * 2);
  std::set<std::string> ids;
  std::map<std::string, std::size_t> by_label;
  for (const auto& run : plan.runs) {
    ids.insert(run.id);
    for (const auto& [name, value] : run.labels) ++by_label[name + "=" + value];
  }
  CHECK(ids.size() == plan.runs.size());
  CHECK(by_label["goal=pose"] == 48);
  CHECK(by_label["planner=apf:k_p=3,law=wang2018"] == 48);
  CHECK(by_label["seed=2"] == 48);
  CHECK(by_label["family=walls"] == 96);
  CHECK(by_label["values=/step_s=0.002 /model/joint_damping=[1,1,1,1,1,1,1]"] == 16);
  const PlannedRun& last = plan.runs.back();
  CHECK(last.id == "blocked-pose/apf:k_p=3,law=wang2018//step_s=0.002 /model/joint_damping=2/s2");
  CHECK(last.planner == "apf");
  CHECK(last.set == std::vector<std::string>{"/planner/params/k_p=3",
                                             "/planner/params/law=wang2018",
                                             "/model/self_collision=false", "/duration_s=5",
                                             "/step_s=0.002", "/model/joint_damping=2"});
  CHECK(to_json(read_plan(bench.dir("a"))) == to_json(plan));
}

TEST_CASE("the same options give the same bytes", "[sweep][unit]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.base = source_dir / "data/scenes/clutter.json";
  options.clutter.maps = 1;
  options.clutter.clutter.count = 5;
  options.clutter.clutter.size_min_m = 0.05;
  options.clutter.clutter.size_max_m = 0.2;
  options.clutter.clutter.bounds = {{-0.8, -0.8, 0.0}, {0.8, 0.8, 1.2}};
  (void)make_plan(bench.dir("a"), options);
  (void)make_plan(bench.dir("b"), options);
  const auto a = bytes_below(bench.dir("a"));
  CHECK(a.size() == 8);  // the plan, three scenes, three maps, and the empty file of records
  CHECK(a == bytes_below(bench.dir("b")));
}

TEST_CASE("a plan has the SHA-256 of each file and planner that its runs will read",
          "[sweep][unit]") {
  Bench bench;
  const fs::path work = bench.dir("inputs");
  fs::create_directory(work);
  for (const char* file :
       {"robots/arm7.urdf", "robots/arm7.spheres.json", "maps/clutter.bt", "maps/shelf.bt"})
    fs::copy_file(source_dir / "data" / file, work / fs::path(file).filename());
  std::ofstream(work / "scene.json") << Json{
      {"schema", "hamelin.scene/1"},
      {"robot", {{"file", "arm7.urdf"}, {"tip", "flange"}, {"spheres", "arm7.spheres.json"}}},
      {"goals", {{{"type", "joint"}, {"q", Json::array({0, 0, 0, 0, 0, 0, 0.1})}}}},
      {"map", {{"file", "clutter.bt"}, {"changes", {{{"time_s", 1}, {"file", "clutter.bt"}}}}}},
      {"planner", {{"name", "hybrid"}}}}.dump();
  PlanOptions options;
  options.files = {work / "scene.json"};
  options.plugin_directories = plugin_directories;
  options.planners = {"hybrid", "apf"};
  options.vary = {"/map/file=clutter.bt,shelf.bt"};
  const Plan plan = make_plan(bench.dir("a"), options);
  std::map<std::string, std::string> inputs, plugins;
  for (const auto& input : plan.inputs) inputs[input.file] = input.sha256;
  for (const auto& plugin : plan.plugins) plugins[plugin.name] = plugin.sha256;
  std::map<std::string, std::string> expected;
  for (const char* name : {"arm7.urdf", "arm7.spheres.json", "clutter.bt", "shelf.bt"})
    expected[std::string("../inputs/") + name] = sha256_of_file(work / name);
  CHECK(inputs == expected);
  for (const char* name : {"apf", "hybrid"})
    CHECK(plugins.at(name) ==
          sha256_of_file(fs::path(HAMELIN_TEST_PLUGIN_DIR) / (std::string(name) + ".hamelin.so")));
  CHECK(plugins.size() == 2);
  std::vector<const PlannedRun*> runs;
  for (const auto& run : plan.runs) runs.push_back(&run);
  CHECK_NOTHROW(check_files(plan, bench.dir("a"), runs));
  CHECK_NOTHROW(check_planners(plan, plugin_directories));
  for (const char* name : {"arm7.spheres.json", "arm7.urdf", "clutter.bt", "shelf.bt"}) {
    const std::string bytes = read_file(work / name);
    std::ofstream(work / name, std::ios::app) << " ";
    CHECK_THROWS_WITH(check_files(plan, bench.dir("a"), runs),
                      Catch::Contains(std::string("inputs/") + name +
                                      ": has changed since the sweep was planned"));
    std::ofstream(work / name, std::ios::binary) << bytes;
  }
  CHECK_THROWS_WITH(check_planners(plan, {bench.dir("a")}),
                    Catch::Contains("planner 'apf': not found"));
}

TEST_CASE("parameters that a planner does not have are refused before a plan is written",
          "[sweep][unit]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.planners = {"hybrid", "apf:k_q=1"};
  CHECK_THAT(message_of(bench.dir("a"), options), Catch::Contains("k_q"));
  CHECK_FALSE(fs::exists(plan_file(bench.dir("a"))));
}

TEST_CASE("a plan in a symbolically linked folder names the scenes by paths that resolve",
          "[sweep][unit]") {
  Bench bench;
  fs::create_directories(bench.dir("deep/er"));
  fs::create_directory_symlink(bench.dir("deep/er"), bench.dir("link"));
  PlanOptions options;
  options.files = {source_dir / "data/scenes/paper_52_apf.json"};
  options.plugin_directories = plugin_directories;
  const Plan plan = make_plan(bench.dir("link"), options);
  const fs::path scene = run_arguments(plan.runs.at(0), bench.dir("link")).at(0);
  CHECK(fs::equivalent(scene, options.files[0]));
  CHECK_NOTHROW(check_files(plan, bench.dir("link"), {&plan.runs.at(0)}));
}

TEST_CASE(
    "all goal types of a problem share its feasibility; a pose goal is the pose of the tip at the "
    "joint goal",
    "[sweep][unit]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.goals = {scene::GoalType::pose, scene::GoalType::joint, scene::GoalType::position};
  const Plan plan = make_plan(bench.dir("a"), options);
  REQUIRE(plan.scenes.size() == 6);
  for (std::size_t i = 0; i < 3; ++i) {
    CHECK(plan.scenes[i].feasible);
    CHECK_FALSE(plan.scenes[3 + i].feasible);
    CHECK_THAT(plan.scenes[3 + i].reason,
               Catch::StartsWith("goal: ") && Catch::Contains(" in the map, "));
  }
  const auto scene_at = [&](std::size_t i) {
    return scene::read_scene(bench.dir("a") / plan.scenes[i].file);
  };
  const scene::Scene pose = scene_at(0), joint = scene_at(1);
  CHECK(pose.map->file == joint.map->file);
  CHECK(pose.obstacles.at(0).judge_only);
  const model::Model model = control::load_model(joint);
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, joint.goals.at(0).q);
  CHECK((dynamics::tip_pose(model, ws).matrix() - pose.goals.at(0).pose.matrix()).norm() < 1e-12);
  CHECK(scene_at(2).goals.at(0).type == scene::GoalType::position);
}

TEST_CASE("pairs of clutter scenes are clear of map and primitives, with start and goal apart",
          "[sweep][unit]") {
  Bench bench;
  PlanOptions options;
  options.plugin_directories = plugin_directories;
  options.base = source_dir / "data/scenes/clutter.json";
  options.clutter.maps = 2;
  options.clutter.pairs = 3;
  options.clutter.clutter.count = 12;
  options.clutter.clutter.size_min_m = 0.05;
  options.clutter.clutter.size_max_m = 0.2;
  options.clutter.clutter.bounds = {{-0.8, -0.8, 0.0}, {0.8, 0.8, 1.2}};
  options.clutter.clutter.keep_out = {{{0.0, 0.0, 0.2}, 0.35}};
  options.clutter.clutter.seed = 7;
  const Plan plan = make_plan(bench.dir("a"), options);
  REQUIRE(plan.scenes.size() == 6);
  CHECK(plan.runs.size() == 6);
  CHECK(plan.runs[0].id == "clutter_0007-001/hybrid/s1");
  std::set<std::string> maps, starts;
  for (const auto& found : plan.scenes) {
    CHECK(found.feasible);
    scene::Scene scene = scene::read_scene(bench.dir("a") / found.file);
    maps.insert(scene.map->file.string());
    REQUIRE(scene.obstacles.size() == 12);
    CHECK(scene.obstacles[0].judge_only);
    REQUIRE(scene.goals.size() == 1);
    CHECK((scene.goals[0].q - scene.start_q).norm() >= 1.5);
    CHECK(starts.insert(read_json(bench.dir("a") / found.file)["start"].dump()).second);
    for (const auto& q : {scene.start_q, scene.goals[0].q}) {
      Judge primitives(scene);
      primitives.add_node(0.0, q);
      CHECK(primitives.verdict().obstacles->clearance_m >= 0.02);
      scene::Scene map_only = scene;
      map_only.obstacles.clear();
      Judge leaves(map_only);
      leaves.add_node(0.0, q);
      CHECK(leaves.verdict().obstacles->clearance_m >= 0.02);
    }
  }
  CHECK(maps.size() == 2);
}

TEST_CASE(
    "gain sets lie in the ranges of the set-up, and the first ones do not depend on their number",
    "[sweep][unit]") {
  const auto sets = draw_gains(2000, 1), few = draw_gains(3, 1);
  std::size_t undamped = 0;
  double low = 1e9, high = 0.0;
  const auto between = [](double value, double from, double to) {
    CHECK(std::log10(value) >= from);
    CHECK(std::log10(value) <= to);
  };
  for (const auto& g : sets) {
    between(g.k_p, -0.5, 1.5);
    between(g.k_v / (2.0 * std::sqrt(g.k_p)), -0.6 - 1e-12, 0.6 + 1e-12);
    between(g.eta, -2.0, 1.5);
    between(g.k_obs, -1.0, 2.0);
    if (g.joint_damping == 0.0)
      ++undamped;
    else
      between(g.joint_damping, -1.5, 0.5);
    low = std::min(low, g.k_p);
    high = std::max(high, g.k_p);
  }
  CHECK(undamped > 900);
  CHECK(undamped < 1100);
  CHECK(low < 0.33);  // the whole range is used
  CHECK(high > 31.0);
  for (std::size_t i = 0; i < few.size(); ++i) CHECK(few[i].k_obs == sets[i].k_obs);
}

TEST_CASE(
    "runs of gain sets have the published set-up, links as rows of spheres and each planner's "
    "parameter names",
    "[sweep][unit]") {
  Bench bench;
  PlanOptions options;
  options.plugin_directories = plugin_directories;
  options.base = source_dir / "data/scenes/paper_52_apf.json";
  options.gains.sets = 3;
  const Plan plan = make_plan(bench.dir("a"), options);
  CHECK(plan.scenes.size() == 2);
  CHECK(plan.runs.size() == 3 * 4);
  std::map<std::string, std::size_t> planners;
  for (const auto& run : plan.runs) {
    ++planners[run.labels.at("planner")];
    CHECK(run.gains.size() == 5);
    CHECK((run.set.front() == "/stall=null") == (run.planner == "hybrid"));
    const auto published = std::count(run.set.begin(), run.set.end(),
                                      std::string("/planner/params/algorithm=published"));
    CHECK(published == (run.planner == "hybrid" ? 0 : 1));
    const std::string last = run.set.back();
    CHECK(last.starts_with(run.planner == "apf"    ? "/planner/params/eta="
                           : run.planner == "gyro" ? "/planner/params/k_obs="
                                                   : "/planner/params/joint_damping="));
  }
  CHECK(planners == std::map<std::string, std::size_t>{
                        {"apf", 3}, {"apf without the obstacle", 3}, {"gyro", 3}, {"hybrid", 3}});
  const scene::Scene scene = scene::read_scene(bench.dir("a") / plan.scenes[0].file);
  CHECK(scene.integrator.name == "semi-implicit-euler");
  CHECK(scene.step_s == 0.004);
  CHECK(scene.duration_s == 40.0);
  CHECK(scene.gravity_m_s2.isZero(0.0));
  CHECK(scene.goals.at(0).tip_speed_max_m_s == 0.05);
  CHECK(std::isinf(scene.goals.at(0).speed_max));
  CHECK(scene.obstacles.size() == 1);
  CHECK(scene::read_scene(bench.dir("a") / plan.scenes[1].file).obstacles.empty());
  // no point of a segment is farther than 1 cm from a sphere's centre, and the spheres are hardly
  // wider than the segment
  const model::Model model = control::load_model(scene);
  for (const auto& link : model.robot().links)
    for (int i = 0; i <= 1000; ++i) {
      const double share = 0.001 * i;
      const auto& segment = link.segments.at(0);
      const Eigen::Vector3d p = segment.from_m + share * (segment.to_m - segment.from_m);
      double nearest = 1.0;
      for (const auto& sphere : link.spheres)
        nearest = std::min(nearest, (sphere.center_m - p).norm());
      if (nearest > 0.01 + 1e-9) FAIL_CHECK(link.name << " at " << share);
    }
  CHECK(model.shapes().front().radius <= 1e-3);
}

TEST_CASE("a motion is thinned to a spacing, and loops are removed from it", "[sweep][unit]") {
  const auto at = [](double x, double y) { return Eigen::VectorXd(Eigen::Vector2d(x, y)); };
  std::vector<Eigen::VectorXd> nodes;
  for (int i = 0; i <= 100; ++i) nodes.push_back(at(0.01 * i, 0.0));
  for (int i = 1; i <= 50; ++i) nodes.push_back(at(1.0, 0.01 * i));  // a detour
  for (int i = 49; i >= 0; --i) nodes.push_back(at(1.0, 0.01 * i));  // and back
  for (int i = 1; i <= 100; ++i) nodes.push_back(at(1.0 + 0.01 * i, 0.0));
  const auto path = thin_path(nodes, 0.1 + 1e-9);
  CHECK(path.front() == nodes.front());
  CHECK(path.back() == nodes.back());
  CHECK(path.size() == 21);
  for (std::size_t i = 1; i < path.size(); ++i) {
    CHECK((path[i] - path[i - 1]).lpNorm<Eigen::Infinity>() <= 0.1 + 1e-9);
    CHECK(path[i][1] == 0.0);
  }
  CHECK(thin_path({at(0.0, 0.0)}, 0.1).size() == 1);
  // a step of the motion that is longer than the spacing is kept
  CHECK(thin_path({at(0.0, 0.0), at(1.0, 0.0)}, 0.1).size() == 2);
}

TEST_CASE("a sphere on a path touches the arm on its path, and is clear of start and goal",
          "[sweep]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.sphere_on_path.emplace().visible_within_m = 0.15;
  std::vector<std::string> notes;
  options.on_note = [&](const std::string& text) { notes.push_back(text); };
  const Plan plan = make_plan(bench.dir("a"), options);
  REQUIRE(notes.size() == 1);
  CHECK_THAT(notes[0],
             Catch::Contains("blocked.json: is left out: goal: ") && Catch::EndsWith(" m deep"));
  REQUIRE(plan.scenes.size() == 1);
  CHECK(plan.scenes[0].feasible);
  CHECK(plan.runs.at(0).id == "free-path/hybrid/s1");
  CHECK(plan.runs.at(0).labels.at("sphere") == "seen at 0.15 m");
  const scene::Scene scene = scene::read_scene(bench.dir("a") / plan.scenes[0].file);
  const scene::Obstacle& sphere = scene.obstacles.back();
  CHECK(sphere.radius_m == 0.06);
  CHECK_FALSE(sphere.known);
  CHECK(sphere.visible_within_m == 0.15);
  CHECK_FALSE(sphere.judge_only);
  const scene::Goal& goal = scene.goals.at(0);
  REQUIRE(goal.path.cols() > 2);
  // with the kinematics that runs use
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  std::vector<Eigen::Vector3d> centers(model.shapes().size());
  const auto clearance = [&](const Eigen::VectorXd& q) {
    dynamics::forward_kinematics(model, ws, q);
    dynamics::shape_centers(model, ws, centers);
    double nearest = 1e9;
    for (std::size_t i = 0; i < centers.size(); ++i)
      nearest = std::min(nearest, (centers[i] - sphere.pose.p()).norm() - model.shapes()[i].radius -
                                      sphere.radius_m);
    return nearest;
  };
  CHECK(clearance(scene.start_q) >= 0.02);
  CHECK(clearance(goal.q) >= 0.02);
  double nearest = 1e9;
  Eigen::VectorXd before = scene.start_q;
  for (const auto& q : goal.path.colwise()) {
    nearest = std::min(nearest, clearance(q));
    CHECK((q - before).lpNorm<Eigen::Infinity>() <= 0.1);
    before = q;
  }
  CHECK(nearest < -0.06);
}

TEST_CASE("a sphere swings at right angles to the arm's way, and off its base", "[sweep]") {
  Bench bench;
  PlanOptions options = bench.problems();
  options.on_note = [](const std::string&) {};
  auto& swinging = options.sphere_on_path.emplace();
  const scene::Scene still =
      scene::read_scene(bench.dir("a") / make_plan(bench.dir("a"), options).scenes.at(0).file);
  swinging.swing_m = 0.25;
  swinging.swing_period_s = 3.0;
  swinging.prediction = scene::Prediction::speed_bound;
  const Plan plan = make_plan(bench.dir("b"), options);
  CHECK(plan.runs.at(0).labels.at("sphere") == "swings in 3 s");
  CHECK(plan.runs.at(0).labels.at("prediction") == "speed-bound");
  const scene::Scene scene = scene::read_scene(bench.dir("b") / plan.scenes.at(0).file);
  const scene::Obstacle& sphere = scene.obstacles.back();
  CHECK(sphere.pose.p() == still.obstacles.back().pose.p());
  const auto& sine = std::get<scene::SineMotion>(sphere.motion.value());
  CHECK(sine.amplitude_m.norm() == Approx(0.25));
  CHECK(sine.period_s == 3.0);
  CHECK(scene::max_speed(sphere) <= sphere.speed_max_m_s);
  CHECK(sphere.speed_max_m_s < 1.05 * scene::max_speed(sphere));
  // The way of the nearest point of the arm, with the kinematics that runs use.
  const model::Model model = control::load_model(scene);
  dynamics::Workspace ws(model);
  std::vector<Eigen::Vector3d> centers(model.shapes().size()), at(model.shapes().size());
  const auto place = [&](const Eigen::VectorXd& q, std::vector<Eigen::Vector3d>& out) {
    dynamics::forward_kinematics(model, ws, q);
    dynamics::shape_centers(model, ws, out);
  };
  double nearest = 1e9, cosine = 1.0;
  const Eigen::MatrixXd& path = scene.goals.at(0).path;
  for (Eigen::Index k = 1; k + 1 < path.cols(); ++k) {
    place(path.col(k), at);
    for (std::size_t i = 0; i < at.size(); ++i) {
      const double distance = (at[i] - sphere.pose.p()).norm();
      if (distance >= nearest) continue;
      nearest = distance;
      place(path.col(k - 1), centers);
      const Eigen::Vector3d before = centers[i];
      place(path.col(k + 1), centers);
      const Eigen::Vector3d way = centers[i] - before;
      cosine = std::abs(way.dot(sine.amplitude_m)) / (way.norm() * sine.amplitude_m.norm());
    }
  }
  CHECK(nearest < 1e-6);
  CHECK(cosine < 1e-6);
}

TEST_CASE("invalid options of a plan are refused in one line", "[sweep][unit]") {
  Bench bench;
  CHECK_THAT(message_of(bench.dir("a"), {}), Catch::StartsWith("nothing to plan"));
  PlanOptions options = bench.problems();
  options.problem.robot.clear();
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::Contains("free.json: is a problem, expected --robot"));
  options = bench.problems();
  options.planners = {":k=1"};
  CHECK_THAT(message_of(bench.dir("a"), options), Catch::StartsWith("--planner :k=1: no name"));
  options.planners = {"apf:k"};
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::StartsWith("--planner apf:k: 'k' is not a parameter"));
  options.planners = {"apf", "apf"};
  CHECK_THAT(message_of(bench.dir("a"), options), Catch::Contains("is planned twice"));
  options = bench.problems();
  options.vary = {"step_s=1"};
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::StartsWith("--vary step_s=1: expected /json/pointer="));
  options = bench.problems();
  options.files.push_back(options.files.front());
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::Contains("another file also has the name 'free-joint'"));
  options.files = {source_dir / "data/robots/planar3.json"};
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::Contains("planar3.json: is neither a scene nor a problem"));
  options.files = {source_dir / "data/scenes/shelf.json"};
  options.sphere_on_path.emplace();
  CHECK_THAT(message_of(bench.dir("a"), options),
             Catch::Contains("shelf.json: is a scene, expected problems"));
  options.sphere_on_path.reset();
  options.files.clear();
  options.clutter.maps = 1;
  CHECK_THAT(message_of(bench.dir("a"), options), Catch::Contains("need --base"));
  options.base = source_dir / "data/scenes/clutter.json";
  options.clutter.maps = 0;
  options.gains.sets = 1;
  CHECK_THAT(message_of(bench.dir("a"), options), Catch::Contains("has no segments"));
  CHECK_FALSE(fs::exists(plan_file(bench.dir("a"))));
}
