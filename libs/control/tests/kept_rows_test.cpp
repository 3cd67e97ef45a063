#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <limits>

#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/model/make_chain.hpp"
#include "hamelin/search/tip_constraints.hpp"
#include "loop/kept_rows.hpp"

using namespace hamelin;
using Eigen::VectorXd;

namespace {

struct KeptRig {
  model::Model arm{model::make_chain({6})};
  dynamics::Workspace ws{arm};
  control::KeptRows rows{6};
  std::vector<scene::TipConstraint> constraints;

  KeptRig() {
    constraints.emplace_back(scene::AxisConstraint{{0.3, 0.5, 1.0}, {0.2, -1.0, 0.4}, 0.7});
    scene::BoxConstraint box;
    box.pose = {Eigen::Matrix3d(Eigen::AngleAxisd(0.4, Eigen::Vector3d(1, 2, 3).normalized())),
                {0.1, 0.2, 0.3}};
    box.low_m = {-infinity, -0.2, -0.3};
    box.high_m = {0.5, infinity, 0.1};
    constraints.emplace_back(box);
    constraints.emplace_back(scene::SpeedConstraint{0.2});
  }
  VectorXd slack_at(const VectorXd& q) {
    dynamics::forward_kinematics(arm, ws, q);
    rows.update(arm, ws, constraints);
    return VectorXd::Map(rows.slack(), rows.size());
  }
};

}  // namespace

TEST_CASE("rows of what the tip keeps are the derivatives of what is left of it", "[control]") {
  KeptRig rig;
  Rng rng(5);
  for (int trial = 0; trial < 20; ++trial) {
    const VectorXd q = VectorXd::NullaryExpr(6, [&] { return rng.uniform(-1.5, 1.5); });
    const VectorXd slack = rig.slack_at(q);
    REQUIRE(slack.size() == 5);
    const Eigen::MatrixXd gradient = Eigen::Map<const Eigen::MatrixXd>(rig.rows.gradient(), 6, 5);
    for (Eigen::Index j = 0; j < 6; ++j) {
      constexpr double h = 1e-6;
      const VectorXd step = h * VectorXd::Unit(6, j);
      const VectorXd by = (rig.slack_at(q + step) - rig.slack_at(q - step)) / (2.0 * h);
      CHECK((by - gradient.row(j).transpose()).lpNorm<Eigen::Infinity>() < 1e-7);
    }
    // what is left is what the search and the judge measure, from the other side
    search::TipConstraints judge(rig.arm, rig.constraints);
    std::vector<double> excess(judge.size());
    judge.measure(q, q, excess);
    CHECK(slack[0] + 0.02 == Approx(-excess[0]).margin(1e-9));
    CHECK(slack.tail(4).minCoeff() + 0.003 == Approx(-excess[1]).margin(1e-9));
  }
}

TEST_CASE("an axis that points where it should has a row without a direction", "[control]") {
  KeptRig rig;
  const VectorXd q = VectorXd::Constant(6, 0.2);
  dynamics::forward_kinematics(rig.arm, rig.ws, q);
  const geometry::SE3 tip = dynamics::tip_pose(rig.arm, rig.ws);
  rig.constraints = {scene::AxisConstraint{{0, 0, 1}, tip.R().col(2), 0.7}};
  CHECK(rig.slack_at(q)[0] == Approx(0.68).margin(1e-7));
  CHECK(Eigen::Map<const VectorXd>(rig.rows.gradient(), 6).allFinite());
  rig.constraints.clear();
  CHECK(rig.slack_at(q).size() == 0);
}
