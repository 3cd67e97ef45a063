#include <Eigen/Dense>
#include <catch2/catch.hpp>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "hamelin/test/robots.hpp"
#include "kernel/variational.hpp"

using namespace hamelin;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

// The kernel's Newton correction against a finite-difference Jacobian of its own residual.
template <class Space, class Chain>
void check(const Chain& chain, int n, std::uint64_t seed, bool spins) {
  using Kernel = integration::kernel::Variational<Space>;
  Rng rng(seed);
  const double h = 0.01;
  const VectorXd q = test::random_joints(rng, n, 2.0), p = test::random_joints(rng, n),
                 damping = test::random_joints(rng, n).cwiseAbs(),
                 coulomb = test::random_joints(rng, n).cwiseAbs();
  const VectorXd start = test::random_joints(rng, n, 0.05);
  VectorXd delta = start, next(n);
  std::vector<dynamics::kernel::Spin> terms;
  if (spins)
    for (int i = 0; i < n; i += 2)
      terms.push_back({static_cast<std::size_t>(i),
                       {rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2)},
                       {rng.uniform(-20, 20), rng.uniform(-20, 20), rng.uniform(-20, 20)}});
  const integration::kernel::Forces forces{damping.data(), coulomb.data(), nullptr, 0.5,
                                           terms.data(),   terms.size()};
  const integration::kernel::VariationalCall<Chain> call{
      chain, h, q.data(), p.data(), delta.data(), next.data(), forces, 1e-12, false};
  dynamics::AlignedBuffer memory(Kernel::bytes(static_cast<std::size_t>(n)));
  const auto residual = [&](const VectorXd& at) -> VectorXd {
    delta = at;
    Kernel kernel(call, memory.get());
    kernel.evaluate();
    return Eigen::Map<const VectorXd>(kernel.residual(), n);
  };
  MatrixXd jacobian(n, n);
  const double e = 1e-6;
  for (int j = 0; j < n; ++j) {
    VectorXd up = start, down = start;
    up[j] += e;
    down[j] -= e;
    jacobian.col(j) = (residual(up) - residual(down)) / (2.0 * e);
  }
  const VectorXd expected = jacobian.fullPivLu().solve(-residual(start));
  delta = start;
  Kernel kernel(call, memory.get());
  REQUIRE(kernel.evaluate_and_factor());
  (void)kernel.correct();
  const VectorXd correction = delta - start;
  // the linearisation omits the turning of the links relative to w, docs/theory.md (4.19), of order
  // h
  CHECK((correction - expected).norm() < (spins ? 3e-2 : 1e-7) * expected.norm());
}

}  // namespace

TEST_CASE("the O(n) Newton step agrees with a finite-difference Jacobian",
          "[integration][newton]") {
  struct Case {
    std::uint64_t seed;
    int n, prismatic_every;
    bool planar;
  };
  const auto c = GENERATE(Case{1, 1, 0, false}, Case{2, 3, 0, false}, Case{3, 7, 0, false},
                          Case{4, 7, 2, false}, Case{5, 6, 0, true}, Case{6, 6, 3, true});
  const bool spins = GENERATE(false, true);
  CAPTURE(c.seed, spins);
  const model::Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar));
  using namespace dynamics::kernel;
  if (model.planar()) {
    check<PlanarMixed<double>>(std::get<1>(model.chain()), c.n, c.seed, spins);
    if (!model.has_prismatic_or_rotor())
      check<PlanarPlain<double>>(std::get<1>(model.chain()), c.n, c.seed, spins);
  } else {
    check<SpatialMixed<double>>(std::get<0>(model.chain()), c.n, c.seed, spins);
    if (!model.has_prismatic_or_rotor())
      check<SpatialPlain<double>>(std::get<0>(model.chain()), c.n, c.seed, spins);
  }
}
