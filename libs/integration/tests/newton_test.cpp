#include "../src/kernel/variational.hpp"

#include <Eigen/Dense>
#include <catch2/catch.hpp>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// Residual p⁻(Δ) + ½ D Δ of the left equation and, by the kernel, its Newton correction.
template <class Space, class Chain>
void check(const Chain& chain, int n, std::uint64_t seed) {
  integration::kernel::VariationalScratch<Space> k(static_cast<std::size_t>(n));
  Rng rng(seed);
  const double h = 0.01;
  const VectorXd q = test::random_joints(rng, n, 2.0), delta = test::random_joints(rng, n, 0.05),
                 damping = test::random_joints(rng, n).cwiseAbs(), residual = test::random_joints(rng, n);
  VectorXd minus(n), plus(n), mid(n), rate(n), correction(n);
  const auto left = [&](const VectorXd& d) -> VectorXd {
    mid = q + 0.5 * d;
    rate = d / h;
    integration::kernel::momenta(chain, k, mid.data(), rate.data(), h, minus.data(), plus.data());
    return minus + 0.5 * damping.cwiseProduct(d);
  };
  MatrixXd jacobian(n, n);
  const double e = 1e-6;
  for (int j = 0; j < n; ++j) {
    VectorXd up = delta, down = delta;
    up[j] += e;
    down[j] -= e;
    jacobian.col(j) = (left(up) - left(down)) / (2.0 * e);
  }
  (void)left(delta);
  REQUIRE(integration::kernel::factor(chain, k, h, damping.data()));
  integration::kernel::correct(chain, k, residual.data(), correction.data());
  const VectorXd expected = jacobian.fullPivLu().solve(-residual);
  CHECK((correction - expected).norm() < 1e-7 * expected.norm());
  // factors stay what they were when the point moves on
  (void)left(VectorXd::Zero(n));
  VectorXd kept(n);
  integration::kernel::correct(chain, k, residual.data(), kept.data());
  CHECK((kept - correction).norm() == 0.0);
}

}  // namespace

TEST_CASE("the O(n) Newton step agrees with a finite-difference Jacobian", "[integration][newton]") {
  struct Case {
    std::uint64_t seed;
    int n, prismatic_every;
    bool planar;
  };
  const auto c = GENERATE(Case{1, 1, 0, false}, Case{2, 3, 0, false}, Case{3, 7, 0, false}, Case{4, 7, 2, false},
                          Case{5, 6, 0, true}, Case{6, 6, 3, true});
  CAPTURE(c.seed);
  const model::Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar));
  if (model.planar())
    check<dynamics::kernel::Planar<double>>(std::get<1>(model.chain()), c.n, c.seed);
  else
    check<dynamics::kernel::Spatial<double>>(std::get<0>(model.chain()), c.n, c.seed);
}
