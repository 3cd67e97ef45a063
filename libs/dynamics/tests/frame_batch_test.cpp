#include "hamelin/dynamics/frame_batch.hpp"

#include <catch2/catch.hpp>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;

namespace {

StatesXd random_states(Rng& rng, int dof, int states) {
  StatesXd q(dof, states);
  for (double& x : q.reshaped()) x = rng.uniform(-3.0, 3.0);
  return q;
}

// The largest difference from the functions of one state.
double difference(const Model& model, int frame, Reference reference, const StatesXd& q,
                  const StatesXd& poses, const StatesXd& jacobians) {
  Workspace ws(model);
  Matrix6Xd J(6, model.dof());
  double most = 0.0;
  for (Index s = 0; s < q.cols(); ++s) {
    forward_kinematics(model, ws, q.col(s).eval());
    const geometry::SE3 pose = frame_pose(model, ws, frame);
    frame_jacobian(model, ws, frame, reference, J);
    Eigen::VectorXd expected(12);
    expected << pose.R().reshaped(), pose.p();
    most = std::max(most, (poses.col(s) - expected).lpNorm<Eigen::Infinity>());
    most = std::max(most, (jacobians.col(s) - J.reshaped()).lpNorm<Eigen::Infinity>());
  }
  return most;
}

}  // namespace

TEST_CASE("poses and Jacobians of many states are those of one", "[dynamics][frames]") {
  const auto c = GENERATE(test::FrameCase{1, 1, 0, false}, test::FrameCase{2, 7, 0, false},
                          test::FrameCase{3, 6, 2, false}, test::FrameCase{4, 4, 0, true},
                          test::FrameCase{5, 6, 3, true});
  const auto reference =
      GENERATE(Reference::world, Reference::local, Reference::local_world_aligned);
  const Model model = test::model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  Rng rng(c.seed + 9);
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4}) {
    if (!is_available(isa)) continue;
    for (int frame = 0; frame < static_cast<int>(model.frames().size()); ++frame) {
      CAPTURE(c.seed, frame, static_cast<int>(reference), static_cast<int>(isa));
      const StatesXd q = random_states(rng, c.n, 1 + frame * 3);  // packets that are not full
      StatesXd poses(12, q.cols()), J(6 * c.n, q.cols());
      FrameBatch batch(model, frame, {.reference = reference, .isa = isa});
      batch.evaluate(q, poses, J);
      CHECK(difference(model, frame, reference, q, poses, J) <= 1e-13);
      StatesXd poses_alone(12, q.cols()), J_alone(6 * c.n, q.cols());
      batch.poses(q, poses_alone);
      batch.jacobians(q, J_alone);
      CHECK(poses_alone == poses);
      CHECK(J_alone == J);
      StatesXd poses_shared(12, q.cols()), J_shared(6 * c.n, q.cols());
      FrameBatch shared(model, frame, {.reference = reference, .isa = isa, .threads = 3});
      shared.evaluate(q, poses_shared, J_shared);
      CHECK(poses_shared == poses);
      CHECK(J_shared == J);
    }
  }
}

TEST_CASE("blocks of states that do not fit are refused, and nothing is allocated",
          "[dynamics][frames]") {
  const Model model = test::model_with_frames(2, 7, 3, false);
  FrameBatch batch(model, Model::tip_frame);
  Rng rng(1);
  const StatesXd q = random_states(rng, 7, 40);
  StatesXd poses(12, 40), J(42, 40);
  CHECK_THROWS_AS(batch.poses(q, J), Error);
  CHECK_THROWS_AS(batch.jacobians(q, poses), Error);
  CHECK_THROWS_AS(batch.poses(q.leftCols(39).eval(), poses), Error);
  CHECK_THROWS_AS(batch.poses(poses, poses), Error);
  CHECK_THROWS_AS(FrameBatch(model, 99), Error);
  CHECK_THROWS_AS(FrameBatch(model, 0, {.threads = 0}), Error);
  const StatesXd before = poses;
  batch.poses(q.leftCols(16), poses.leftCols(16));  // a block of both
  CHECK(poses.rightCols(24) == before.rightCols(24));
  test::require_allocation_count();
  CHECK(test::allocations_in([&] { batch.evaluate(q, poses, J); }) == 0);
}
