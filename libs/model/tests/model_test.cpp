#include "hamelin/model/model.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <cmath>
#include <functional>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using geometry::SE3;

namespace {

// Pose of a link's COM frame at q by the product of exponentials,
// docs/theory.md (1.15).
SE3 com_pose(const model::Robot& robot, int link, const Eigen::VectorXd& q) {
  SE3 g;
  for (int j = 0; j <= link; ++j)
    g = g * SE3::exp(robot.links[static_cast<std::size_t>(j)].joint.screw * q[j]);
  return g * robot.links[static_cast<std::size_t>(link)].com;
}

}  // namespace

TEST_CASE("no shape of the arm is ever farther from the base than reach", "[model][property]") {
  const bool planar = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    const auto robot = test::random_robot(seed, 6, prismatic_every, planar);
    const model::Model model(robot);
    Rng rng(seed);
    for (int trial = 0; trial < 50; ++trial) {
      const Eigen::VectorXd q = test::random_joints(rng, 6, prismatic_every > 0 ? 1.0 : 3.0);
      for (int i = 0; i < 6; ++i) {
        const SE3 g = com_pose(robot, i, q);
        for (const auto& sphere : robot.links[static_cast<std::size_t>(i)].spheres)
          REQUIRE((g * sphere.center_m).norm() + sphere.radius_m <= model.reach() + 1e-12);
      }
    }
  }
}

TEST_CASE("planar chains run in SE(2), others in SE(3)", "[model][unit]") {
  CHECK(model::Model(test::random_robot(1, 5, 0, true)).planar());
  CHECK(model::Model(test::random_robot(1, 5, 2, true)).planar());
  CHECK_FALSE(model::Model(test::random_robot(1, 5, 0, false)).planar());
  auto tilted = test::random_robot(1, 3, 0, true);
  const Eigen::Vector3d axis = tilted.links[2].joint.screw.head<3>();
  const Eigen::Vector3d turned = (axis + 1e-6 * axis.unitOrthogonal()).normalized();
  tilted.links[2].joint.screw << turned, -turned.cross(tilted.links[2].com.p());
  CHECK_FALSE(model::Model(tilted).planar());
}

TEST_CASE("nearly parallel axes still give exact frames", "[model][hard]") {
  // The foot of the common normal of two axes 1e-9 rad apart is kilometres away, so only the
  // normal's direction may be used.
  for (const double tilt : {1e-15, 1e-12, 1e-9, 1e-6}) {
    auto robot = test::random_robot(3, 4, 0, true);
    const Eigen::Vector3d axis = robot.links[1].joint.screw.head<3>();
    const Eigen::Vector3d turned = (axis + tilt * axis.unitOrthogonal()).normalized();
    const Eigen::Vector3d at = robot.links[1].com.p();
    robot.links[1].joint.screw << turned, -turned.cross(at);
    // a perpendicular axis makes the chain spatial for every tilt
    const Eigen::Vector3d across = axis.unitOrthogonal();
    robot.links[3].joint.screw << across, -across.cross(robot.links[3].com.p());
    const model::Model model(robot);
    REQUIRE_FALSE(model.planar());
    const auto& chain = std::get<model::SpatialChain>(model.chain());
    // rebuild the COM frames at q = 0 from the chain's own constants
    SE3 g = model.root();
    for (int i = 0; i < 4; ++i) {
      const auto& l = chain.links[static_cast<std::size_t>(i)];
      Eigen::Matrix3d R;
      R = Eigen::AngleAxisd(std::atan2(l.sin_alpha, l.cos_alpha), Eigen::Vector3d::UnitX()) *
          Eigen::AngleAxisd(l.offset, Eigen::Vector3d::UnitZ());
      g = g * SE3(R, Eigen::Vector3d(l.p0.x, l.p0.y, l.p0.z));
      CAPTURE(tilt, i);
      const SE3 com = g * model.com_in_frame(i);
      CHECK((com.R() - robot.links[static_cast<std::size_t>(i)].com.R()).norm() < 1e-13);
      CHECK((com.p() - robot.links[static_cast<std::size_t>(i)].com.p()).norm() < 1e-13);
    }
  }
}

TEST_CASE("make_chain builds the chain of the reference figures", "[model][unit]") {
  model::ChainOptions options;
  options.links = 4;
  const auto robot = model::make_chain(options);
  REQUIRE(robot.dof() == 4);
  const char axes[] = {'x', 'z', 'x', 'x'};
  for (int i = 0; i < 4; ++i) {
    const auto& link = robot.links[static_cast<std::size_t>(i)];
    const Eigen::Vector3d axis =
        axes[i] == 'x' ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d at{0.0, 0.2 * i, 0.0};
    CHECK((link.joint.screw.head<3>() - axis).norm() < 1e-15);
    CHECK((link.joint.screw.tail<3>() + axis.cross(at)).norm() < 1e-15);
    CHECK((link.com.p() - Eigen::Vector3d(0.0, 0.2 * i + 0.1, 0.0)).norm() < 1e-15);
    CHECK(link.inertia_kg_m2(0, 0) == Approx(0.04 / 12.0 + 0.0009 / 4.0));
    CHECK(link.inertia_kg_m2(1, 1) == Approx(0.0009 / 2.0));
  }
  CHECK((robot.tip.pose.p() - Eigen::Vector3d(0.0, 0.8, 0.0)).norm() < 1e-15);
}

TEST_CASE("a robot written as JSON reads back the same", "[model][io]") {
  model::ChainOptions options;
  options.links = 5;
  const auto robot = model::make_chain(options);
  const Json written = description::robot_to_json(robot);
  const Json again = description::robot_to_json(description::robot_from_json(written, "again"));
  CHECK(written == again);
}

TEST_CASE("an impossible arm is refused with one line", "[model][input]") {
  struct Bad {
    const char* name;
    std::function<void(model::Robot&)> spoil;
    const char* expected;
  };
  const std::vector<Bad> all{
      {"no link", [](model::Robot& r) { r.links.clear(); }, "link"},
      {"negative mass", [](model::Robot& r) { r.links[1].mass_kg = -1.0; }, "mass"},
      {"NaN inertia", [](model::Robot& r) { r.links[1].inertia_kg_m2(0, 0) = std::nan(""); },
       "link1"},
      {"indefinite inertia", [](model::Robot& r) { r.links[1].inertia_kg_m2(1, 1) = -0.1; },
       "inertia"},
      {"zero moment with mass",
       [](model::Robot& r) {
         r.links[1].inertia_kg_m2 = Eigen::Vector3d(0.1, 0.1, 0.0).asDiagonal();
       },
       "inertia"},
      {"zero axis", [](model::Robot& r) { r.links[1].joint.screw.setZero(); }, "joint1"},
      {"crossed limits",
       [](model::Robot& r) { r.links[1].joint.lower = 1.0, r.links[1].joint.upper = -1.0; },
       "limit"},
  };
  for (const auto& bad : all) {
    CAPTURE(bad.name);
    auto robot = test::random_robot(5, 3);
    bad.spoil(robot);
    try {
      model::check(robot, "bad.json");
      FAIL("accepted");
    } catch (const Error& e) {
      const std::string text = e.what();
      CHECK(text.find("bad.json") == 0);
      CHECK(text.find('\n') == std::string::npos);
      CAPTURE(text);
      CHECK(text.find(bad.expected) != std::string::npos);
    }
  }
}

TEST_CASE("inertias that are asymmetric by rounding only are accepted, others are refused",
          "[model][unit]") {
  const Eigen::Vector3d moments(0.3, 0.7, 0.9);
  int rounded = 0;
  for (std::uint64_t seed = 1; seed <= 50; ++seed) {
    Rng rng(seed);
    const Eigen::Matrix3d R = test::random_rotation(rng);
    model::Robot robot = test::random_robot(seed, 3);
    Eigen::Matrix3d& inertia = robot.links[1].inertia_kg_m2;
    inertia = R * moments.asDiagonal() * R.transpose();
    rounded += inertia != inertia.transpose() ? 1 : 0;
    const model::Model model(robot);
    const Eigen::Matrix3d& used = model.robot().links[1].inertia_kg_m2;
    CHECK(used == used.transpose());
    CHECK((used - inertia).cwiseAbs().maxCoeff() < 1e-15);
    // its JSON form gives the same model
    const model::Model again(
        description::robot_from_json(description::robot_to_json(robot), "again"));
    CHECK(again.robot().links[1].inertia_kg_m2 == used);

    inertia(0, 1) += 1e-11;
    CHECK_THROWS_WITH(model::Model(robot), Catch::Contains("link '" + robot.links[1].name) &&
                                               Catch::Contains("inertia is not symmetric"));
  }
  CHECK(rounded > 10);
}

TEST_CASE("a base that is no pose and gravity that is no number are refused", "[model][input]") {
  const auto robot = test::random_robot(5, 3);
  const Eigen::Matrix3d identity = Eigen::Matrix3d::Identity();
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero(), down(0.0, 0.0, -9.81);
  const double nan = std::nan("");
  const auto refuses = [&](const Eigen::Matrix3d& R, const Eigen::Vector3d& p,
                           const Eigen::Vector3d& gravity, const char* message) {
    CHECK_THROWS_WITH(model::Model(robot, SE3(R, p), gravity), Catch::Contains(message));
  };
  refuses(2.0 * identity, zero, down, "random: the rotation of the base is not a rotation matrix");
  refuses(-identity, zero, down, "random: the rotation of the base");
  for (int k = 0; k < 9; ++k) {
    Eigen::Matrix3d R = identity;
    R.data()[k] = nan;
    refuses(R, zero, down, "random: the rotation of the base");
  }
  for (int k = 0; k < 3; ++k) {
    refuses(identity, nan * Eigen::Vector3d::Unit(k), down, "random: the base is (");
    refuses(identity, zero, HUGE_VAL * Eigen::Vector3d::Unit(k), "random: gravity is (");
  }
  Rng rng(1);
  const Eigen::Matrix3d R = test::random_rotation(rng);
  CHECK_NOTHROW(
      model::Model(robot, SE3(R * R * R.transpose(), Eigen::Vector3d(1.0, -2.0, 3.0)), zero));
}

TEST_CASE("models of equal numbers have one fingerprint, others have their own", "[model][unit]") {
  const bool planar = GENERATE(false, true);
  const auto robot = test::random_robot(5, 4, 3, planar);
  const std::uint64_t own = model::Model(robot).fingerprint();
  CHECK(model::Model(robot).fingerprint() == own);
  CHECK(model::Model(model::Model(robot)).fingerprint() == own);
  const Json written = description::robot_to_json(robot);
  const auto read = [&] {
    return model::Model(description::robot_from_json(written, "again")).fingerprint();
  };
  CHECK(read() == read());

  auto renamed = robot;
  renamed.name = "other";
  renamed.links[1].joint.upper = 1.0;
  renamed.links[2].spheres.clear();
  CHECK(model::Model(renamed).fingerprint() == own);

  const SE3 base(Eigen::AngleAxisd(0.1, Eigen::Vector3d::UnitX()).toRotationMatrix(),
                 Eigen::Vector3d::Zero());
  CHECK(model::Model(robot, base).fingerprint() != own);
  CHECK(model::Model(robot, SE3(Eigen::Matrix3d::Identity(), Eigen::Vector3d(0.0, 0.0, 1e-9)))
            .fingerprint() != own);
  CHECK(model::Model(robot, SE3{}, Eigen::Vector3d(0.0, 0.0, -9.8)).fingerprint() != own);
  const std::vector<std::function<void(model::Link&)>> changes{
      [](auto& l) { l.mass_kg *= 1.0 + 1e-15; }, [](auto& l) { l.inertia_kg_m2 *= 1.0 + 1e-12; },
      [](auto& l) { l.joint.armature = 1e-9; },
      [](auto& l) { l.com = SE3(l.com.R(), l.com.p() + Eigen::Vector3d(1e-9, 1e-9, 1e-9)); }};
  for (std::size_t link = 0; link < 4; ++link)
    for (std::size_t change = 0; change < changes.size(); ++change) {
      CAPTURE(link, change);
      auto changed = robot;
      changes[change](changed.links[link]);
      CHECK(model::Model(changed).fingerprint() != own);
    }
}

TEST_CASE("a shape of another model has no description", "[model][unit]") {
  const model::Model model(test::random_robot(5, 3));
  model::Model::Shape shape = model.shapes()[1];
  CHECK(model.describe(shape) == "sphere 0 of link 'link1'");
  shape.link = 3;
  CHECK_THROWS_WITH(model.describe(shape), Catch::Contains("has no shape 0 on link 3"));
  shape.link = -1;
  CHECK_THROWS_WITH(model.describe(shape), Catch::Contains("link -1"));
  shape.link = 1;
  shape.index_in_link = 1;
  CHECK_THROWS_WITH(model.describe(shape), Catch::Contains("has no shape 1"));
  shape.is_capsule = true;
  shape.index_in_link = 0;
  CHECK_THROWS_WITH(model.describe(shape), Catch::Contains("has no shape 0"));
}
