#include "hamelin/dynamics/wrenches.hpp"

#include <catch2/catch.hpp>
#include <complex>
#include <vector>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Index;
using Eigen::MatrixXd;

namespace {

using test::FrameCase;
using test::model_with_frames;

std::vector<ExternalWrench> random_wrenches(const Model& model, Rng& rng) {
  std::vector<ExternalWrench> out;
  for (int frame = 0; frame < static_cast<int>(model.frames().size()); ++frame)
    for (const auto reference :
         {Reference::world, Reference::local, Reference::local_world_aligned})
      if (rng.uniform(0.0, 1.0) < 0.4)
        out.push_back({frame, reference, test::random_joints(rng, 6, 3.0)});
  return out;
}

// Σ Jᵀ F by products of exponentials.
template <class Number>
auto reference_torque(const Model& model, const std::vector<ExternalWrench>& wrenches,
                      const Eigen::Matrix<Number, Eigen::Dynamic, 1>& q) {
  const test::ReferenceDynamics<Number> reference(model);
  Eigen::Matrix<Number, Eigen::Dynamic, 1> tau =
      Eigen::Matrix<Number, Eigen::Dynamic, 1>::Constant(q.size(), Number(0.0));
  for (const auto& each : wrenches) {
    const int link = model.frames()[static_cast<std::size_t>(each.frame)].link;
    for (Index k = 0; k <= link; ++k) {
      const Eigen::Matrix<Number, Eigen::Dynamic, 1> rate =
          VectorXd::Unit(q.size(), k).template cast<Number>();
      const auto twist = test::twist_of<Number>(
          reference.motion(q, rate, link, test::pose_at_zero(model, each.frame)), each.reference);
      tau[k] += twist.cwiseProduct(each.wrench.template cast<Number>()).sum();
    }
  }
  return tau;
}

}  // namespace

TEST_CASE("torques of wrenches and their derivatives agree with products of exponentials",
          "[dynamics][wrenches]") {
  const auto c =
      GENERATE(FrameCase{1, 1, 0, false}, FrameCase{2, 7, 0, false}, FrameCase{3, 6, 2, false},
               FrameCase{4, 5, 1, false}, FrameCase{5, 4, 0, true}, FrameCase{6, 6, 3, true});
  CAPTURE(c.seed);
  const Model model = model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  Rng rng(c.seed + 300);
  const auto wrenches = random_wrenches(model, rng);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 2.0);
  DerivativesWorkspace ws(model);
  VectorXd tau(c.n);
  external_torque(model, ws.ws, q, wrenches, tau);
  const VectorXd expected = reference_torque<double>(model, wrenches, q);
  CHECK((tau - expected).norm() <= 1e-13 * (1.0 + expected.norm()));

  using C = std::complex<double>;
  MatrixXd slope(c.n, c.n), expected_slope(c.n, c.n);
  external_torque_derivative(model, ws.ws, q, wrenches, slope);
  for (Index k = 0; k < c.n; ++k) {
    Eigen::VectorXcd moved = q.cast<C>();
    moved[k] += C(0.0, 1e-30);
    expected_slope.col(k) = reference_torque<C>(model, wrenches, moved).imag() / 1e-30;
  }
  CHECK((slope - expected_slope).norm() <= 1e-12 * (1.0 + expected_slope.norm()));

  // Their power is that of the twists.
  double power = 0.0;
  forward_kinematics(model, ws.ws, q);
  for (const auto& each : wrenches)
    power += each.wrench.dot(frame_velocity(model, ws.ws, each.frame, each.reference, v));
  CHECK(std::abs(tau.dot(v) - power) <= 1e-12 * (1.0 + std::abs(power)));

  VectorXd needed(c.n), alone(c.n), accelerations(c.n);
  inverse_dynamics(model, ws.ws, q, v, a, wrenches, needed);
  inverse_dynamics(model, ws.ws, q, v, a, alone);
  CHECK((needed - (alone - expected)).norm() <= 1e-12 * (1.0 + alone.norm() + expected.norm()));
  forward_dynamics(model, ws.ws, q, v, needed, wrenches, accelerations);
  CHECK((accelerations - a).norm() <= 1e-9 * (1.0 + a.norm()));

  MatrixXd tq(c.n, c.n), tv(c.n, c.n), ta(c.n, c.n), uq(c.n, c.n);
  inverse_dynamics_derivatives(model, ws, q, v, a, wrenches, tq, tv, ta);
  inverse_dynamics_derivatives(model, ws, q, v, a, uq, tv, ta);
  CHECK((tq - (uq - expected_slope)).norm() <= 1e-12 * (1.0 + uq.norm() + expected_slope.norm()));
  MatrixXd aq(c.n, c.n), av(c.n, c.n), at(c.n, c.n);
  forward_dynamics_derivatives(model, ws, q, v, needed, wrenches, accelerations, aq, av, at);
  CHECK((aq + at * tq).norm() <= 1e-9 * (1.0 + (at * tq).norm()));  // implicit function theorem
}

TEST_CASE("wrenches on the base do nothing, and unknown frames are refused",
          "[dynamics][wrenches]") {
  const Model model = model_with_frames(3, 4, 0, false);
  Workspace ws(model);
  VectorXd tau(4), q = VectorXd::Constant(4, 0.4);
  const int base = model.frame("own-1");
  external_torque(model, ws, q,
                  std::vector<ExternalWrench>{{base, Reference::local, Vector6d::Ones()}}, tau);
  CHECK(tau.isZero(0.0));
  CHECK(
      test::error_of([&] {
        external_torque(model, ws, q, std::vector<ExternalWrench>{{99, Reference::local, {}}}, tau);
      }).find("external_torque: frame 99 given") != std::string::npos);
}

TEST_CASE("functions of wrenches do not allocate", "[dynamics][wrenches]") {
  test::require_allocation_count();
  const Model model = model_with_frames(3, 7, 3, false);
  DerivativesWorkspace ws(model);
  const VectorXd q = VectorXd::LinSpaced(7, -1.0, 1.0);
  VectorXd out(7);
  MatrixXd by_q(7, 7), by_v(7, 7), by_tau(7, 7);
  Rng rng(1);
  const auto wrenches = random_wrenches(model, rng);
  CHECK(test::allocations_in([&] {
          inverse_dynamics(model, ws.ws, q, q, q, wrenches, out);
          forward_dynamics(model, ws.ws, q, q, q, wrenches, out);
          forward_dynamics_derivatives(model, ws, q, q, q, wrenches, out, by_q, by_v, by_tau);
        }) == 0);
}
