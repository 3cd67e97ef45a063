#include "hamelin/search/line_check.hpp"

#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <memory>
#include <optional>
#include <vector>

#include "../src/kernel/line_lanes.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/core/isa_kernels.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/search/edge_check.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"

namespace hamelin::search::kernel {
HAMELIN_SELECT_KERNELS(LineKernels, line_kernels)
}  // namespace hamelin::search::kernel

using namespace hamelin;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";

struct RigOptions {
  bool self = true, obstacles = true;
  scene::UnknownPolicy unknown = scene::UnknownPolicy::free;
  std::string map = "clutter";
  geometry::SE3 shift{};  ///< of arm, map and obstacles
};

/// An arm of data/ among the boxes of a map, and obstacles of all shapes, one of which moves.
struct LineRig {
  explicit LineRig(model::Robot robot, const RigOptions& options = {})
      : arm(std::move(robot), options.shift),
        self(arm),
        self_used(options.self ? &self : nullptr),
        environment(make_environment(arm, options)),
        line(arm, self_used),
        edge(arm, self_used),
        ws(arm),
        shapes(arm) {
    line.set_environment(environment, time_s);
    edge.set_environment(environment, time_s);
  }

  static scene::Environment make_environment(const model::Model& arm, const RigOptions& options) {
    scene::MapSpec map;
    map.file = data / "maps" / (options.map + ".bt");
    map.unknown = options.unknown;
    map.keep_out_radius_m = 0.3;
    map.pose = options.shift;
    std::vector<scene::Obstacle> obstacles;
    const auto add = [&](scene::Shape shape, const Vector3d& at, double radius, double length) {
      scene::Obstacle obstacle;
      obstacle.name = "obstacle" + std::to_string(obstacles.size());
      obstacle.shape = shape;
      obstacle.radius_m = radius;
      obstacle.length_m = length;
      obstacle.size_m = {radius, 2.0 * radius, length};
      const Eigen::Matrix3d turned =
          Eigen::AngleAxisd(0.7, Vector3d(1.0, 2.0, 0.5).normalized()).toRotationMatrix();
      obstacle.pose = options.shift * geometry::SE3{turned, at};
      obstacles.push_back(obstacle);
    };
    if (options.obstacles) {
      add(scene::Shape::sphere, {0.5, 0.3, 0.6}, 0.1, 0.0);
      add(scene::Shape::box, {-0.5, 0.3, 0.5}, 0.1, 0.2);
      add(scene::Shape::capsule, {0.0, 0.6, 0.7}, 0.05, 0.3);
      add(scene::Shape::cylinder, {0.0, -0.6, 0.6}, 0.06, 0.3);
      add(scene::Shape::sphere, {-0.5, 0.0, 0.7}, 0.1, 0.0);
      obstacles.back().motion = scene::LinearMotion{{0.0, 0.2, 0.0}, 0.0};
    }
    return scene::Environment(map, obstacles, arm.base(), arm.reach(), 0.3);
  }

  double clearance(const VectorXd& q) {
    dynamics::forward_kinematics(arm, ws, q);
    shapes.place(arm, ws);
    double smallest = environment.clearance(shapes.view(), time_s, 0.2);
    for (std::size_t pair = 0; self_used != nullptr && pair < self.pairs().size(); ++pair)
      smallest = std::min(smallest, self.distance(pair, shapes.view(), 0.2));
    return smallest;
  }
  /// The least by which the samples of a line have more than they must.
  double spare(const VectorXd& a, const VectorXd& b, const search::Margins& margins) {
    double least = 1.0;
    constexpr int samples = 200;
    for (int i = 0; i <= samples; ++i) {
      const VectorXd q = a + static_cast<double>(i) / samples * (b - a);
      least = std::min(least, clearance(q) - margins.required(q));
    }
    return least;
  }
  VectorXd random_q() { return test::random_within_limits(arm, rng); }

  double time_s = 1.5;
  model::Model arm;
  scene::SelfField self;
  const scene::SelfField* self_used;
  scene::Environment environment;
  search::LineCheck line;
  search::EdgeCheck edge;
  dynamics::Workspace ws;
  scene::PlacedShapes shapes;
  Rng rng{11};
};

model::Robot read(const std::string& file, const std::string& tip = {},
                  const std::string& spheres = {}, const std::string& srdf = {}) {
  description::RobotOptions options;
  if (!tip.empty()) options.tip = tip;
  if (!spheres.empty()) options.spheres = data / "robots" / spheres;
  if (!srdf.empty()) options.srdf = data / "robots" / srdf;
  return description::read_robot(data / "robots" / file, options);
}
model::Robot panda() {
  return read("third_party/panda.urdf", "panda_hand", "third_party/panda_spheres.json",
              "third_party/panda.srdf");
}
model::Robot arm7() {
  return read("arm7.urdf", "flange", "arm7.spheres.json");
}

struct Counts {
  int proved = 0, colliding = 0, refused = 0, refused_by_edge = 0;
};

// Compares proofs with samples and with EdgeCheck, for constant margins and for places with less.
Counts compare(LineRig& rig, int lines, bool with_places = false) {
  Counts counts;
  for (int i = 0; i < lines; ++i) {
    const VectorXd a = rig.random_q();
    const VectorXd b = a + rig.rng.uniform(0.02, 1.0) * (rig.random_q() - a);
    search::Margins margins(0.01 * (i % 3), i % 2 == 0 ? VectorXd{} : VectorXd::Ones(a.size()));
    if (with_places) {
      margins.add(a, 0.002, 0.02, 0.3);
      margins.add(b, 0.001, 0.2, 0.9);
    }
    rig.line.set_margins(margins);
    const bool proved = rig.line.motion_clear(a, b);
    const double spare = rig.spare(a, b, margins);
    if (proved) CHECK(spare > 0.0);
    counts.proved += proved ? 1 : 0;
    counts.colliding += spare <= 0.0 ? 1 : 0;
    counts.refused += !proved && spare > 5e-4 ? 1 : 0;
    if (!with_places)
      counts.refused_by_edge +=
          !rig.edge.motion_clear(a, b, margins.full_m()) && spare > 5e-4 ? 1 : 0;
  }
  return counts;
}

void check(LineRig& rig, int lines, int proved_least) {
  const Counts counts = compare(rig, lines);
  CAPTURE(counts.proved, counts.colliding, counts.refused, counts.refused_by_edge);
  CHECK(counts.proved >= proved_least);
  CHECK(counts.colliding > lines / 20);
  CHECK(counts.refused <= counts.refused_by_edge + 1 + lines / 200);
  CHECK(rig.line.counts().whole == 0);
}

}  // namespace

TEST_CASE("a line that is proved clear is clear at every sample, and few others are refused",
          "[search][line]") {
  for (const char* map : {"clutter", "shelf"}) {
    RigOptions options;
    options.map = map;
    for (const bool obstacles : {false, true}) {
      options.obstacles = obstacles;
      LineRig rig(panda(), options);
      check(rig, 500, 30);
      LineRig other(arm7(), options);
      check(other, 400, 30);
    }
  }
}

TEST_CASE("lines of capsules, prismatic joints and planar chains are proved as well",
          "[search][line]") {
  LineRig capsules{model::Model(model::make_chain({})).robot()};
  REQUIRE(capsules.arm.has_capsules());
  check(capsules, 300, 10);
  LineRig rail{read("rail7.urdf")};
  (void)compare(rail, 300);
  for (std::uint64_t seed = 1; seed <= 6; ++seed) {
    LineRig mixed{test::random_robot(seed, 6, 3, seed % 2 == 0)};
    const Counts counts = compare(mixed, 200);
    CHECK(counts.refused <= counts.refused_by_edge + 2);
    LineRig turning{test::random_robot(seed, 5, 0, seed % 2 == 0)};
    REQUIRE(turning.arm.planar() == (seed % 2 == 0));
    const Counts others = compare(turning, 200);
    CHECK(others.refused <= others.refused_by_edge + 2);
  }
}

TEST_CASE("lines are proved with the margins of places", "[search][line]") {
  LineRig rig(panda());
  const Counts counts = compare(rig, 600, true);
  CAPTURE(counts.proved, counts.refused);
  CHECK(counts.proved > 60);
  CHECK(counts.refused <= 12);
}

TEST_CASE("lines are proved among unknown space and without self-collision", "[search][line]") {
  RigOptions options;
  options.unknown = scene::UnknownPolicy::block;
  options.self = false;
  LineRig rig(panda(), options);
  REQUIRE_FALSE(rig.environment.unknown_field().empty());
  const Counts counts = compare(rig, 400);
  CHECK(counts.refused <= counts.refused_by_edge + 3);
}

TEST_CASE("lines are proved far from the origin of world and map", "[search][line]") {
  RigOptions options;
  options.shift = {Eigen::AngleAxisd(0.4, Vector3d(0.1, 0.2, 1.0).normalized()).toRotationMatrix(),
                   {4000.0, -3000.0, 20.0}};
  LineRig rig(panda(), options);
  check(rig, 300, 20);
}

TEST_CASE("thick links outside of the box of a map's field are not taken for collisions",
          "[search][line]") {
  RigOptions options;
  options.self = options.obstacles = false;
  options.map = "shelf";
  model::ChainOptions chain;
  chain.links = 3;
  chain.length_m = 0.4;
  chain.radius_m = 0.25;  // the box ends 0.16 m from the voxels
  LineRig rig{model::make_chain(chain), options};
  const Counts counts = compare(rig, 300);
  CHECK(counts.proved > 50);
  CHECK(counts.refused <= counts.refused_by_edge + 3);
}

TEST_CASE("an arm with more than the lanes hold is checked exactly", "[search][line]") {
  model::ChainOptions options;
  options.links = 18;
  options.length_m = 0.06;
  LineRig rig{model::make_chain(options)};
  const Counts counts = compare(rig, 60);
  CHECK(counts.refused <= counts.refused_by_edge + 1);
  CHECK(rig.line.counts().whole == 60);
}

TEST_CASE("a proof that goes on check by check has the same answer and the same work",
          "[search][line]") {
  model::ChainOptions longer;
  longer.links = 18;
  longer.length_m = 0.06;
  for (const model::Model& arm : {model::Model(panda()), model::Model(model::make_chain(longer))}) {
    RigOptions options;
    options.self = options.obstacles = false;
    LineRig rig(arm.robot(), options), other(arm.robot(), options);
    int open = 0;
    for (int i = 0; i < 100; ++i) {
      const VectorXd a = rig.random_q();
      const VectorXd b = a + rig.rng.uniform(0.02, 0.5) * (rig.random_q() - a);
      search::Margins margins(0.01);
      margins.add(a, 0.002, 0.02, 0.3);
      for (LineRig* each : {&rig, &other}) each->line.set_margins(margins);
      const bool clear = rig.line.motion_clear(a, b);
      other.line.begin_motion(a, b);
      std::optional<bool> answer;
      for (long before = other.line.checks(); !answer; before = other.line.checks()) {
        answer = other.line.prove(1);
        REQUIRE(other.line.checks() - before <= 3);
        open += answer ? 0 : 1;
      }
      REQUIRE(*answer == clear);
      REQUIRE(other.line.checks() == rig.line.checks());
    }
    CHECK(open > 50);
  }
}

TEST_CASE("lines have the same answers and the same work on all instruction sets",
          "[search][line]") {
  const Isa usual = default_isa();
  std::vector<bool> first;
  long checks = 0;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) continue;
    set_default_isa(isa);
    LineRig rig(panda());
    search::Margins margins(0.012);
    std::vector<bool> answers;
    for (int i = 0; i < 3000; ++i) {
      const VectorXd a = rig.random_q(), b = a + rig.rng.uniform(0.02, 0.6) * (rig.random_q() - a);
      if (i % 10 == 0) {
        margins.clear();
        margins.add(a, 0.002, 0.02, 0.3);
        rig.line.set_margins(margins);
      }
      answers.push_back(rig.line.motion_clear(a, b));
    }
    if (first.empty()) {
      first = answers;
      checks = rig.line.checks();
    }
    CHECK(answers == first);
    CHECK(rig.line.checks() == checks);
  }
  set_default_isa(usual);
}

TEST_CASE("checks of lines do not allocate", "[search][line]") {
  LineRig rig(panda());
  search::Margins margins(0.012);
  std::vector<std::pair<VectorXd, VectorXd>> lines;
  for (int i = 0; i < 300; ++i) {
    const VectorXd a = rig.random_q();
    lines.emplace_back(a, a + 0.2 * (rig.random_q() - a));
  }
  margins.add(lines[0].first, 0.002, 0.02, 0.3);
  rig.line.set_margins(margins);
  (void)rig.line.motion_clear(lines[0].first, lines[0].second);
  test::require_allocation_count();
  CHECK(test::allocations_in([&] {
          rig.line.set_margins(margins);
          for (const auto& [a, b] : lines) (void)rig.line.motion_clear(a, b);
        }) == 0);
}

TEST_CASE("sine and cosine in the lanes are off by less than the theory allows", "[search][line]") {
  const auto sincos = search::kernel::select_line_kernels(default_isa()).sincos;
  Rng rng(5);
  double worst = 0.0;
  for (int i = 0; i < 20000; ++i) {
    std::array<float, search::kernel::lanes> x{}, sine{}, cosine{};
    for (float& number : x) number = static_cast<float>(rng.uniform(-12.0, 12.0));
    sincos(x.data(), sine.data(), cosine.data());
    for (std::size_t l = 0; l < x.size(); ++l) {
      const auto exact = static_cast<double>(x[l]);
      worst = std::max({worst, std::abs(static_cast<double>(sine[l]) - std::sin(exact)),
                        std::abs(static_cast<double>(cosine[l]) - std::cos(exact))});
    }
  }
  CHECK(worst < 8.0 * 0x1p-24);
  CHECK(worst > 0.5 * 0x1p-24);  // it is single precision
}
