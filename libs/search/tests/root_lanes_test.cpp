#include "../src/root_lanes.hpp"

#include <catch2/catch.hpp>
#include <filesystem>
#include <utility>

#include "hamelin/core/isa.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

const std::filesystem::path robots = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data/robots";

/// Draws targets that the arm reaches, and postures from which to go there.
struct RootRig {
  explicit RootRig(const std::string& robot)
      : arm(description::read_robot(robots / robot)),
        box(arm.dof(), limits(&model::Joint::lower), limits(&model::Joint::upper), 1e-3),
        lanes(arm, box),
        ws(arm),
        q(MatrixXd::Zero(arm.dof(), search::kernel::lanes)) {}

  VectorXd limits(std::optional<double> model::Joint::*limit) const {
    VectorXd out(arm.dof());
    for (Index j = 0; j < arm.dof(); ++j)
      out[j] = (arm.robot().links[static_cast<std::size_t>(j)].joint.*limit)
                   .value_or(limit == &model::Joint::lower ? -3.0 : 3.0);
    return out;
  }
  geometry::SE3 tip(const VectorXd& at) {
    dynamics::forward_kinematics(arm, ws, at);
    return dynamics::tip_pose(arm, ws);
  }
  void draw(bool turns) {
    VectorXd at(arm.dof());
    for (Index l = 0; l < q.cols(); ++l) {
      box.draw(rng, at);
      auto& target = targets[static_cast<std::size_t>(l)];
      target.position = tip(at).p();
      target.rotation = tip(at).R();
      target.turns = turns;
      box.draw(rng, at);
      q.col(l) = at;
    }
  }

  // 40 steps, in as many parts. @return bits of the postures that came near to their targets
  unsigned solve(int parts = 1) {
    lanes.begin(targets, q);
    unsigned near = 0;
    for (int i = 0; i < parts; ++i) near = lanes.advance(40 / parts);
    lanes.write(q);
    return near;
  }

  model::Model arm;
  dynamics::JointBox box;
  search::RootLanes lanes;
  dynamics::Workspace ws;
  search::RootLanes::Targets targets;
  MatrixXd q;
  Rng rng{3};
};

}  // namespace

TEST_CASE("postures that come near to their targets are near by the exact kinematics",
          "[search][roots]") {
  for (const auto* robot : {"arm7.urdf", "arm6.urdf", "rail7.urdf", "planar3.json"}) {
    RootRig rig(robot);
    REQUIRE(rig.lanes.fits());
    for (const bool turns : {true, false}) {
      CAPTURE(robot, turns);
      int near_count = 0;
      for (int i = 0; i < 40; ++i) {
        rig.draw(turns);
        const unsigned near = rig.solve();
        for (unsigned l = 0; l < search::kernel::lanes; ++l) {
          const VectorXd q = rig.q.col(l);
          REQUIRE((q.array() >= rig.box.lower.array()).all());
          REQUIRE((q.array() <= rig.box.upper.array()).all());
          if ((near >> l & 1U) == 0) continue;
          ++near_count;
          const auto& target = rig.targets[l];
          REQUIRE((rig.tip(q).p() - target.position).norm() < 0.31 * target.tolerance_m);
          const Eigen::AngleAxisd off(target.rotation.transpose() * rig.tip(q).R());
          if (turns) REQUIRE(off.angle() < 0.31 * target.tolerance_rad);
        }
      }
      CHECK(near_count > 40 * search::kernel::lanes / 5);
    }
  }
}

TEST_CASE("the lanes find about as many roots as one posture at a time", "[search][roots]") {
  RootRig rig("arm7.urdf");
  dynamics::InverseKinematics one(rig.arm, rig.box);
  int by_lanes = 0, by_one = 0;
  for (int i = 0; i < 40; ++i) {
    rig.draw(true);
    for (unsigned l = 0; l < search::kernel::lanes; ++l) {
      VectorXd q = rig.q.col(l);
      if (one.solve(rig.targets[l], q)) ++by_one;
    }
    by_lanes += __builtin_popcount(rig.solve());
  }
  CHECK(by_lanes > by_one * 8 / 10);
}

TEST_CASE("roots are the same on all instruction sets, and need no allocation", "[search][roots]") {
  const Isa usual = default_isa();
  MatrixXd first;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) continue;
    set_default_isa(isa);
    RootRig rig("arm7.urdf");
    rig.draw(true);
    CHECK(test::allocations_in([&] { (void)rig.solve(); }) == 0);
    if (first.size() == 0) first = rig.q;
    CHECK(rig.q == first);
    RootRig in_parts("arm7.urdf");
    in_parts.draw(true);
    (void)in_parts.solve(5);
    CHECK(in_parts.q == first);
  }
  set_default_isa(usual);
}

TEST_CASE("an arm with more joints than the lanes hold has no room in them", "[search][roots]") {
  const model::Model arm(test::random_robot(1, 18));
  const dynamics::JointBox box(18, VectorXd(), VectorXd(), 0.0);
  CHECK_FALSE(search::RootLanes(arm, box).fits());
}
