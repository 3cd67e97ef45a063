#include "hamelin/scene/modelled.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <numbers>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/scene/payload.hpp"

using namespace hamelin;
using Catch::Contains;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

model::Robot robot_of(const char* file) {
  return description::read_robot(std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots" / file,
                                 {});
}

model::Model modelled(const scene::Scene& scene, model::Robot robot) {
  return model::Model(std::move(robot), scene.base, scene.gravity_m_s2);
}

std::vector<std::string> described(const scene::Scene& scene, const model::Robot& robot) {
  return describe_modelled(modelled_info(scene, modelled(scene, robot)));
}

// arm7 at a start within its limits, with nothing but defaults.
scene::Scene at_home() {
  scene::Scene scene;
  scene.start_q = (VectorXd(7) << 0.0, -0.785, 0.0, -2.356, 0.0, 1.571, 0.785).finished();
  return scene;
}

std::string arm7_defect(const scene::Scene& scene) {
  return start_defect(scene, modelled(scene, robot_of("arm7.urdf")));
}

}  // namespace

TEST_CASE("a scene with defaults is described as falling, within all limits", "[scene][modelled]") {
  const auto text = described(scene::Scene(), robot_of("arm7.urdf"));
  REQUIRE(text.size() == 2);
  CHECK(
      text[0] ==
      "gravity (0, 0, -9.81) m/s^2; limits: joint on, velocity on, torque on; self-collision off");
  CHECK(text[1] == "payload none; damping off; friction off");
}

TEST_CASE("what a scene switches on or off is described", "[scene][modelled]") {
  scene::Scene scene;
  scene.gravity_m_s2.setZero();
  scene.model.velocity_limits = scene.model.torque_limits = false;
  scene.model.self_collision = true;
  scene.model.joint_damping.values = {0.5};
  scene.actuation.coulomb_friction_share = 0.01;
  scene.model.payload.emplace();
  scene.model.payload->name = "can";
  scene.model.payload->mass_kg = 0.3;
  const auto text = described(scene, robot_of("arm7.urdf"));
  CHECK(text[0] == "no gravity; limits: joint on, velocity off, torque off; self-collision on");
  CHECK(text[1] == "payload 'can' of 0.3 kg; damping on; friction on");
}

TEST_CASE("limits that the robot does not state are not in force", "[scene][modelled]") {
  model::Robot none = robot_of("planar4.json");
  const scene::Scene scene;
  CHECK_THAT(described(scene, none)[0],
             Contains("limits: joint none in the robot file, velocity none in the robot file, "
                      "torque none in the robot file"));
  auto force = limits_in_force(scene.model, none);
  CHECK_FALSE((force.position || force.velocity || force.torque));
  none.links[2].joint.upper = 1.0;
  none.links[1].joint.effort_max = 5.0;
  force = limits_in_force(scene.model, none);
  CHECK((force.position && !force.velocity && force.torque));
  CHECK_THAT(described(scene, none)[0], Contains("joint on (1 of 4 joints), velocity none"));
  scene::ModelFlags off;
  off.joint_limits = false;
  CHECK_FALSE(limits_in_force(off, none).position);
}

TEST_CASE("gravity along the normal of a planar arm is said to be without effect",
          "[scene][modelled]") {
  scene::Scene scene;
  const char* const no_effect = ", normal to the plane of the arm and without effect";
  CHECK_THAT(described(scene, robot_of("planar4.json"))[0], Contains(no_effect));   // horizontal
  CHECK_THAT(described(scene, robot_of("planar3.json"))[0], !Contains(no_effect));  // upright
  const Eigen::AngleAxisd tilt(0.5 * std::numbers::pi, Vector3d::UnitX());
  scene.base = {tilt.toRotationMatrix(), Vector3d::Zero()};
  CHECK_THAT(described(scene, robot_of("planar4.json"))[0], !Contains(no_effect));
}

TEST_CASE("a start beyond a limit in force is refused with the key that switches it off",
          "[scene][modelled]") {
  CHECK(arm7_defect(at_home()).empty());
  SECTION("position") {
    auto scene = at_home();
    scene.start_q.resize(0);  // zeros, which joint4 cannot reach
    CHECK(arm7_defect(scene) ==
          "/start/q: joint 'joint4' is at 0, beyond its limit, expected at most -0.0698 "
          "(\"joint_limits\": false under /model switches the limits off)");
    scene.model.joint_limits = false;
    CHECK(arm7_defect(scene).empty());
    scene = at_home();
    scene.start_q[1] = -1.7628;  // on the limit
    CHECK(arm7_defect(scene).empty());
    scene.start_q[1] = -1.763;
    CHECK_THAT(arm7_defect(scene), Contains("joint 'joint2'") && Contains("at least -1.7628"));
  }
  SECTION("velocity") {
    auto scene = at_home();
    scene.start_v = VectorXd::Zero(7);
    scene.start_v[6] = -2.7;
    CHECK(arm7_defect(scene) ==
          "/start/v: joint 'joint7' moves at -2.7, beyond its limit, expected at most 2.61 "
          "(\"velocity_limits\": false under /model switches the limits off)");
    scene.model.velocity_limits = false;
    CHECK(arm7_defect(scene).empty());
  }
  SECTION("torque") {
    auto scene = at_home();
    scene.gravity_m_s2 *= 5.0;
    CHECK_THAT(arm7_defect(scene),
               Contains("/start/q: joint 'joint") &&
                   Contains("to hold the arm against gravity, expected at most") &&
                   Contains("\"torque_limits\": false under /model"));
    scene.model.torque_limits = false;
    CHECK(arm7_defect(scene).empty());
  }
  SECTION("sizes") {
    auto scene = at_home();
    scene.start_v = VectorXd::Zero(2);
    CHECK_THROWS_WITH(arm7_defect(scene), "/start/v: 2 values given, expected 7");
  }
}
