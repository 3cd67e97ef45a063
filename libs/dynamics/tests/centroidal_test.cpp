#include "hamelin/dynamics/centroidal.hpp"

#include <Eigen/Geometry>
#include <catch2/catch.hpp>
#include <complex>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/frames.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Vector3d;

namespace {

// The common centre of mass by products of exponentials.
template <class Number>
Eigen::Matrix<Number, 3, 1> reference_center(const Model& model,
                                             const Eigen::Matrix<Number, Eigen::Dynamic, 1>& q) {
  const test::ReferenceDynamics<Number> reference(model);
  Eigen::Matrix<Number, 3, 1> sum = Eigen::Matrix<Number, 3, 1>::Constant(Number(0.0));
  for (int i = 0; i < model.dof(); ++i) {
    const double mass = model.robot().links[static_cast<std::size_t>(i)].mass_kg;
    sum += reference.point(q, i, Vector3d::Zero()) * Number(mass / total_mass(model));
  }
  return sum;
}

// The angular momentum about a point: the sum of the links' own, by their spatial twists.
Vector3d reference_angular(const Model& model, const VectorXd& q, const VectorXd& v,
                           const Vector3d& about) {
  const test::ReferenceDynamics<double> reference(model);
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < model.dof(); ++i) {
    const model::Link& link = model.robot().links[static_cast<std::size_t>(i)];
    const auto motion = reference.motion(q, v, i, link.com);
    const Eigen::Matrix3d R = motion.Ad.topLeftCorner<3, 3>();
    const Vector3d at = reference.point(q, i, Vector3d::Zero()), omega = motion.spatial.head<3>(),
                   velocity = motion.spatial.tail<3>() + omega.cross(at);
    sum += R * link.inertia_kg_m2 * R.transpose() * omega +
           link.mass_kg * (at - about).cross(velocity);
  }
  return sum;
}

}  // namespace

TEST_CASE("the centre of mass and the centroidal momentum agree with products of exponentials",
          "[dynamics][centroidal]") {
  const auto c = GENERATE(test::FrameCase{1, 1, 0, false}, test::FrameCase{2, 7, 0, false},
                          test::FrameCase{3, 6, 2, false}, test::FrameCase{4, 5, 1, false},
                          test::FrameCase{5, 4, 0, true}, test::FrameCase{6, 6, 3, true});
  CAPTURE(c.seed);
  const Model model = test::model_with_frames(c.seed, c.n, c.prismatic_every, c.planar);
  Rng rng(c.seed + 20);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0);
  Workspace ws(model);
  forward_kinematics(model, ws, q);
  const Vector3d center = center_of_mass(model, ws);
  CHECK((center - reference_center<double>(model, q)).norm() <= 1e-13);
  const Vector6d momentum = centroidal_momentum(model, ws, v);
  const Eigen::VectorXcd moved =
      q.cast<std::complex<double>>() + v * std::complex<double>(0.0, 1e-30);
  const Vector3d linear =
      total_mass(model) * reference_center<std::complex<double>>(model, moved).imag() / 1e-30;
  CHECK((momentum.tail<3>() - linear).norm() <= 1e-12 * (1.0 + linear.norm()));
  const Vector3d angular = reference_angular(model, q, v, center);
  CHECK((momentum.head<3>() - angular).norm() <= 1e-12 * (1.0 + angular.norm()));
  Matrix6Xd A(6, c.n);
  centroidal_matrix(model, ws, A);
  CHECK((A * v - momentum).norm() <= 1e-12 * (1.0 + momentum.norm()));
  for (int j = 0; j < c.n; ++j)
    CHECK((A.col(j) - centroidal_momentum(model, ws, VectorXd::Unit(c.n, j))).norm() <= 1e-12);
}

TEST_CASE("centroidal functions do not allocate, and refuse what does not fit",
          "[dynamics][centroidal]") {
  const Model model = test::model_with_frames(2, 7, 3, false);
  Workspace ws(model);
  CHECK_THROWS_AS(center_of_mass(model, ws), Error);  // no poses yet
  const VectorXd q = VectorXd::Constant(7, 0.3);
  forward_kinematics(model, ws, q);
  CHECK_THROWS_AS(centroidal_momentum(model, ws, q.head(6).eval()), Error);
  Matrix6Xd A(6, 7);
  test::require_allocation_count();
  CHECK(test::allocations_in([&] {
          (void)centroidal_momentum(model, ws, q);
          centroidal_matrix(model, ws, A);
        }) == 0);
}
