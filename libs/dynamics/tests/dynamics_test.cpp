#include "hamelin/dynamics/dynamics.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <numbers>

#include "hamelin/test/allocations.hpp"
#include "hamelin/test/dense.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::Matrix3d;
using Eigen::MatrixXd;
using Eigen::Vector3d;
using geometry::SE3;

namespace {

struct Case {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar;
};

SE3 a_base() {
  return SE3::exp((geometry::SE3::Tangent() << 0.3, -0.5, 0.8, 0.2, -0.1, 0.4).finished());
}

}  // namespace

TEST_CASE("recursive dynamics agree with dense Lagrangian mechanics", "[dynamics][property]") {
  const auto c = GENERATE(Case{1, 1, 0, false}, Case{2, 3, 0, false}, Case{3, 7, 0, false},
                          Case{4, 6, 2, false}, Case{5, 5, 1, false}, Case{6, 4, 0, true},
                          Case{7, 6, 3, true}, Case{8, 2, 2, true});
  CAPTURE(c.seed, c.n, c.prismatic_every, c.planar);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar), a_base(),
                    Vector3d{1.0, -2.0, -9.0});
  REQUIRE(model.planar() == (c.planar || c.n == 1));
  const test::Dense dense{model};
  Workspace ws(model);
  Rng rng(c.seed + 100);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0),
                 a = test::random_joints(rng, c.n, 3.0);
  VectorXd tau(c.n), x(c.n);
  MatrixXd M(c.n, c.n);

  mass_matrix(model, ws, q, M);
  const MatrixXd M_dense = dense.mass(q);
  CHECK((M - M_dense).norm() < 1e-12 * M_dense.norm());
  momentum(model, ws, q, v, x);
  CHECK((x - M_dense * v).norm() < 1e-12 * M_dense.norm());
  CHECK(kinetic_energy(model, ws, q, v) == Approx(0.5 * v.dot(M_dense * v)).epsilon(1e-12));
  CHECK(potential_energy(model, ws, q) == Approx(dense.potential(q)).epsilon(1e-12).margin(1e-12));

  inverse_dynamics(model, ws, q, v, a, tau);
  const VectorXd expected = M_dense * a + dense.bias(q, v);
  CHECK((tau - expected).norm() < 2e-8 * expected.norm());  // central differences in the reference
  forward_dynamics(model, ws, q, v, tau, x);
  CHECK((x - a).norm() < 1e-10 * a.norm());
  solve_mass(model, ws, q, a, x);
  CHECK((M_dense * x - a).norm() < 1e-10 * a.norm());
  bias_torque(model, ws, q, v, x);
  CHECK((tau - M_dense * a - x).norm() < 1e-11 * tau.norm());
  gravity_torque(model, ws, q, x);
  bias_torque(model, ws, q, VectorXd::Zero(c.n), tau);
  CHECK((tau - x).norm() < 1e-13 * (1.0 + tau.norm()));
}

TEST_CASE("kinematics agree with the product of exponentials, Jacobians with its differences",
          "[dynamics][property]") {
  const auto c = GENERATE(Case{11, 7, 0, false}, Case{12, 6, 2, false}, Case{13, 5, 3, true});
  CAPTURE(c.seed);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar), a_base());
  const test::Dense dense{model};
  Workspace ws(model);
  Rng rng(c.seed);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n);
  const int link = c.n - 2;
  const Vector3d point = test::random_vector(rng, 0.3), direction = test::random_vector(rng);
  forward_kinematics(model, ws, q);
  for (int i = 0; i < c.n; ++i) {
    CHECK((link_pose(model, ws, i).R() - dense.com_pose(i, q).R()).norm() < 1e-13);
    CHECK((link_pose(model, ws, i).p() - dense.com_pose(i, q).p()).norm() < 1e-13);
  }
  const Vector3d x = point_position(model, ws, link, point);
  CHECK((x - dense.com_pose(link, q) * point).norm() < 1e-13);
  std::vector<Vector3d> centers(model.shapes().size());
  shape_centers(model, ws, centers);
  for (int i = 0; i < c.n; ++i)
    CHECK((centers[static_cast<std::size_t>(i)] -
           dense.com_pose(i, q) *
               model.robot().links[static_cast<std::size_t>(i)].spheres[0].center_m)
              .norm() < 1e-13);

  Matrix3Xd J(3, c.n);
  Matrix6Xd J6(6, c.n);
  VectorXd row(c.n);
  point_jacobian(model, ws, link, x, J);
  frame_jacobian(model, ws, link, x, J6);
  point_jacobian_transpose(model, ws, link, x, direction, row);
  CHECK((J6.bottomRows<3>() - J).norm() == 0.0);
  CHECK((row - J.transpose() * direction).norm() < 1e-14);
  CHECK((point_velocity(model, ws, link, x, v) - J * v).norm() < 1e-14);
  const double e = 1e-6;
  for (int j = 0; j < c.n; ++j) {
    VectorXd qp = q, qm = q;
    qp[j] += e;
    qm[j] -= e;
    const SE3 gp = dense.com_pose(link, qp), gm = dense.com_pose(link, qm);
    CHECK(((gp * point - gm * point) / (2.0 * e) - J.col(j)).norm() < 1e-8);
    const Matrix3d spin = (gp.R() - gm.R()) / (2.0 * e) * dense.com_pose(link, q).R().transpose();
    CHECK((spin - geometry::hat(Vector3d(J6.col(j).head<3>()))).norm() < 1e-8);
  }
  CHECK((tip_pose(model, ws).p() -
         dense.com_pose(c.n - 1, q) *
             (model.robot().links.back().com.inverse() * model.robot().tip.pose.p()))
            .norm() < 1e-13);
}

TEST_CASE("gyroscopic terms are J^T (w x J v) and do no work", "[dynamics][property]") {
  const auto c = GENERATE(Case{21, 7, 0, false}, Case{22, 6, 2, false}, Case{23, 4, 0, true});
  CAPTURE(c.seed);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar), a_base());
  Workspace ws(model);
  Rng rng(c.seed);
  const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 3.0);
  std::vector<GyroscopicTerm> terms;
  for (int i = 0; i < c.n; ++i)
    terms.push_back({i, test::random_vector(rng), test::random_vector(rng, 10.0)});
  VectorXd tau(c.n), expected = VectorXd::Zero(c.n);
  gyroscopic_torque(model, ws, q, v, terms, tau);
  Matrix3Xd J(3, c.n);
  for (const auto& t : terms) {
    point_jacobian(model, ws, t.link, point_position(model, ws, t.link, t.point_link), J);
    expected += J.transpose() * t.w_world.cross(J * v);
  }
  CHECK((tau - expected).norm() < 1e-13 * (1.0 + expected.norm()));
  CHECK(std::abs(tau.dot(v)) < 1e-13 * tau.norm() * v.norm());
}

TEST_CASE("operational inertia inverts J M^-1 J^T, and is zero where J loses rank",
          "[dynamics][unit]") {
  const Model model(test::random_robot(31, 7));
  Workspace ws(model);
  Rng rng(31);
  const VectorXd q = test::random_joints(rng, 7, 2.0);
  forward_kinematics(model, ws, q);
  Matrix3Xd J(3, 7);
  point_jacobian(model, ws, 6, tip_pose(model, ws).p(), J);
  const Matrix3d inverse = J * test::Dense{model}.mass(q).ldlt().solve(J.transpose());
  const Matrix3d Mx = operational_inertia(model, ws, q, J, 1e-9);
  CHECK((Mx * inverse - Matrix3d::Identity()).norm() < 1e-9);

  const Model flat(test::random_robot(32, 3, 0, true));  // no motion along the plane's normal
  Workspace flat_ws(flat);
  const VectorXd zero = VectorXd::Zero(3);
  forward_kinematics(flat, flat_ws, zero);
  Matrix3Xd J_flat(3, 3);
  point_jacobian(flat, flat_ws, 2, tip_pose(flat, flat_ws).p(), J_flat);
  const Vector3d normal = flat.robot().links[0].joint.screw.head<3>();
  CHECK((operational_inertia(flat, flat_ws, zero, J_flat) * normal).norm() < 1e-9);
}

TEST_CASE("long chains keep ABA and RNEA inverse to each other", "[dynamics][hard]") {
  const int n = GENERATE(100, 200);
  for (const bool planar : {false, true}) {
    const Model model(test::random_robot(41, n, 0, planar));
    Workspace ws(model);
    Rng rng(41);
    const VectorXd q = test::random_joints(rng, n, 1.0), v = test::random_joints(rng, n, 1.0),
                   a = test::random_joints(rng, n, 1.0);
    VectorXd tau(n), back(n);
    inverse_dynamics(model, ws, q, v, a, tau);
    forward_dynamics(model, ws, q, v, tau, back);
    CAPTURE(n, planar);
    CHECK((back - a).lpNorm<Eigen::Infinity>() < 1e-6);
  }
}

TEST_CASE("a mass ratio of 10^6 leaves the solve accurate", "[dynamics][hard]") {
  auto robot = test::random_robot(51, 7);
  robot.links[6].mass_kg *= 1e6;
  robot.links[6].inertia_kg_m2 *= 1e6;
  const Model model(robot);
  Workspace ws(model);
  Rng rng(51);
  const VectorXd q = test::random_joints(rng, 7, 1.0), a = test::random_joints(rng, 7, 1.0);
  VectorXd p(7), back(7);
  momentum(model, ws, q, a, p);
  solve_mass(model, ws, q, p, back);
  CHECK((back - a).lpNorm<Eigen::Infinity>() < 1e-8);
}

TEST_CASE("nothing allocates after construction", "[dynamics][allocation]") {
  test::require_allocation_count();
  const bool planar = GENERATE(false, true);
  const Model model(test::random_robot(61, 7, 3, planar));
  Workspace ws(model);
  Rng rng(61);
  const VectorXd q = test::random_joints(rng, 7), v = test::random_joints(rng, 7);
  VectorXd x(7);
  MatrixXd M(7, 7);
  Matrix3Xd J(3, 7);
  Matrix6Xd J6(6, 7);
  const std::vector<GyroscopicTerm> terms{{3, Vector3d::Zero(), Vector3d::UnitX()}};
  double sum = 0.0;
  const long count = test::allocations_in([&] {
    inverse_dynamics(model, ws, q, v, v, x);
    forward_dynamics(model, ws, q, v, v, x);
    mass_matrix(model, ws, q, M);
    solve_mass(model, ws, q, v, x);
    sum += kinetic_energy(model, ws, q, v) + potential_energy(model, ws, q);
    forward_kinematics(model, ws, q);
    point_jacobian(model, ws, 6, Vector3d::Zero(), J);
    frame_jacobian(model, ws, 6, Vector3d::Zero(), J6);
    point_jacobian_transpose(model, ws, 6, Vector3d::Zero(), Vector3d::UnitX(), x);
    gyroscopic_torque(model, ws, q, v, terms, x);
    sum += operational_inertia(model, ws, q, J)(0, 0);
  });
  CHECK(std::isfinite(sum));
  CHECK(count == 0);
}
