#include "hamelin/integration/step_derivatives.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/integration/integrator.hpp"
#include "hamelin/test/allocations.hpp"
#include "hamelin/test/errors.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::integration;
using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::Vector3d;

namespace {

struct StepCase {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar, forces;
};

// A model in motion, its last step, and the channels that act.
struct Stepped {
  Stepped(const StepCase& c, const std::string& scheme, double h) : model(make(c)) {
    Rng rng(c.seed + 40);
    const VectorXd q = test::random_joints(rng, c.n, 2.0), v = test::random_joints(rng, c.n, 2.0);
    if (c.forces) {
      channels.damping = test::random_joints(rng, c.n, 0.5).cwiseAbs();
      channels.coulomb = test::random_joints(rng, c.n, 0.3).cwiseAbs();
      channels.coulomb_speed = 0.5;
      channels.held_torque = test::random_joints(rng, c.n, 5.0);
      channels.gyroscopic = {{c.n - 1, {0.1, 0.2, -0.1}, {3.0, -1.0, 2.0}},
                             {c.n / 2, {-0.1, 0.0, 0.2}, {-1.0, 2.0, 1.0}}};
    }
    integrator = make_integrator(scheme, model);
    before = integrator->start(q, v);
    after = before;
    const StepReport report = integrator->step(after, channels, h);
    REQUIRE(report.converged);
    REQUIRE(report.halvings == 0);
  }
  static model::Model make(const StepCase& c) {
    model::Robot robot = test::random_robot(c.seed, c.n, c.prismatic_every, c.planar);
    for (std::size_t i = 0; i < robot.links.size(); i += 2) robot.links[i].joint.armature = 0.1;
    return model::Model(std::move(robot), geometry::SE3{}, Vector3d{1.0, -2.0, -9.0});
  }

  model::Model model;
  Channels channels;
  std::unique_ptr<Integrator> integrator;
  State before, after;
};

StepDerivatives derivatives(const Stepped& s, const std::string& scheme) {
  StepDerivatives out(s.model.dof());
  make_step_differentiator(s.model, make_options(scheme))->differentiate(s.after, s.channels, out);
  return out;
}

// Derivatives of the channels' force by nested dual numbers, and the force.
struct ReferenceForce {
  ReferenceForce(const model::Model& model, const Channels& c, const VectorXd& q, const VectorXd& v)
      : by_q(MatrixXd::Zero(q.size(), q.size())), by_v(by_q), force(VectorXd::Zero(q.size())) {
    if (c.none()) return;
    force = c.held_torque - c.damping.cwiseProduct(v);
    by_v.diagonal() = -c.damping;
    for (Index i = 0; i < q.size(); ++i) {
      const double x = v[i] / c.coulomb_speed;
      force[i] -= c.coulomb[i] * std::tanh(x);
      by_v(i, i) -= c.coulomb[i] / c.coulomb_speed / (std::cosh(x) * std::cosh(x));
    }
    for (const auto& term : c.gyroscopic) add(model, term, q, v);
  }
  void add(const model::Model& model, const dynamics::GyroscopicTerm& term, const VectorXd& q,
           const VectorXd& v) {
    const test::ReferenceDynamics<test::HyperDual> reference(model);
    MatrixXd J(3, q.size()), H[3];
    for (int k = 0; k < 3; ++k) {
      VectorXd row;
      test::hessian(
          [&](const auto& at) { return reference.point(at, term.link, term.point_link)[k]; }, q,
          row, H[k]);
      J.row(k) = row.transpose();
    }
    const auto turn = [&](const Vector3d& x) { return term.w_world.cross(x); };
    const Vector3d f = turn(J * v);
    force += J.transpose() * f;
    for (Index j = 0; j < q.size(); ++j) {
      by_v.col(j) += J.transpose() * turn(J.col(j));
      by_q.col(j) += J.transpose() *
                     turn(Vector3d(H[0].col(j).dot(v), H[1].col(j).dot(v), H[2].col(j).dot(v)));
      for (int k = 0; k < 3; ++k) by_q.col(j) += H[k].col(j) * f[k];
    }
  }
  MatrixXd by_q, by_v;
  VectorXd force;
};

// The derivatives of (q⁺, p⁺) from linear equations A (q⁺, p⁺) = B (q, p, u, h).
StepDerivatives solved(const MatrixXd& A, const MatrixXd& B, Index n) {
  const MatrixXd X = A.fullPivLu().solve(B).topRows(2 * n);
  StepDerivatives out(n);
  out.by_state = X.leftCols(2 * n);
  out.by_torque = X.middleCols(2 * n, n);
  out.by_step = X.col(3 * n);
  return out;
}

// Of the discrete Lagrangian L_d = h (K(mean of q and q⁺, Δ/h) − ½ U(q) − ½ U(q⁺)) with the force F
// at the midpoint: p = −∂L_d/∂q − (h/2) F, p⁺ = ∂L_d/∂q⁺ + (h/2) F.
StepDerivatives reference_variational(const Stepped& s, double h) {
  const Index n = s.model.dof();
  const test::ReferenceDynamics<test::HyperDual> energies(s.model);
  VectorXd x(2 * n + 1), gradient;
  x << s.before.q, s.after.q, h;
  MatrixXd D;
  test::hessian(
      [&](const auto& at) {
        using Vector = test::ReferenceDynamics<test::HyperDual>::VectorXc;
        const Vector q = at.head(n), q_next = at.segment(n, n);
        const test::HyperDual step = at[2 * n], rate = inverse(step), half(0.5);
        const Vector middle = (q + q_next) * half, v = (q_next - q) * rate;
        return step * (energies.kinetic_energy(middle, v) -
                       half * (energies.potential_energy(q) + energies.potential_energy(q_next)));
      },
      x, gradient, D);
  const VectorXd v = (s.after.q - s.before.q) / h;
  const ReferenceForce f(s.model, s.channels, 0.5 * (s.before.q + s.after.q), v);
  // of (h/2) F by q, q⁺, u, h
  const MatrixXd one = MatrixXd::Identity(n, n), f_q = h / 4 * f.by_q - 0.5 * f.by_v,
                 f_next = h / 4 * f.by_q + 0.5 * f.by_v, f_u = h / 2 * one;
  const VectorXd f_h = 0.5 * f.force - 0.5 * f.by_v * v;
  MatrixXd A = MatrixXd::Zero(2 * n, 2 * n), B = MatrixXd::Zero(2 * n, 3 * n + 1);
  A.topLeftCorner(n, n) = D.block(0, n, n, n) + f_next;
  A.bottomLeftCorner(n, n) = -D.block(n, n, n, n) - f_next;
  A.bottomRightCorner(n, n) = one;
  B.topRows(n) << -D.block(0, 0, n, n) - f_q, -one, -f_u, -D.block(0, 2 * n, n, 1) - f_h;
  B.bottomRows(n) << D.block(n, 0, n, n) + f_q, 0.0 * one, f_u, D.block(n, 2 * n, n, 1) + f_h;
  return solved(A, B, n);
}

// The stages of the two-stage Gauss method of order 4, with unknowns (q⁺, p⁺, Q, P, v, ṗ).
StepDerivatives reference_gauss4(const Stepped& s, double h) {
  const Index n = s.model.dof();
  const double r = std::sqrt(3.0) / 6.0, a[2][2] = {{0.25, 0.25 - r}, {0.25 + r, 0.25}};
  const test::ReferenceDynamics<test::HyperDual> energies(s.model);
  const MatrixXd one = MatrixXd::Identity(n, n);
  MatrixXd A = MatrixXd::Zero(10 * n, 10 * n), B = MatrixXd::Zero(10 * n, 3 * n + 1);
  const auto at = [n](Index block) { return block * n; };  // q⁺ p⁺ Q1 Q2 P1 P2 v1 v2 r1 r2
  // the step's memory begins with two numbers and the increments h K/2
  Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> dq(
      s.after.memory.data() + 2, n, 2),
      dp(s.after.memory.data() + 2 + 2 * n, n, 2);
  const MatrixXd v = 2.0 / h * dq, rate = 2.0 / h * dp;
  A.topLeftCorner(2 * n, 2 * n).setIdentity();
  B.topLeftCorner(2 * n, 2 * n).setIdentity();
  for (Index i = 0; i < 2; ++i) {
    A.block(0, at(6 + i), n, n) = A.block(n, at(8 + i), n, n) = -h / 2 * one;
    B.block(0, 3 * n, n, 1) += 0.5 * v.col(i);
    B.block(n, 3 * n, n, 1) += 0.5 * rate.col(i);
    // Q_i = q + h Σ a v, P_i = p + h Σ a ṗ
    const Index Q = at(2 + i), P = at(4 + i);
    A.block(Q, Q, n, n) = A.block(P, P, n, n) = one;
    B.block(Q, 0, n, n) = B.block(P, n, n, n) = one;
    VectorXd q = s.before.q;
    for (Index j = 0; j < 2; ++j) {
      A.block(Q, at(6 + j), n, n) = A.block(P, at(8 + j), n, n) = -h * a[i][j] * one;
      B.block(Q, 3 * n, n, 1) += a[i][j] * v.col(j);
      B.block(P, 3 * n, n, 1) += a[i][j] * rate.col(j);
      q += h * a[i][j] * v.col(j);
    }
    // P = ∂K/∂v, ṗ = ∂K/∂q − ∂U/∂q + F
    VectorXd x(2 * n), gradient;
    x << q, v.col(i);
    MatrixXd K, U;
    test::hessian([&](const auto& y) { return energies.kinetic_energy(y.head(n), y.tail(n)); }, x,
                  gradient, K);
    test::hessian([&](const auto& y) { return energies.potential_energy(y); }, q, gradient, U);
    const ReferenceForce f(s.model, s.channels, q, v.col(i));
    const Index row = at(6 + i), force_row = at(8 + i);
    A.block(row, P, n, n) = one;
    A.block(row, Q, n, n) = -K.bottomLeftCorner(n, n);
    A.block(row, at(6 + i), n, n) = -K.bottomRightCorner(n, n);
    A.block(force_row, at(8 + i), n, n) = one;
    A.block(force_row, Q, n, n) = -(K.topLeftCorner(n, n) - U + f.by_q);
    A.block(force_row, at(6 + i), n, n) = -(K.topRightCorner(n, n) + f.by_v);
    B.block(force_row, 2 * n, n, n) = one;
  }
  return solved(A, B, n);
}

void check_close(const MatrixXd& x, const MatrixXd& expected, double rounding = 0.0) {
  INFO("error " << (x - expected).norm() << ", size " << expected.norm());
  CHECK((x - expected).norm() <= 1e-12 * expected.norm() + rounding);
}

void check_close(const StepDerivatives& x, const StepDerivatives& expected) {
  const Index n = x.by_torque.cols();
  // terms of the size of M/h = (∂q⁺/∂p)⁻¹ cancel in ∂p⁺/∂q, entirely so without curvature
  const double rounding = 1e-15 * expected.by_state.topRightCorner(n, n).inverse().norm();
  for (const Index row : {Index{0}, n}) {
    CAPTURE(row);
    check_close(x.by_state.block(row, 0, n, n), expected.by_state.block(row, 0, n, n),
                row == n ? rounding : 0.0);
    check_close(x.by_state.block(row, n, n, n), expected.by_state.block(row, n, n, n));
    check_close(x.by_torque.middleRows(row, n), expected.by_torque.middleRows(row, n));
    check_close(x.by_step.segment(row, n), expected.by_step.segment(row, n));
  }
}

}  // namespace

TEST_CASE("derivatives of a step agree with nested dual numbers",
          "[integration][step_derivatives]") {
  const auto c = GENERATE(StepCase{1, 1, 0, false, false}, StepCase{2, 3, 0, false, false},
                          StepCase{3, 7, 0, false, true}, StepCase{4, 6, 2, false, false},
                          StepCase{5, 5, 1, false, true}, StepCase{6, 4, 0, true, false},
                          StepCase{7, 6, 3, true, true}, StepCase{8, 7, 0, false, false});
  CAPTURE(c.seed, c.n, c.prismatic_every, c.planar, c.forces);
  const double h = 0.01;
  const Stepped variational(c, "hamel-variational", h), gauss(c, "gauss:4", h);
  check_close(derivatives(variational, "hamel-variational"), reference_variational(variational, h));
  check_close(derivatives(gauss, "gauss:4"), reference_gauss4(gauss, h));
}

TEST_CASE("derivatives of a step agree with differences of steps, for all orders",
          "[integration][step_derivatives]") {
  const std::string scheme =
      GENERATE("hamel-variational", "gauss:6", "gauss:8", "gauss:12", "gauss:16");
  CAPTURE(scheme);
  const double h = 0.02, d = 1e-3;
  const Stepped s({3, 7, 3, false, true}, scheme, h);
  const StepDerivatives exact = derivatives(s, scheme);
  const Index n = s.model.dof();
  const auto stepped = [&](Index k, double change) {
    State state = s.before;
    Channels channels = s.channels;
    if (k < n) state.q[k] += change;
    if (k >= n && k < 2 * n) state.p[k - n] += change;
    if (k >= 2 * n && k < 3 * n) channels.held_torque[k - 2 * n] += change;
    REQUIRE(s.integrator->step(state, channels, k == 3 * n ? h + change * h : h).converged);
    VectorXd out(2 * n);
    out << state.q, state.p;
    return out;
  };
  MatrixXd all(2 * n, 3 * n + 1);
  all << exact.by_state, exact.by_torque, exact.by_step * h;
  for (Index k = 0; k <= 3 * n; ++k) {
    CAPTURE(k);
    // a difference of fourth order
    const VectorXd slope =
        (8.0 * (stepped(k, d) - stepped(k, -d)) - (stepped(k, 2 * d) - stepped(k, -2 * d))) /
        (12.0 * d);
    CHECK((slope - all.col(k)).norm() <= 1e-8 * (1.0 + all.col(k).norm()));
  }
}

TEST_CASE("the derivative of a step is symplectic to rounding", "[integration][step_derivatives]") {
  const std::string scheme = GENERATE("hamel-variational", "gauss:4", "gauss:8", "gauss:16");
  const double h = GENERATE(1e-3, 0.05);
  CAPTURE(scheme, h);
  const Stepped s({3, 7, 0, false, false}, scheme, h);
  const MatrixXd S = derivatives(s, scheme).by_state;
  const Index n = s.model.dof();
  MatrixXd J = MatrixXd::Zero(2 * n, 2 * n);
  J.topRightCorner(n, n).setIdentity();
  J.bottomLeftCorner(n, n) = -MatrixXd::Identity(n, n);
  // entries have units, so each is compared with the sizes of the products that cancel in it
  const MatrixXd error = S.transpose() * J * S - J,
                 size = S.cwiseAbs().transpose() * J.cwiseAbs() * S.cwiseAbs();
  CHECK((error.cwiseAbs().array() <= 1e-13 * size.array() + 1e-15).all());
}

TEST_CASE("step derivatives do not allocate, and refuse what does not fit",
          "[integration][step_derivatives]") {
  const std::string scheme = GENERATE("hamel-variational", "gauss:8");
  CAPTURE(scheme);
  const Stepped s({3, 7, 0, false, true}, scheme, 1e-3);
  const auto differentiator = make_step_differentiator(s.model, make_options(scheme));
  StepDerivatives out(7), small(6);
  const long allocated =
      test::allocations_in([&] { differentiator->differentiate(s.after, s.channels, out); });
  if (test::counts_allocations()) CHECK(allocated == 0);
  CHECK(out.step_s == 1e-3);
  const auto message = [&](const State& state, const Channels& channels, StepDerivatives& to) {
    return test::error_of([&] { differentiator->differentiate(state, channels, to); });
  };
  const char* const not_right_after = "expected a state right after a step";
  CHECK_THAT(message(s.before, s.channels, out), Catch::Contains(not_right_after));
  State changed = s.after;
  s.integrator->set_velocity(changed, VectorXd::Constant(7, 0.1));
  CHECK_THAT(message(changed, s.channels, out), Catch::Contains(not_right_after));
  changed = s.after;
  s.integrator->kick(changed, VectorXd::Constant(7, 0.1));
  CHECK_THAT(message(changed, s.channels, out), Catch::Contains(not_right_after));
  REQUIRE(s.integrator->step(changed, s.channels, 1e-3).converged);
  CHECK(message(changed, s.channels, out) == "no error");

  CHECK_THAT(message(s.after, s.channels, small), Catch::Contains("out.by_state: 12 x 12"));
  StepDerivatives short_torque(7), short_step(7);
  short_torque.by_torque.resize(1, 1);
  short_step.by_step.resize(1);
  CHECK_THAT(message(s.after, s.channels, short_torque),
             Catch::Contains("out.by_torque: 1 x 1 numbers given, expected 14 x 7"));
  CHECK_THAT(message(s.after, s.channels, short_step),
             Catch::Contains("out.by_step: 1 x 1 numbers given, expected 14 x 1"));
  Channels wrong = s.channels;
  wrong.damping.resize(3);
  CHECK_THAT(message(s.after, wrong, out), Catch::Contains("channels.damping"));
  State no_momenta = s.after;
  no_momenta.p.resize(0);
  CHECK_THAT(message(no_momenta, s.channels, out), Catch::Contains("0 momenta"));
  CHECK_THAT(test::error_of([&] { (void)make_step_differentiator(s.model, make_options("rk4")); }),
             Catch::Contains("rk4"));
}
