#include <catch2/catch.hpp>
#include <cmath>

#include "hamelin/test/integration.hpp"
#include "hamelin/test/robots.hpp"
#include "odeint_rosenbrock.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

// odeint's rosenbrock4 (the same method) for y = (q, v, work of the held torque), with the Jacobian
// by differences.
class Peer {
 public:
  Peer(const Model& model, const Channels& channels)
      : model_(model),
        ws_(model),
        channels_(channels),
        n_(model.dof()),
        size_(2 * n_ + 1),
        a_(n_),
        method_(
            static_cast<std::size_t>(size_),
            [this](const double* y, double* dy) { derivative(y, dy); },
            [this](const double* y, double* rows) { jacobian(y, rows); }) {}

  void step(const VectorXd& y, double h, VectorXd& next, VectorXd& error) {
    method_.step(y.data(), h, next.data(), error.data());
  }

 private:
  void derivative(const double* y, double* dy) {
    const VectorXd q = Eigen::Map<const VectorXd>(y, n_),
                   v = Eigen::Map<const VectorXd>(y + n_, n_);
    const VectorXd force = channels_.held_torque - channels_.damping.cwiseProduct(v);
    dynamics::forward_dynamics(model_, ws_, q, v, force, a_);
    Eigen::Map<VectorXd> out(dy, size_);
    out << v, a_, channels_.held_torque.dot(v);
  }
  void jacobian(const double* y, double* rows) {
    Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> J(
        rows, size_, size_);
    VectorXd at = Eigen::Map<const VectorXd>(y, size_), up(size_), down(size_);
    J.setZero();
    const auto difference = [&](Eigen::Index j, double e) -> VectorXd {
      at[j] = y[j] + e;
      derivative(at.data(), up.data());
      at[j] = y[j] - e;
      derivative(at.data(), down.data());
      at[j] = y[j];
      return (up - down) / (2.0 * e);
    };
    const double e = 2e-3;  // of q: fourth order
    for (Eigen::Index j = 0; j < n_; ++j)
      J.col(j) = (4.0 * difference(j, e) - difference(j, 2.0 * e)) / 3.0;
    // accelerations are quadratic in v, so differences by v are exact
    for (Eigen::Index j = n_; j < 2 * n_; ++j) J.col(j) = difference(j, 1.0);
  }

  const Model& model_;
  dynamics::Workspace ws_;
  const Channels& channels_;
  Eigen::Index n_, size_;
  VectorXd a_;
  reference::OdeintRosenbrock method_;
};

}  // namespace

TEST_CASE("a step of rosenbrock and its error estimate equal those of Boost.odeint's rosenbrock4",
          "[reference]") {
  const int n = 5;
  const double damping = GENERATE(0.1, 1e3, 1e6), h = GENERATE(1e-3, 0.05);
  const bool prismatic = GENERATE(false, true);
  CAPTURE(damping, h, prismatic);
  const Model model(test::random_robot(14, n, prismatic ? 2 : 0));
  Rng rng(14);
  Channels channels;
  channels.damping = VectorXd::Constant(n, damping);
  channels.held_torque = test::random_joints(rng, n, 2.0);
  const VectorXd q0 = test::random_joints(rng, n), v0 = test::random_joints(rng, n);

  const double tolerance = 1e9;  // every step is accepted
  const auto ours = make_integrator("rosenbrock", model, test::tolerances(0.0, tolerance));
  State state = ours->start(q0, v0);
  const auto report = ours->advance(state, channels, h);
  REQUIRE(report.converged);
  REQUIRE(report.step_s == h);

  VectorXd y(2 * n + 1), next(2 * n + 1), error(2 * n + 1);
  y << q0, v0, 0.0;
  Peer(model, channels).step(y, h, next, error);
  const double rounding = 1e-13;  // of q, if strong damping leaves it nearly constant
  CHECK((state.q - next.head(n)).norm() < 1e-9 * (next.head(n) - q0).norm() + rounding);
  CHECK((state.v - next.segment(n, n)).norm() < 1e-9 * (next.segment(n, n) - v0).norm() + rounding);
  CHECK(report.held_work_J == Approx(next[2 * n]).epsilon(1e-9).margin(rounding));
  CHECK(
      report.residual * tolerance ==
      Approx(std::sqrt(error.head(2 * n).squaredNorm() / (2 * n))).epsilon(1e-6).margin(rounding));
}
