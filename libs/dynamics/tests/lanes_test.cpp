#include "hamelin/dynamics/kernel/lanes.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;

namespace {

// Those of this machine; HAMELIN_ISA is as before afterwards.
std::vector<std::string> sets_here() {
  const std::string now(instruction_set());
  std::vector<std::string> sets;
  for (const char* name : {"x86-64", "v3", "v4"}) {
    try {
      force_instruction_set(name);
      sets.emplace_back(name);
    } catch (const Error&) {
      continue;
    }
  }
  force_instruction_set(now);
  return sets;
}

}  // namespace

TEST_CASE("sine and cosine in lanes are right to an ulp and a half, at any size of angle", "[dynamics][lanes]") {
  using Pack = kernel::Lanes<2>;
  Rng rng(1);
  const double ulp = std::numeric_limits<double>::epsilon();
  for (const double size : {1e-8, 1e-3, 1.0, 4.0, 100.0, 9e5, 1e9}) {
    double worst = 0.0;
    for (int k = 0; k < 20000; ++k) {
      const double x[2] = {rng.uniform(-size, size), rng.uniform(-size, size)};
      Pack s, c;
      kernel::sincos(Pack::load(x), s, c);
      for (int lane = 0; lane < 2; ++lane) {
        const auto exact = static_cast<long double>(x[lane]);
        worst = std::max({worst, static_cast<double>(std::abs(s[lane] - std::sin(exact))),
                          static_cast<double>(std::abs(c[lane] - std::cos(exact)))});
      }
    }
    CAPTURE(size);
    CHECK(worst < 0.75 * ulp);
  }
  const double odd[2] = {std::numeric_limits<double>::quiet_NaN(), 0.5};
  Pack s, c;
  kernel::sincos(Pack::load(odd), s, c);
  CHECK(std::isnan(s[0]));
  CHECK(s[1] == Approx(std::sin(0.5)).epsilon(1e-15));
}

TEST_CASE("batches equal single calls, whatever the number of states", "[dynamics][lanes]") {
  struct Case {
    std::uint64_t seed;
    int n, prismatic_every;
    bool planar;
  };
  const auto c = GENERATE(Case{1, 7, 0, false}, Case{2, 5, 2, false}, Case{3, 4, 0, true}, Case{4, 4, 3, true});
  const int states = GENERATE(1, 3, 8, 21);
  CAPTURE(c.seed, states);
  const Model model(test::random_robot(c.seed, c.n, c.prismatic_every, c.planar));
  Rng rng(c.seed);
  StatesXd q(c.n, states), v(c.n, states), tau(c.n, states), a(c.n, states), back(c.n, states);
  for (auto* x : {&q, &v, &tau})
    for (int i = 0; i < states; ++i) x->col(i) = test::random_joints(rng, c.n, 3.0);
  BatchWorkspace batch(model);
  forward_dynamics(model, batch, q, v, tau, a);
  inverse_dynamics(model, batch, q, v, a, back);
  CHECK((back - tau).norm() < 1e-9 * tau.norm());
  Workspace ws(model);
  VectorXd single(c.n);
  for (int i = 0; i < states; ++i) {
    forward_dynamics(model, ws, q.col(i), v.col(i), tau.col(i), single);
    CHECK((a.col(i) - single).norm() < 1e-11 * (1.0 + single.norm()));
  }
}

TEST_CASE("all instruction sets agree but for rounding", "[dynamics][isa]") {
  const bool planar = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  const int n = 9;
  const Model model(test::random_robot(31, n, prismatic_every, planar));
  Rng rng(31);
  const VectorXd q = test::random_joints(rng, n, 3.0), v = test::random_joints(rng, n), y = test::random_joints(rng, n);
  const std::string now(instruction_set());
  std::vector<VectorXd> first;
  for (const auto& set : sets_here()) {
    force_instruction_set(set);
    CAPTURE(set);
    Workspace ws(model);
    std::vector<VectorXd> all(6, VectorXd(n));
    forward_dynamics(model, ws, q, v, y, all[0]);
    inverse_dynamics(model, ws, q, v, y, all[1]);
    solve_mass(model, ws, q, y, all[2]);
    momentum(model, ws, q, v, all[3]);
    gravity_torque(model, ws, q, all[4]);
    Eigen::MatrixXd M(n, n);
    mass_matrix(model, ws, q, M);
    all[5] = M * y;
    if (first.empty()) first = all;
    for (std::size_t i = 0; i < all.size(); ++i) CHECK((all[i] - first[i]).norm() < 1e-11 * (1.0 + first[i].norm()));
  }
  force_instruction_set(now);
}
