#include "hamelin/planning/plugin_host.hpp"

#include <catch2/catch.hpp>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <optional>
#include <stdexcept>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/planning/plugin.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::planning;
namespace fs = std::filesystem;

namespace {

const fs::path test_plugins = fs::path(HAMELIN_TEST_BINARY_DIR) / "lib/hamelin/test_plugins";

fs::path test_plugin(const std::string& name) {
  return test_plugins / (name + ".hamelin.so");
}

std::string refusal(const fs::path& file) {
  return test::error_of([&] { (void)Plugin::load(file); });
}

struct Services : HostServices {
  void log(std::int32_t level, std::string_view line) override {
    if (log_throws) throw std::runtime_error("the log is full");
    lines.push_back(std::to_string(level) + " " + std::string(line));
  }
  std::size_t closest_points(std::span<const double> q, double influence_m,
                             ArrayOut<hamelin_contact> out) override {
    if (throws) throw std::runtime_error("the map is gone");
    hamelin_contact contact{};
    contact.distance_m = q[0] + influence_m;
    out.set(0, contact);
    return out.size() + 3;
  }
  std::vector<std::string> lines;
  bool throws = false, log_throws = false;
};

model::Model arm() {
  return model::Model(test::random_robot(7, 3));
}

/// A planner of the plugin `awkward` and the input of one tick.
struct Bench {
  explicit Bench(const std::string& fault) {
    SetupData setup(model);
    setup.influence_m = 0.5;
    const Plugin plugin = Plugin::load(test_plugin("awkward"));
    planner.emplace(
        plugin.create(std::move(setup), services, check_params(plugin, Json{{"fault", fault}})));
    tick.struct_size = sizeof tick;
    tick.q = q.data();
    tick.v = v.data();
    tick.speed_scale = 1.0;
  }
  model::Model model = arm();
  Eigen::Vector3d q{0.1, 0.2, 0.3}, v{1.0, 2.0, 3.0};
  Services services;
  std::optional<LoadedPlanner> planner;
  hamelin_tick tick{};
  CommandBuffers out{3, 8};
};

}  // namespace

TEST_CASE("a file that is not a valid plugin is refused with one line that names it",
          "[planning][plugin]") {
  const std::string absent = test_plugin("absent").string();
  CHECK(refusal(absent) == absent + ": no such file, expected a planner plugin");
  CHECK(refusal(test_plugins) ==
        test_plugins.string() + ": not a regular file, expected a planner plugin");

  const fs::path text = fs::path(HAMELIN_TEST_BINARY_DIR) / "text.hamelin.so";
  std::ofstream(text)
      << "not a shared object, but a text that is longer than the header of a shared object\n";
  CHECK(refusal(text) == text.string() + ": cannot be loaded: invalid ELF header");

  const auto expect = [](const std::string& name, const std::string& reason) {
    CAPTURE(name);
    CHECK(refusal(test_plugin(name)) == test_plugin(name).string() + ": " + reason);
  };
  expect("no_entry", "no symbol hamelin_plugin_entry, expected a planner plugin");
  expect("null_entry", "hamelin_plugin_entry returned null");
  expect("old_abi",
         "built for version 3 of the plugin interface, expected 4; rebuild it with this version's "
         "headers");
  expect("future_abi",
         "needs version 9 to 10 of the plugin interface, expected 4; it needs a later hamelin");
  expect("short_struct", "hamelin_plugin has 112 bytes, expected at least 120");
  expect("null_create", "function 'create' is null");
  expect("null_tick", "function 'tick' is null");
  expect("null_destroy", "function 'destroy' is null");
  expect("no_name", "the plugin has no name");
  CHECK_THAT(refusal(test_plugin("bad_schema")), Catch::Contains("parameter schema: line 1"));
}

TEST_CASE("an exception of a planner's constructor becomes one line with its text",
          "[planning][plugin]") {
  const std::string file = test_plugin("awkward").string();
  CHECK(test::error_of([] { Bench("throw in constructor"); }) ==
        file + ": planner 'awkward' cannot start: this gain is out of tune");
  CHECK(test::error_of([] { Bench("throw an int"); }) ==
        file + ": planner 'awkward' cannot start: an exception that is not a std::exception");

  Services services;
  const Plugin empty = Plugin::load(test_plugin("creates_nothing"));
  CHECK_THAT(
      test::error_of([&] { (void)empty.create(SetupData(arm()), services, Json::object()); }),
      Catch::EndsWith("cannot start: create returned no planner"));
  services.log_throws = true;
  const Plugin plain = Plugin::load(test_plugin("plain_c"));
  CHECK_THAT(
      test::error_of([&] { (void)plain.create(SetupData(arm()), services, Json::object()); }),
      Catch::EndsWith("cannot start: the log is full"));
}

TEST_CASE("a planner written in plain C answers ticks and keeps its library loaded",
          "[planning][plugin]") {
  Services services;
  const model::Model model = arm();
  std::optional<LoadedPlanner> planner;
  {
    const Plugin plugin = Plugin::load(test_plugin("plain_c"));
    CHECK_FALSE(plugin.influence_m(Json::object()).has_value());
    planner.emplace(plugin.create(SetupData(model), services, check_params(plugin, {})));
  }
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.q = tick.v = zero.data();
  tick.goal_number = 5;
  CommandBuffers out(3, 0, planner->series().size());
  REQUIRE(planner->tick(tick, out));
  REQUIRE(planner->series().size() == 2);
  CHECK(planner->series()[0].name == "goal");
  CHECK(out.series()[0] == 5.0);
  CHECK(out.damping() == Eigen::Vector3d::Ones());
  CHECK(out.held_torque() == zero);
  CHECK(services.lines == std::vector<std::string>{"0 made in C"});
}

TEST_CASE("every channel reaches the host and is cleared before the next tick",
          "[planning][plugin]") {
  Bench bench("node velocity");
  CHECK(bench.services.lines == std::vector<std::string>{"1 awkward is here"});
  REQUIRE(bench.planner->tick(bench.tick, bench.out));
  const auto check = [&] {
    CHECK(bench.out.raw().potential_J == 1.0);
    CHECK(bench.out.potential_gradient() == 2.0 * bench.q);
    CHECK(bench.out.damping() == Eigen::Vector3d::Constant(2.0));
    CHECK(bench.out.held_torque() == -bench.v);
    CHECK(bench.out.raw().filter_work_J == -0.5);
    CHECK(bench.out.raw().recovery_work_J == 0.25);
    REQUIRE(bench.out.gyroscopic().size() == 1);
    CHECK(bench.out.gyroscopic()[0].link == 2);
    CHECK(vec3(bench.out.gyroscopic()[0].point_link_m) == Eigen::Vector3d::UnitX());
    CHECK(vec3(bench.out.gyroscopic()[0].w_world) == Eigen::Vector3d::UnitZ());
    CHECK(bench.out.raw().has_node_velocity == 1);
    CHECK(bench.out.node_velocity() == 0.5 * bench.v);
  };
  check();
  REQUIRE(bench.planner->tick(bench.tick, bench.out));
  check();
  if (test::counts_allocations())
    CHECK(test::allocations_in([&] { (void)bench.planner->tick(bench.tick, bench.out); }) == 0);
  bench.out.clear();
  CHECK(bench.out.held_torque().isZero(0.0));
  CHECK(bench.out.gyroscopic().empty());
  CHECK(bench.out.raw().has_node_velocity == 0);
}

TEST_CASE("a planner can give up with a cause, which is no defect", "[planning][plugin]") {
  Bench bench("give up");
  REQUIRE(bench.planner->tick(bench.tick, bench.out));
  CHECK(bench.out.raw().state == HAMELIN_PLANNER_GAVE_UP);
  CHECK(std::string(bench.out.raw().cause) == "no way on");
}

TEST_CASE("an invalid answer of a planner is a defect with one line that names the reason",
          "[planning][plugin]") {
  const auto [fault, line] = GENERATE(table<std::string, std::string>(
      {{"throw in tick", "tick went wrong"},
       {"nan", "held torque is not finite"},
       {"negative damping", "damping is negative"},
       {"wrong link", "gyroscopic term on a link that does not exist"},
       {"many terms", "more gyroscopic terms than the host's capacity"},
       {"state", "unknown planner state"}}));
  Bench bench(fault);
  CHECK_FALSE(bench.planner->tick(bench.tick, bench.out));
  CHECK(bench.planner->error() == line);
}

TEST_CASE("the host answers queries of closest points, and its failure ends the tick",
          "[planning][plugin]") {
  Bench bench("closest points");
  REQUIRE(bench.planner->tick(bench.tick, bench.out));
  CHECK(bench.out.held_torque()[0] == Approx(7.0 + 0.1 + 0.5));
  bench.services.throws = true;
  CHECK_FALSE(bench.planner->tick(bench.tick, bench.out));
  CHECK(bench.planner->error() == "the map is gone");
  bench.services.throws = false;
  CHECK(bench.planner->tick(bench.tick, bench.out));
}

TEST_CASE("the setup passes the nominal model to the plugin", "[planning][plugin]") {
  const geometry::SE3 base =
      geometry::SE3::exp((Eigen::Matrix<double, 6, 1>() << 0.3, -0.2, 0.9, 1, 2, 3).finished());
  model::Robot robot = test::random_robot(3, 4, 2);
  robot.links[2].segments = {{{0.0, 0.0, 0.0}, {1.0, 0.0, 0.0}, 0.0},
                             {{0.0, 0.1, -0.1}, {0.0, 0.3, 0.1}, 0.03}};
  const geometry::SE3 flange_pose(robot.links[1].com.R(), {0.1, 0.2, 0.3});
  robot.frames = {{"flange", 1, flange_pose}, {"stand", -1, {}}};
  const model::Model model(std::move(robot), base, {0.0, 1.0, -9.0});
  SetupData data(model);
  data.q_lower = Eigen::Vector4d::Constant(-2.0);
  hamelin_goal goal{};
  goal.type = HAMELIN_GOAL_JOINT;
  data.add_goal(goal, Eigen::Vector4d(1, 2, 3, 4));
  const hamelin_setup raw = data.view();
  const Setup setup(raw);
  const model::Model back = setup.model();
  CHECK(back.dof() == 4);
  CHECK(back.gravity() == model.gravity());
  const auto& flange = back.frames()[static_cast<std::size_t>(back.frame("flange"))];
  CHECK(flange.link == 1);
  CHECK((flange.in_link.matrix() -
         model.frames()[static_cast<std::size_t>(model.frame("flange"))].in_link.matrix())
            .norm() < 1e-15);
  CHECK(back.frames()[static_cast<std::size_t>(back.frame("stand"))].link == -1);
  CHECK((back.base().matrix() - base.matrix()).norm() < 1e-15);
  CHECK(setup.goals()[0].q[3] == 4.0);
  CHECK(setup.q_lower()->minCoeff() == -2.0);
  CHECK_FALSE(setup.effort_max().has_value());
  REQUIRE(setup.shapes().size() == 5);
  CHECK(vec3(setup.shapes()[2].center_link_m) == model.robot().links[2].spheres[0].center_m);
  CHECK(vec3(setup.shapes()[2].half_axis_link_m).isZero(0.0));
  const hamelin_shape& capsule = setup.shapes()[3];  // a segment of radius zero is not a shape
  CHECK(capsule.link == 2);
  CHECK(capsule.index_in_link == 1);
  CHECK(vec3(capsule.center_link_m).isApprox(Eigen::Vector3d(0.0, 0.2, 0.0)));
  CHECK(vec3(capsule.half_axis_link_m).isApprox(Eigen::Vector3d(0.0, 0.1, 0.1)));
  CHECK(capsule.radius_m == 0.03);
  CHECK(setup.shapes()[4].link == 3);
  for (int i = 0; i < 4; ++i) {
    const auto& a = back.robot().links[static_cast<std::size_t>(i)];
    const auto& b = model.robot().links[static_cast<std::size_t>(i)];
    CHECK(a.joint.screw == b.joint.screw);
    CHECK(a.mass_kg == b.mass_kg);
    CHECK((a.inertia_kg_m2 - b.inertia_kg_m2).norm() < 1e-12);
  }
}

TEST_CASE("parameters are completed, and errors name planner, key and range",
          "[planning][plugin]") {
  const Plugin plugin = Plugin::load(test_plugin("awkward"));
  const Json resolved = check_params(plugin, Json{{"gain", 4}});
  CHECK(resolved == Json::parse(R"({"gain": 4, "fault": "", "nested": {"depth": 3}})"));
  CHECK(plugin.influence_m(resolved) == 1.0);
  CHECK(check_params(plugin, nullptr).at("gain") == 2);

  const auto error = [&](const char* params) {
    return test::error_of([&] { (void)check_params(plugin, Json::parse(params)); });
  };
  CHECK(error(R"({"gain": 11})") ==
        "parameters of planner 'awkward': /gain: 11 is not allowed, expected type number, at least "
        "0, at most 10");
  CHECK_THAT(error(R"({"gainn": 1})"), Catch::Contains("planner 'awkward'") &&
                                           Catch::Contains("unknown key 'gainn'") &&
                                           Catch::Contains("'gain'?"));
  CHECK_THAT(error(R"({"nested": {"dept": 1}})"),
             Catch::Contains("/nested") && Catch::Contains("unknown key 'dept'"));
  CHECK(error("[1]") == "parameters of planner 'awkward': /: expected an object");
}

TEST_CASE("a missing planner is reported with all directories and a similar name",
          "[planning][plugin]") {
  const fs::path root = fs::path(HAMELIN_TEST_BINARY_DIR) / "plugin_search";
  fs::remove_all(root);
  fs::create_directories(root / "one");
  fs::create_directories(root / "two");
  fs::copy_file(test_plugin("plain_c"), root / "two/plain_c.hamelin.so");
  fs::copy_file(test_plugin("old_abi"), root / "two/old.hamelin.so");
  const std::vector<fs::path> directories{root / "one", root / "two", root / "three"};

  CHECK(test::error_of([&] { (void)find_plugin("plain-c", directories); }) ==
        "planner 'plain-c': not found, did you mean 'plain_c'?; searched for plain-c.hamelin.so "
        "in: " +
            (root / "one").string() + " (no plugins); " + (root / "two").string() +
            " (old, plain_c); " + (root / "three").string() + " (no such directory)");
  CHECK(find_plugin("plain_c", directories).file() == root / "two/plain_c.hamelin.so");
  CHECK(find_plugin((root / "two/plain_c.hamelin.so").string(), {}).name() == "plain_c");

  const auto listed = list_plugins(directories);
  REQUIRE(listed.size() == 2);
  CHECK_FALSE(listed[0].plugin.has_value());
  CHECK_THAT(listed[0].refusal, Catch::Contains("old.hamelin.so: built for version 3"));
  REQUIRE(listed[1].plugin.has_value());
  CHECK(listed[1].plugin->version() == "1.0");
}

TEST_CASE("plugin directories: those given, then HAMELIN_PLUGIN_PATH, then the program's own",
          "[planning][plugin]") {
  setenv("HAMELIN_PLUGIN_PATH", "/b::/c:/a", 1);
  const auto all = plugin_directories({"/a"}, {"/own", "/c"});
  unsetenv("HAMELIN_PLUGIN_PATH");
  CHECK(all == std::vector<fs::path>{"/a", "/b", "/c", "/own"});
  CHECK(plugin_directories({}, {"/own"}) == std::vector<fs::path>{"/own"});
}

TEST_CASE("the README's example loads a planner and gets an answer", "[planning][plugin]") {
  const std::string name_or_path = "awkward";
  const std::vector<fs::path> given{test_plugins}, own;
  const model::Model model = arm();
  Services services;
  const Eigen::Vector3d q{0.1, 0.2, 0.3}, v{1.0, 2.0, 3.0};
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.q = q.data();
  tick.v = v.data();

  const Plugin plugin = find_plugin(name_or_path, plugin_directories(given, own));
  const Json params = check_params(plugin, {{"gain", 4}});
  SetupData setup(model);
  setup.influence_m = plugin.influence_m(params).value_or(0.5);
  LoadedPlanner planner = plugin.create(std::move(setup), services, params);
  CommandBuffers command(static_cast<std::size_t>(model.dof()), 64);
  if (!planner.tick(tick, command)) throw Error(ErrorCode::plugin, std::string(planner.error()));

  CHECK(command.potential_gradient() == 4.0 * q);
}

TEST_CASE("a planner's own copy of the library computes with the host's instruction set",
          "[planning][unit]") {
  const Isa before = default_isa();
  for (const Isa isa : {Isa::v4, Isa::v3, Isa::baseline}) {
    if (!is_available(isa)) continue;
    set_default_isa(isa);
    CHECK(Bench("instruction set").services.lines.back() == "1 " + std::string(name_of(isa)));
  }
  set_default_isa(before);
}
