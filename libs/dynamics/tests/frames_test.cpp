#include "hamelin/dynamics/frames.hpp"

#include <catch2/catch.hpp>
#include <complex>
#include <string>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;
using Eigen::Vector3d;
using geometry::SE3;

namespace {

using ComplexChain = test::ReferenceDynamics<std::complex<double>>;
constexpr double complex_step = 1e-30;
using test::FrameCase;
using test::model_with_frames;
using test::pose_at_zero;

}  // namespace

TEST_CASE("twists of frames and their rates agree with complex steps", "[dynamics][frames]") {
  const auto c =
      GENERATE(FrameCase{1, 1, 0, false}, FrameCase{2, 7, 0, false}, FrameCase{3, 6, 2, false},
               FrameCase{4, 5, 1, false}, FrameCase{5, 4, 0, true}, FrameCase{6, 6, 3, true});
  const auto reference =
      GENERATE(Reference::world, Reference::local, Reference::local_world_aligned);
  CAPTURE(c.seed, static_cast<int>(reference));
  const Model model = model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  const ComplexChain complex(model);
  Workspace ws(model);
  Rng rng(c.seed + 200);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 3.0);
  const std::complex<double> along(0.0, complex_step);
  forward_kinematics(model, ws, q);
  Matrix6Xd J(6, c.n);
  for (int frame = 0; frame < static_cast<int>(model.frames().size()); ++frame) {
    CAPTURE(frame);
    const int link = model.frames()[static_cast<std::size_t>(frame)].link;
    const SE3& zero = pose_at_zero(model, frame);
    const auto twist = [&](const ComplexChain::VectorXc& at, const ComplexChain::VectorXc& rates) {
      return test::twist_of<std::complex<double>>(complex.motion(at, rates, link, zero), reference);
    };
    frame_jacobian(model, ws, frame, reference, J);
    const Vector6d expected = twist(q.cast<std::complex<double>>(), v).real();
    CHECK((J * v - expected).norm() <= 1e-13 * (1.0 + expected.norm()));
    CHECK((frame_velocity(model, ws, frame, reference, v) - expected).norm() <=
          1e-13 * (1.0 + expected.norm()));
    for (Index k = 0; k < c.n; ++k)
      CHECK((J.col(k) - twist(q.cast<std::complex<double>>(), VectorXd::Unit(c.n, k)).real())
                .norm() <= 1e-13);

    const ComplexChain::VectorXc moved = q + v * along;
    const Vector6d drift = twist(moved, v).imag() / complex_step,
                   rate = twist(moved, v + a * along).imag() / complex_step;
    CHECK((frame_drift(model, ws, frame, reference, v) - drift).norm() <=
          1e-12 * (1.0 + drift.norm()));
    CHECK((frame_acceleration(model, ws, frame, reference, v, a) - rate).norm() <=
          1e-12 * (1.0 + rate.norm()));
  }
}

TEST_CASE("poses of frames agree with products of exponentials, and frames of the base stay",
          "[dynamics][frames]") {
  const Model model = model_with_frames(7, 6, 3, false);
  Workspace ws(model);
  Rng rng(8);
  const VectorXd q = test::random_joints(rng, 6, 2.0);
  forward_kinematics(model, ws, q);
  SE3 moved = model.base();
  for (int link = -1; link < 6; ++link) {
    if (link >= 0)
      moved = moved *
              SE3::exp(model.robot().links[static_cast<std::size_t>(link)].joint.screw * q[link]);
    for (const char* kind : {"own", "lumped"}) {
      const int frame = model.frame(kind + std::to_string(link));
      const SE3 expected = moved * pose_at_zero(model, frame), found = frame_pose(model, ws, frame);
      CHECK((found.R() - expected.R()).norm() <= 1e-13);
      CHECK((found.p() - expected.p()).norm() <= 1e-13);
    }
  }
  const SE3 tip = frame_pose(model, ws, Model::tip_frame);
  CHECK(tip.R() == tip_pose(model, ws).R());
  CHECK(tip.p() == tip_pose(model, ws).p());
}

TEST_CASE("frames are found by name, and what does not exist is named", "[dynamics][frames]") {
  const Model model = model_with_frames(9, 3, 0, false);
  Workspace ws(model);
  CHECK(model.frame("own1") == 5);
  CHECK(model.link(model.robot().links[2].name) == 2);
  CHECK(model.joint(model.robot().links[1].joint.name) == 1);
  CHECK(test::error_of([&] { (void)model.frame("owm1"); }).find("did you mean 'own1'") !=
        std::string::npos);
  CHECK(test::error_of([&] { (void)model.joint("elbow"); }).find("no joint 'elbow'") !=
        std::string::npos);
  CHECK(test::error_of([&] { (void)frame_pose(model, ws, 0); }).find("frame_pose") !=
        std::string::npos);  // no poses yet
  forward_kinematics(model, ws, VectorXd::Zero(3));
  for (const int wrong : {-1, 9})
    CHECK(test::error_of([&] { (void)frame_pose(model, ws, wrong); }).find("from 0 to 8") !=
          std::string::npos);
  Matrix6Xd J(6, 4);
  CHECK_THROWS_AS(frame_jacobian(model, ws, 0, Reference::local, J), Error);
}

TEST_CASE("functions of frames do not allocate", "[dynamics][frames]") {
  test::require_allocation_count();
  const Model model = model_with_frames(10, 7, 3, false);
  Workspace ws(model);
  const VectorXd q = VectorXd::LinSpaced(7, -1.0, 1.0), v = q, a = q;
  Matrix6Xd J(6, 7);
  CHECK(test::allocations_in([&] {
          forward_kinematics(model, ws, q);
          for (const auto reference :
               {Reference::world, Reference::local, Reference::local_world_aligned}) {
            frame_jacobian(model, ws, 12, reference, J);
            (void)frame_velocity(model, ws, 12, reference, v);
            (void)frame_acceleration(model, ws, 12, reference, v, a);
          }
        }) == 0);
}
