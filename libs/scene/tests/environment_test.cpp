#include "hamelin/scene/environment.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <catch2/catch.hpp>
#include <cmath>
#include <filesystem>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/scene_queries.hpp"
#include "hamelin/test/temporary.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;

Obstacle ball(double radius, const Vector3d& at) {
  Obstacle o;
  o.name = "ball";
  o.radius_m = radius;
  o.pose = {Eigen::Matrix3d::Identity(), at};
  return o;
}

Obstacle block(const Vector3d& size, const Vector3d& at) {
  Obstacle o;
  o.shape = Shape::box;
  o.size_m = size;
  o.pose = {Eigen::Matrix3d::Identity(), at};
  return o;
}

// A map of a 0.4 m cube at (0.6, 0, 0) in known space 1.5 m wide. The file is deleted with the
// object.
struct RoomMap {
  RoomMap() {
    MakeMapOptions options;
    options.resolution_m = 0.02;
    options.mark = Mark::centre;
    options.primitives = {block({0.4, 0.4, 0.4}, {0.6, 0.0, 0.0})};
    options.free_bounds = Box{{-0.75, -0.75, -0.75}, {0.75, 0.75, 0.75}};
    options.output = file;
    make_map(options);
  }
  ~RoomMap() { std::filesystem::remove(file); }
  std::filesystem::path file = test::temporary("hamelin_scene_room.bt");
};

}  // namespace

TEST_CASE("contacts of a map are in the world frame", "[scene][unit]") {
  const RoomMap room;
  // The map is turned by 90° about z and shifted: the cube's centre goes to (1, 0.6, 2).
  MapSpec spec;
  spec.file = room.file;
  spec.pose = {Eigen::AngleAxisd(std::acos(0.0), Vector3d::UnitZ()).toRotationMatrix(),
               {1.0, 0.0, 2.0}};
  const Environment environment(spec, {}, {Eigen::Matrix3d::Identity(), {1.0, 0.0, 2.0}}, 0.8, 0.3);
  CHECK(environment.has_obstacles());
  CHECK(environment.summary().boxes == 1);
  CHECK(environment.summary().leaves_cropped > 1);
  Environment::Scratch scratch(environment, 2);
  const std::vector<Vector3d> centers{{1.1, 0.2, 2.05}, {1.0, -0.3, 2.0}};
  const std::vector<double> radii{0.05, 0.1};
  std::array<Contact, 8> out;
  REQUIRE(environment.closest({centers, radii}, 0.3, 0.0, scratch, out) == 1);
  CHECK(out[0].sphere == 0);
  CHECK(out[0].obstacle == Contact::map);
  CHECK(out[0].distance == Approx(0.15).epsilon(1e-12));
  CHECK((out[0].direction - Vector3d(0.0, -1.0, 0.0)).norm() < 1e-12);
  CHECK((out[0].obstacle_point - Vector3d(1.1, 0.4, 2.05)).norm() < 1e-12);
  CHECK((out[0].arm_point - Vector3d(1.1, 0.25, 2.05)).norm() < 1e-12);
  CHECK(environment.clearance({centers, radii}, 0.0, 1.0) == Approx(0.15).epsilon(1e-12));
  CHECK(environment.clearance({centers, radii}, 0.0, 0.1) == 0.1);
}

TEST_CASE("unknown space is free, slow or an obstacle by its policy", "[scene][unit]") {
  const RoomMap room;
  MapSpec spec;
  spec.file = room.file;
  const std::vector<Vector3d> centers{{-0.65, 0.0, 0.0}}, outside{{-0.8, 0.0, 0.0}};
  const std::vector<double> radii{0.05};
  std::array<Contact, 8> out;
  for (const auto policy : {UnknownPolicy::free, UnknownPolicy::slow, UnknownPolicy::block}) {
    CAPTURE(to_string(policy));
    spec.unknown = policy;
    const Environment environment(spec, {}, {}, 1.0, 0.2);
    Environment::Scratch scratch(environment, 1);
    // The voxels reach to ±0.76. Of the unit ball, what is outside them is unknown: six caps of
    // height h = 0.24, with π h² (3 − h)/3 each.
    CHECK(environment.summary().within_reach.has_value() == (policy != UnknownPolicy::free));
    CHECK(environment.summary().within_reach.value_or(shares_within_reach(spec, {}, 1.0)).unknown ==
          Approx(6.0 * 0.24 * 0.24 * 2.76 / 3.0 / (4.0 / 3.0)).epsilon(0.01));
    CHECK(environment.in_slow_space({outside, radii}) == (policy == UnknownPolicy::slow));
    CHECK_FALSE(environment.in_slow_space({centers, radii}));
    const std::size_t count = environment.closest({centers, radii}, 0.2, 0.0, scratch, out);
    CHECK(count == (policy == UnknownPolicy::block ? 1 : 0));
    if (count > 0) {
      CHECK(out[0].obstacle == Contact::unknown);
      CHECK(out[0].distance == Approx(0.76 - 0.65 - 0.05).epsilon(1e-9));
      CHECK(out[0].direction.x() == Approx(1.0));
    }
    CHECK((environment.clearance({outside, radii}, 0.0, 1.0) <= 0.0) ==
          (policy == UnknownPolicy::block));
  }
}

TEST_CASE("a map changes when a change is due, and changed voxels are known", "[scene][unit]") {
  MapSpec spec;
  spec.file = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "maps" / "shelf.bt";
  spec.unknown = UnknownPolicy::block;
  spec.changes = {{1.0,
                   std::nullopt,
                   {{{-0.2, -0.2, 0.9}, {0.2, 0.2, 1.3}}},
                   {{{0.05, 0.05, 1.0}, {0.1, 0.1, 1.05}}}}};
  Environment environment(spec, {}, {}, 0.9, 0.2);
  const std::vector<Vector3d> centers{{0.075, 0.075, 1.15}};
  const std::vector<double> radii{0.02};
  const auto clearance = [&] { return environment.clearance({centers, radii}, 0.0, 0.2); };
  const double before = clearance();
  CHECK(environment.advance(0.5).empty());
  CHECK(clearance() == before);
  CHECK_THAT(environment.advance(1.0), Catch::Contains("125 voxels are occupied"));
  CHECK(clearance() == Approx(0.1 - 0.02));
  CHECK(environment.advance(9.0).empty());

  // a change by file must be of the same grid
  spec.changes = {
      {1.0, std::filesystem::path(HAMELIN_SOURCE_DIR) / "data" / "maps" / "clutter.bt", {}, {}}};
  CHECK_THROWS_WITH(Environment(spec, {}, {}, 0.9, 0.2),
                    Catch::Contains("clutter.bt: resolution 0.02 m"));
}

TEST_CASE("in a map without a file all is unknown", "[scene][unit]") {
  const std::vector<Vector3d> at{{0.3, 0.1, 0.2}};
  const std::vector<double> radius{0.05};
  const auto clearance = [&](UnknownPolicy unknown, double keep_out_m) {
    MapSpec map;
    map.resolution_m = 0.02;
    map.unknown = unknown;
    map.keep_out_radius_m = keep_out_m;
    const Environment environment(map, {}, {}, 1.0, 0.2);
    CHECK(environment.summary().has_map);
    CHECK(environment.map_field().empty());
    return environment.clearance({at, radius}, 0.0, 0.5);
  };
  CHECK(clearance(UnknownPolicy::free, 0.0) == 0.5);
  CHECK(clearance(UnknownPolicy::block, 0.0) < -0.2);
  // the voxels that the ball touches are free
  const double beyond_m = 0.6 - at[0].norm() - radius[0],
               there = clearance(UnknownPolicy::block, 0.6);
  CHECK(there >= beyond_m);
  CHECK(there < beyond_m + 0.02 * std::sqrt(3.0));
  MapSpec map;
  map.resolution_m = 0.0;
  CHECK_THAT(test::error_of([&] { Environment(map, {}, {}, 1.0, 0.2); }),
             Catch::Contains("resolution_m: 0 m given"));
}

TEST_CASE("the keep-out ball frees unknown space around the base", "[scene][unit]") {
  const RoomMap room;
  MapSpec spec;
  spec.file = room.file;
  spec.unknown = UnknownPolicy::block;
  const geometry::SE3 base{Eigen::Matrix3d::Identity(), {-0.9, 0.0, 0.0}};
  const std::vector<Vector3d> centers{{-0.9, 0.0, 0.0}};
  const std::vector<double> radii{0.05};
  CHECK(Environment(spec, {}, base, 1.0, 0.2).clearance({centers, radii}, 0.0, 1.0) < 0.0);
  spec.keep_out_radius_m = 0.2;
  const double clearance =
      Environment(spec, {}, base, 1.0, 0.2).clearance({centers, radii}, 0.0, 1.0);
  CHECK(clearance > 0.15 - 1e-12);
  CHECK(clearance < 0.15 + 0.02 * std::sqrt(3.0));
}

TEST_CASE("obstacle contacts have index and velocity, and none before the time of appearance",
          "[scene][unit]") {
  Obstacle moving = ball(0.1, {1.0, 0.0, 0.0});
  moving.motion = SineMotion{{0.0, 0.3, 0.0}, 2.0};
  Obstacle late = ball(0.1, {0.0, 0.5, 0.0});
  late.appears_s = 1.0;
  const Environment environment(std::nullopt, {moving, late}, {}, 1.0, 0.5);
  CHECK(environment.has_obstacles());
  CHECK_FALSE(Environment{}.has_obstacles());
  Environment::Scratch scratch(environment, 1);
  const std::vector<Vector3d> centers{{0.5, 0.0, 0.0}};
  const std::vector<double> radii{0.1};
  std::array<Contact, 8> out;
  REQUIRE(environment.closest({centers, radii}, 0.6, 0.0, scratch, out) == 1);
  CHECK(out[0].obstacle == 0);
  CHECK(out[0].distance == Approx(0.3));
  CHECK((out[0].obstacle_velocity - Vector3d(0.0, 0.3 * std::acos(-1.0), 0.0)).norm() < 1e-12);
  REQUIRE(environment.closest({centers, radii}, 0.6, 1.0, scratch, out) == 2);
  CHECK(out[0].obstacle == 0);
  CHECK(out[1].obstacle == 1);
  CHECK(environment.clearance({centers, radii}, 0.5, infinity) ==
        Approx(std::hypot(0.5, 0.3) - 0.2));
}

TEST_CASE("the judge sees what the planner does not", "[scene][unit]") {
  Obstacle judged = ball(0.1, {0.5, 0.0, 0.0});
  judged.judge_only = true;
  Obstacle hidden = ball(0.1, {-0.5, 0.0, 0.0});
  hidden.known = false;
  hidden.visible_within_m = 0.2;
  const Environment environment(std::nullopt, {judged, hidden}, {}, 1.0, 0.5);
  Environment::Scratch scratch(environment, 1);
  const std::vector<Vector3d> far{{0.0, 0.0, 0.0}}, near{{-0.15, 0.0, 0.0}};
  const std::vector<double> radii{0.1};
  std::array<Contact, 8> out;
  CHECK(environment.closest({far, radii}, 0.5, 0.0, scratch, out) == 0);
  CHECK(environment.closest({far, radii}, 0.5, 0.0, scratch, out, View::judge) == 2);
  CHECK(environment.closest({far, radii}, 0.5, 0.0, scratch, out, View::hidden) == 2);
  // a query at a configuration does not reveal obstacles
  CHECK(environment.closest({near, radii}, 0.5, 0.0, scratch, out) == 0);
  std::array<std::uint8_t, 2> seen{};
  CHECK(environment.reveal_visible({far, radii}, 0.0, seen) == -1);
  CHECK(environment.closest({near, radii}, 0.5, 0.0, scratch, out, View::planner, seen) == 0);
  // an obstacle that was near is remembered
  CHECK(environment.reveal_visible({near, radii}, 0.0, seen) == 1);
  CHECK(environment.reveal_visible({near, radii}, 0.0, seen) == -1);
  CHECK(environment.reveal_visible({far, radii}, 0.0, seen) == -1);
  REQUIRE(environment.closest({far, radii}, 0.5, 0.0, scratch, out, View::planner, seen) == 1);
  CHECK(out[0].obstacle == 1);
  REQUIRE(environment.closest({far, radii}, 0.5, 0.0, scratch, out, View::hidden, seen) == 1);
  CHECK(out[0].obstacle == 0);
  CHECK(environment.clearance({far, radii}, 0.0, infinity, View::planner, seen) == Approx(0.3));
  CHECK(environment.clearance({far, radii}, 0.0, infinity) == Approx(0.3));
  CHECK(environment.clearance({far, radii}, 0.0, infinity, View::planner) == infinity);
}

TEST_CASE("a full output keeps the nearest contacts and the call returns their number",
          "[scene][unit]") {
  std::vector<Obstacle> balls;
  for (int i = 0; i < 6; ++i)
    balls.push_back(ball(0.05, {0.2 + 0.05 * ((i * 5) % 6), 0.3 * (i % 3 - 1), 0.0}));
  const Environment environment(std::nullopt, balls, {}, 1.0, 0.5);
  Environment::Scratch scratch(environment, 2);
  const std::vector<Vector3d> centers{{0.0, 0.0, 0.0}, {0.0, 0.1, 0.0}};
  const std::vector<double> radii{0.02, 0.03};
  std::array<Contact, 12> all;
  std::array<Contact, 4> few;
  REQUIRE(environment.closest({centers, radii}, 2.0, 0.0, scratch, all) == 12);
  CHECK(environment.closest({centers, radii}, 2.0, 0.0, scratch, few) == 12);
  const auto in_order = [](const Contact& a, const Contact& b) {
    return a.sphere != b.sphere ? a.sphere < b.sphere : a.distance < b.distance;
  };
  CHECK(std::is_sorted(all.begin(), all.end(), in_order));
  CHECK(std::is_sorted(few.begin(), few.end(), in_order));
  std::vector<double> distances, kept;
  for (const Contact& c : all) distances.push_back(c.distance);
  for (const Contact& c : few) kept.push_back(c.distance);
  std::sort(distances.begin(), distances.end());
  std::sort(kept.begin(), kept.end());
  CHECK(std::equal(kept.begin(), kept.end(), distances.begin()));
}

TEST_CASE("clearance is the smallest contact distance, inside obstacles too", "[scene][property]") {
  const RoomMap room;
  MapSpec spec;
  spec.file = room.file;
  Obstacle can;
  can.shape = Shape::cylinder;
  can.radius_m = 0.06;
  can.length_m = 0.2;
  can.pose = {Eigen::Matrix3d::Identity(), {0.1, 0.3, 0.2}};
  const Environment environment(spec, {can}, {}, 0.9, 0.4);
  Environment::Scratch scratch(environment, 5);
  Rng rng(5);
  int deep = 0;
  for (int i = 0; i < 500; ++i) {
    std::vector<Vector3d> centers;
    std::vector<double> radii;
    for (int k = 0; k < 5; ++k) {
      centers.push_back(rng.uniform(0.0, 0.9) * test::random_direction(rng));
      radii.push_back(rng.uniform(0.01, 0.1));
    }
    std::array<Contact, 64> out;
    const std::size_t count = environment.closest({centers, radii}, 0.4, 0.0, scratch, out);
    REQUIRE(count <= out.size());
    double smallest = 0.4;
    for (std::size_t c = 0; c < count; ++c) smallest = std::min(smallest, out[c].distance);
    CHECK(environment.clearance({centers, radii}, 0.0, 0.4) == smallest);
    deep += smallest < -0.05 ? 1 : 0;
  }
  CHECK(deep > 10);
}

TEST_CASE("contacts and clearance do not allocate", "[scene][unit]") {
  const RoomMap room;
  MapSpec spec;
  spec.file = room.file;
  spec.unknown = UnknownPolicy::block;
  const Environment environment(spec, {ball(0.1, {0.2, 0.2, 0.2}), ball(0.1, {-0.2, 0.2, 0.2})}, {},
                                0.9, 0.4);
  Rng rng(6);
  std::vector<Vector3d> centers;
  std::vector<double> radii;
  for (int k = 0; k < 60; ++k) {
    centers.push_back(rng.uniform(0.0, 0.9) * test::random_direction(rng));
    radii.push_back(rng.uniform(0.01, 0.1));
  }
  Environment::Scratch scratch(environment, centers.size());
  std::vector<Contact> out(100);
  std::size_t count = 0;
  double clearance = environment.clearance({centers, radii}, 0.0,
                                           0.4);  // the first query inside computes the surface
  const long allocations = test::allocations_in([&] {
    for (int i = 0; i < 20; ++i) {
      count += environment.closest({centers, radii}, 0.4, 0.1 * i, scratch, out);
      clearance += environment.clearance({centers, radii}, 0.1 * i, 0.4);
    }
  });
  if (test::counts_allocations()) CHECK(allocations == 0);
  CHECK(count > 20 * centers.size());
  CHECK(clearance < 0.0);
}

TEST_CASE("an environment refuses what it cannot use in one line", "[scene][unit]") {
  MapSpec spec;
  spec.file = "absent.bt";
  CHECK_THROWS_WITH(Environment(spec, {}, {}, 1.0, 0.1),
                    Catch::Matchers::StartsWith("absent.bt: "));
  CHECK_THROWS_WITH(Environment(std::nullopt, {ball(-1.0, {0.0, 0.0, 0.0})}, {}, 1.0, 0.1),
                    Catch::Matchers::Contains("'ball'"));
  const RoomMap room;
  spec.file = room.file;
  CHECK_THROWS_AS(Environment(spec, {}, {}, infinity, 0.1), Error);
  const Environment elsewhere(spec, {}, {Eigen::Matrix3d::Identity(), {50.0, 0.0, 0.0}}, 1.0, 0.1);
  REQUIRE_FALSE(elsewhere.summary().warnings.empty());
  CHECK(elsewhere.summary().warnings.back().find("no occupied leaf within") != std::string::npos);
}
