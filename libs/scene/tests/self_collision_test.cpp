#include <Eigen/Geometry>
#include <algorithm>
#include <catch2/catch.hpp>
#include <filesystem>
#include <limits>
#include <map>
#include <string>

#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/test/scene_data.hpp"

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;
namespace fs = std::filesystem;

namespace {

struct Named {
  std::string part;
  int body;
  Vector3d center;
  double radius;
};

// All spheres in the world, by the product of exponentials over the robot's screws.
std::vector<Named> placed(const model::Robot& robot, const geometry::SE3& base,
                          const Eigen::VectorXd& q) {
  std::vector<Named> spheres;
  geometry::SE3 moved = base;
  for (int i = 0; i < robot.dof(); ++i) {
    const auto& link = robot.links[static_cast<std::size_t>(i)];
    moved = moved * geometry::SE3::exp(link.joint.screw * q[i]);
    for (const auto& sphere : link.spheres)
      spheres.push_back({sphere.part.empty() ? link.name : sphere.part, i,
                         moved * (link.com * sphere.center_m), sphere.radius_m});
  }
  for (const auto& sphere : robot.base_spheres)
    spheres.push_back({sphere.part, -1, base * sphere.center_m, sphere.radius_m});
  return spheres;
}

// Smallest distance of each pair of parts that is checked, by name.
std::map<std::pair<std::string, std::string>, double> brute_force(
    const model::Robot& robot, const std::vector<Named>& spheres) {
  std::map<std::pair<std::string, std::string>, double> nearest;
  for (const auto& x : spheres)
    for (const auto& y : spheres) {
      if (x.body == y.body || !(x.part < y.part)) continue;
      const bool disabled = std::any_of(robot.self_collision_disabled.begin(),
                                        robot.self_collision_disabled.end(), [&](const auto& pair) {
                                          return (pair.first == x.part && pair.second == y.part) ||
                                                 (pair.first == y.part && pair.second == x.part);
                                        });
      if (disabled || (robot.self_collision_disabled.empty() && std::abs(x.body - y.body) == 1))
        continue;
      const double distance = (x.center - y.center).norm() - x.radius - y.radius;
      const auto [at, is_new] = nearest.emplace(std::make_pair(x.part, y.part), distance);
      if (!is_new) at->second = std::min(at->second, distance);
    }
  return nearest;
}

Eigen::VectorXd random_q(const model::Robot& robot, Rng& rng) {
  Eigen::VectorXd q(robot.dof());
  for (int i = 0; i < robot.dof(); ++i) {
    const auto& joint = robot.links[static_cast<std::size_t>(i)].joint;
    q[i] = rng.uniform(joint.lower.value_or(-3.0), joint.upper.value_or(3.0));
  }
  return q;
}

std::pair<std::string, std::string> names(const SelfField& field, std::size_t pair) {
  const auto& parts = field.parts();
  std::string a = parts[static_cast<std::size_t>(field.pairs()[pair].part_a)].name,
              b = parts[static_cast<std::size_t>(field.pairs()[pair].part_b)].name;
  if (b < a) std::swap(a, b);
  return {a, b};
}

void check_against_brute_force(const model::Robot& robot) {
  const geometry::SE3 base(
      Eigen::AngleAxisd(0.4, Vector3d(1, 2, 3).normalized()).toRotationMatrix(),
      Vector3d(0.3, -0.2, 0.5));
  const model::Model model(robot, base);
  const SelfField field(model);
  dynamics::Workspace ws(model);
  std::vector<Vector3d> centers(model.shapes().size());
  std::vector<SelfContact> out(field.pairs().size());
  Rng rng(5);
  std::size_t near = 0, touching = 0;
  for (int round = 0; round < 300; ++round) {
    const Eigen::VectorXd q = random_q(robot, rng);
    const auto expected = brute_force(robot, placed(robot, base, q));
    REQUIRE(expected.size() == field.pairs().size());
    dynamics::forward_kinematics(model, ws, q);
    dynamics::shape_centers(model, ws, centers);
    const double limit = 0.1;
    const std::size_t found = field.closest({centers}, limit, out);
    std::size_t within = 0;
    for (const auto& [pair, distance] : expected) within += distance <= limit ? 1 : 0;
    CHECK(found == within);
    for (std::size_t i = 0; i < found; ++i) {
      const SelfContact& contact = out[i];
      if (i > 0) CHECK(out[i - 1].pair < contact.pair);
      const auto pair = static_cast<std::size_t>(contact.pair);
      CHECK(contact.distance == Approx(expected.at(names(field, pair))).margin(1e-12));
      CHECK(field.distance(pair, {centers}, limit) == contact.distance);
      // the points lie on the named spheres, at that distance along the direction
      const auto a = static_cast<std::size_t>(contact.sphere_a);
      CHECK((contact.point_a - centers[a]).norm() == Approx(model.shapes()[a].radius));
      CHECK((contact.point_b + contact.distance * contact.direction - contact.point_a).norm() <
            1e-12);
      const int body_b = field.parts()[static_cast<std::size_t>(field.pairs()[pair].part_b)].body;
      CHECK((contact.sphere_b == SelfContact::base) == (body_b < 0));
      if (body_b >= 0)
        CHECK(model.shapes()[static_cast<std::size_t>(contact.sphere_b)].link == body_b);
      touching += contact.distance <= 0.0 ? 1 : 0;
    }
    near += found;
    // a short list keeps the nearest, in order
    if (found < 3) continue;
    std::vector<SelfContact> few(2),
        all(out.begin(), out.begin() + static_cast<std::ptrdiff_t>(found));
    CHECK(field.closest({centers}, limit, few) == found);
    std::stable_sort(all.begin(), all.end(),
                     [](const auto& x, const auto& y) { return x.distance < y.distance; });
    CHECK(few[0].pair < few[1].pair);
    CHECK(std::min(few[0].distance, few[1].distance) == all[0].distance);
    CHECK(std::max(few[0].distance, few[1].distance) == all[1].distance);
  }
  CHECK(near > 100);
  CHECK(touching > 0);
}

}  // namespace

TEST_CASE(
    "distances of the arm to itself are those of all sphere pairs, the Panda with its base and "
    "hand",
    "[scene][self]") {
  const fs::path robots = test::third_party_robots;
  const model::Robot robot = description::read_robot(
      robots / "panda.urdf", {"panda_grasptarget", robots / "panda_spheres.json"});
  check_against_brute_force(robot);
  const SelfField field{model::Model(robot)};
  CHECK(field.note().empty());
  CHECK(field.parts().size() == 11);
  // hand and fingers are fixed to one another; the hand may meet the base and the upper arm
  std::size_t hand = 0, base = 0;
  for (std::size_t i = 0; i < field.pairs().size(); ++i) {
    const auto pair = names(field, i);
    hand += pair.first == "panda_hand" ? 1 : 0;
    base += pair == std::make_pair(std::string("panda_hand"), std::string("panda_link0")) ? 1 : 0;
    CHECK_FALSE(pair == std::make_pair(std::string("panda_hand"), std::string("panda_leftfinger")));
  }
  CHECK(hand == 4);  // links 0, 1, 2 and 5
  CHECK(base == 1);
}

TEST_CASE(
    "a robot that lists no disabled pairs is checked except for neighbouring links, with a note",
    "[scene][self]") {
  const fs::path robots = fs::path(HAMELIN_SOURCE_DIR) / "data" / "robots";
  const model::Robot robot =
      description::read_robot(robots / "arm7.urdf", {std::nullopt, robots / "arm7.spheres.json"});
  check_against_brute_force(robot);
  const SelfField field{model::Model(robot)};
  CHECK(field.pairs().size() == 7 * 6 / 2 - 6);
  CHECK_THAT(field.note(), Catch::Contains("link1-link2") && Catch::Contains("link6-link7"));
}
