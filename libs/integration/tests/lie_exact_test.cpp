#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/test/chains.hpp"
#include "hamelin/test/robots.hpp"
#include "reference/lie_exact_sweeps.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

struct Case {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar;
};

}  // namespace

TEST_CASE("one lie-exact step solves the discrete Euler-Lagrange equation of the logarithms",
          "[integration][lie-exact]") {
  // Independent of the recursion: the values of L_d, docs/theory.md (6.1), (6.2), from the world
  // poses of the frames at the centres of mass and the geometry library's logarithm; momenta by
  // central differences.
  const auto c = GENERATE(Case{1, 5, 0, false}, Case{2, 6, 2, false}, Case{3, 4, 3, true},
                          Case{4, 4, 0, true});
  CAPTURE(c.seed);
  auto robot = test::random_robot(c.seed, c.n, c.prismatic_every, c.planar);
  for (auto& link : robot.links) link.joint.armature = 0.02;
  const Model model(robot);
  dynamics::Workspace ws(model);
  Rng rng(c.seed);
  const VectorXd q0 = test::random_joints(rng, c.n), v0 = test::random_joints(rng, c.n);
  const double h = 0.05;
  const auto integrator = make_integrator("lie-exact", model);
  State state = integrator->start(q0, v0);
  const VectorXd p0 = state.p;
  REQUIRE(integrator->step(state, {}, h).converged);
  const auto poses = [&](const VectorXd& q) {
    dynamics::forward_kinematics(model, ws, q);
    std::vector<geometry::SE3> all;
    for (int i = 0; i < c.n; ++i) all.push_back(dynamics::link_pose(model, ws, i));
    return all;
  };
  const auto lagrangian = [&](const VectorXd& a, const VectorXd& b) {
    const auto from = poses(a), to = poses(b);
    double sum =
        -0.5 * h *
        (dynamics::potential_energy(model, ws, a) + dynamics::potential_energy(model, ws, b));
    for (std::size_t i = 0; i < from.size(); ++i) {
      const geometry::Vector6d xi = (from[i].inverse() * to[i]).log() / h;
      const auto& link = model.robot().links[i];
      const Eigen::Vector3d w = xi.head<3>(), v = xi.tail<3>();
      const double rate = (b - a)[static_cast<Eigen::Index>(i)] / h;
      sum += 0.5 * h *
             (w.dot(link.inertia_kg_m2 * w) + link.mass_kg * v.squaredNorm() + 0.02 * rate * rate);
    }
    return sum;
  };
  const double e = 1e-5;
  for (int i = 0; i < c.n; ++i) {
    VectorXd ap = q0, am = q0, bp = state.q, bm = state.q;
    ap[i] += e, am[i] -= e, bp[i] += e, bm[i] -= e;
    CHECK(-(lagrangian(ap, state.q) - lagrangian(am, state.q)) / (2 * e) ==
          Approx(p0[i]).margin(1e-6 * p0.norm()));
    CHECK((lagrangian(q0, bp) - lagrangian(q0, bm)) / (2 * e) ==
          Approx(state.p[i]).margin(1e-6 * p0.norm()));
  }
}

namespace {

// Compares the kernel's Newton correction for a residual with the Jacobian of p⁻(Δ) + ½ D Δ.
template <class Space, class Chain>
void check_newton(const Chain& chain, const Case& c) {
  kernel::LieScratch<Space> k(static_cast<std::size_t>(c.n));
  Rng rng(c.seed);
  const double h = 0.1;
  const VectorXd q = test::random_joints(rng, c.n, 2.0), delta = test::random_joints(rng, c.n, 0.5),
                 damping = test::random_joints(rng, c.n).cwiseAbs(),
                 residual = test::random_joints(rng, c.n);
  VectorXd minus(c.n), correction(c.n);
  const auto left = [&](const VectorXd& d) -> VectorXd {
    for (std::size_t i = 0; i < k.size(); ++i) {
      const auto j = static_cast<Eigen::Index>(i);
      k[i].before = Space::place(chain.links[i], q[j]);
      k[i].after = Space::place(chain.links[i], q[j] + d[j]);
    }
    REQUIRE(kernel::lie_left_momenta<Space>(chain, k, d.data(), h, minus.data()));
    return minus + 0.5 * damping.cwiseProduct(d);
  };
  Eigen::MatrixXd jacobian(c.n, c.n);
  const double e = 1e-6;
  for (int j = 0; j < c.n; ++j) {
    VectorXd up = delta, down = delta;
    up[j] += e;
    down[j] -= e;
    jacobian.col(j) = (left(up) - left(down)) / (2.0 * e);
  }
  (void)left(delta);
  REQUIRE(kernel::lie_factor<Space>(chain, k, h, damping.data()));
  kernel::lie_correct<Space>(chain, k, residual.data(), correction.data());
  const VectorXd expected = jacobian.fullPivLu().solve(-residual);
  CHECK((correction - expected).norm() < 1e-7 * expected.norm());
}

}  // namespace

TEST_CASE("the O(n) Newton step of lie-exact agrees with a finite-difference Jacobian",
          "[integration][lie-exact]") {
  const auto c = GENERATE(Case{1, 1, 0, false}, Case{2, 3, 0, false}, Case{3, 5, 0, false},
                          Case{4, 6, 2, false}, Case{5, 4, 0, true}, Case{6, 6, 3, true});
  CAPTURE(c.seed);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar));
  if (model.planar())
    check_newton<dynamics::kernel::Planar<double>>(std::get<1>(model.chain()), c);
  else
    check_newton<dynamics::kernel::Spatial<double>>(std::get<0>(model.chain()), c);
}

TEST_CASE("the logarithm of a dual quaternion is the geometry library's at every angle",
          "[integration][lie-exact]") {
  for (const double angle : {1e-9, 1e-4, 0.05, 0.199, 0.201, 1.0, 2.5}) {
    CAPTURE(angle);
    Rng rng(5);
    const Eigen::Vector3d axis = test::random_vector(rng).normalized(),
                          at = test::random_vector(rng);
    geometry::Vector6d x;
    x << angle * axis, angle * at.cross(axis) + 0.3 * axis;
    // a rotation about a line and a shift along it: the dual quaternion by hand
    const double half = 0.5 * angle, slide = 0.15;
    const Eigen::Vector3d u = std::sin(half) * axis;
    const Eigen::Vector3d du = std::sin(half) * at.cross(axis) + slide * std::cos(half) * axis;
    const kernel::Displacement d{
        std::cos(half), -slide * std::sin(half), {{u.x(), u.y(), u.z()}, {du.x(), du.y(), du.z()}}};
    kernel::Screw log{};
    REQUIRE(kernel::logarithm(d, log));
    const geometry::Vector6d expected = geometry::SE3::exp(x).log();
    geometry::Vector6d found;
    found << log.w.x, log.w.y, log.w.z, log.v.x, log.v.y, log.v.z;
    CHECK((found - expected).norm() < 1e-14 * (1.0 + 1e-2 / angle));
    CHECK((found - x).norm() < 1e-14);
  }
}

TEST_CASE(
    "RIQN and Newton find the same lie-exact motion, Newton in at most three factorisations per "
    "step",
    "[integration][lie-exact]") {
  const int n = GENERATE(3, 7, 20);
  CAPTURE(n);
  const Model model(test::spatial_chain(n));
  Parameters riqn;
  riqn.solver = Solver::riqn;
  const auto a = make_integrator("lie-exact", model), b = make_integrator("lie-exact", model, riqn);
  State x = a->start(VectorXd::Constant(n, 0.3), VectorXd::Zero(n)), y = x;
  y = b->start(VectorXd::Constant(n, 0.3), VectorXd::Zero(n));
  for (int k = 0; k < 200; ++k) {
    const auto newton = a->step(x, {}, 1e-3);
    REQUIRE(newton.converged);
    CHECK(newton.factorizations <= 3);
    REQUIRE(b->step(y, {}, 1e-3).converged);
  }
  CHECK((x.q - y.q).lpNorm<Eigen::Infinity>() < 1e-8);
}

TEST_CASE("an RIQN step at its iteration limit is not accepted", "[integration][lie-exact]") {
  const Model model(test::spatial_chain(20));
  Parameters options;
  options.solver = Solver::riqn;
  options.max_updates = 2;
  options.max_halvings = 0;
  const auto integrator = make_integrator("lie-exact", model, options);
  State state = integrator->start(VectorXd::Constant(20, 0.3), VectorXd::Constant(20, 1.0));
  const State before = state;
  REQUIRE_FALSE(integrator->step(state, {}, 5e-3).converged);
  CHECK(state.q == before.q);
  CHECK(state.p == before.p);
}
