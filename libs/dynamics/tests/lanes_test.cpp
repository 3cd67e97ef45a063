#include "hamelin/dynamics/kernel/lanes.hpp"

#include <catch2/catch.hpp>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/test/dense.hpp"
#include "hamelin/test/robots.hpp"

using namespace hamelin;
using namespace hamelin::dynamics;
using Eigen::MatrixXd;

namespace {

// The instruction sets of this machine.
std::vector<Isa> sets_here() {
  std::vector<Isa> sets;
  for (const Isa isa : {Isa::baseline, Isa::v3, Isa::v4})
    if (is_available(isa)) sets.push_back(isa);
  return sets;
}

struct Errors {
  double absolute = 0.0, ulps = 0.0;  // units in the last place of the exact number
  void add(double found, long double exact) {
    const double nearest = std::abs(static_cast<double>(exact));
    const double ulp = std::nextafter(nearest, std::numeric_limits<double>::infinity()) - nearest;
    const auto error = static_cast<double>(std::abs(found - exact));
    absolute = std::max(absolute, error);
    ulps = std::max(ulps, error / ulp);
  }
};

// The largest errors of sine and cosine over angles that next() makes.
template <class F>
Errors worst_errors(F&& next) {
  using Pack = kernel::Lanes<2>;
  Errors worst;
  for (int k = 0; k < 20000; ++k) {
    const double x[2] = {next(), next()};
    Pack s, c;
    kernel::sincos(Pack::load(x), s, c);
    for (int lane = 0; lane < 2; ++lane) {
      worst.add(s[lane], std::sin(static_cast<long double>(x[lane])));
      worst.add(c[lane], std::cos(static_cast<long double>(x[lane])));
    }
  }
  return worst;
}

}  // namespace

TEST_CASE(
    "sine and cosine in lanes are accurate to 1.5 ulp up to 100 rad and to 2.5 ulp at any angle",
    "[dynamics][lanes]") {
  static_assert(std::numeric_limits<long double>::digits > 60,
                "the reference needs more digits than a double has");
  Rng rng(1);
  for (const double size : {1e-300, 1e-8, 1e-3, 1.0, 4.0, 100.0, 9e5, 1e9}) {
    CAPTURE(size);
    const Errors worst = worst_errors([&] { return rng.uniform(-size, size); });
    CHECK(worst.ulps < (size > 100.0 ? 2.5 : 1.5));
    CHECK(worst.absolute < 0.75 * std::numeric_limits<double>::epsilon());
  }
  // Near multiples of a quarter turn sine or cosine nearly vanishes, and the range reduction has to
  // be exact.
  for (const double off : {0.0, 1e-12, 1e-6, 1e-3}) {
    CAPTURE(off);
    CHECK(worst_errors([&] {
            return std::floor(rng.uniform(-6e5, 6e5)) * 0.5 * M_PI + rng.uniform(-off, off);
          }).ulps < 1.5);
  }
}

TEST_CASE("NaN stays in its lane, and largest() returns it", "[dynamics][lanes]") {
  using Pack = kernel::Lanes<2>;
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (int bad = 0; bad < 2; ++bad) {
    double odd[2] = {0.5, 0.5};
    odd[bad] = nan;
    Pack s, c;
    kernel::sincos(Pack::load(odd), s, c);
    CHECK(std::isnan(s[bad]));
    CHECK(std::isnan(c[bad]));
    CHECK(s[1 - bad] == Approx(std::sin(0.5)).epsilon(1e-15));
    const Pack one(1.0);
    CHECK(std::isnan(max(Pack::load(odd), one)[bad]));
    CHECK(std::isnan(max(one, Pack::load(odd))[bad]));
    CHECK(max(one, Pack::load(odd))[1 - bad] == 1.0);
    CHECK(std::isnan(largest(Pack::load(odd))));
  }
  const double numbers[2] = {-2.0, 3.0};
  CHECK(largest(Pack::load(numbers)) == 3.0);
  CHECK(largest(abs(Pack::load(numbers))) == 3.0);
}

TEST_CASE("batches equal single calls for any number of states", "[dynamics][lanes]") {
  struct Case {
    std::uint64_t seed;
    int n, prismatic_every;
    bool planar;
  };
  const auto c = GENERATE(Case{1, 7, 0, false}, Case{2, 5, 2, false}, Case{3, 4, 0, true},
                          Case{4, 4, 3, true});
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
    forward_dynamics(model, ws, q.col(i).eval(), v.col(i).eval(), tau.col(i).eval(), single);
    CHECK((a.col(i) - single).norm() < 1e-11 * (1.0 + single.norm()));
  }
}

TEST_CASE("on every instruction set the sweeps agree with dense matrices", "[dynamics][isa]") {
  const bool planar = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  const int n = 9;
  auto robot = test::random_robot(31, n, prismatic_every, planar);
  if (prismatic_every > 0) robot.links[4].joint.armature = 0.3;
  const Model model(robot);
  Rng rng(31);
  const VectorXd q = test::random_joints(rng, n, 3.0), v = test::random_joints(rng, n),
                 y = test::random_joints(rng, n);
  const test::Dense dense{model};
  const MatrixXd M_dense = dense.mass(q);
  // By central differences.
  const VectorXd gravity = dense.bias(q, VectorXd::Zero(n)), bias = dense.bias(q, v);
  const auto sets = sets_here();
  REQUIRE_FALSE(sets.empty());
  for (const auto& set : sets) {
    CAPTURE(name_of(set), planar, prismatic_every);
    Workspace ws(model, set);
    VectorXd x(n);
    MatrixXd M(n, n);
    mass_matrix(model, ws, q, M);
    CHECK((M - M_dense).norm() < 1e-12 * M_dense.norm());
    momentum(model, ws, q, v, x);
    CHECK((x - M_dense * v).norm() < 1e-12 * (M_dense * v).norm());
    solve_mass(model, ws, q, y, x);
    CHECK((M_dense * x - y).norm() < 1e-10 * y.norm());
    gravity_torque(model, ws, q, x);
    CHECK((x - gravity).norm() < 1e-8 * gravity.norm());
    CHECK(kinetic_energy(model, ws, q, v) == Approx(0.5 * v.dot(M_dense * v)).epsilon(1e-12));
    inverse_dynamics(model, ws, q, v, y, x);
    CHECK((x - M_dense * y - bias).norm() < 1e-7 * x.norm());
    forward_dynamics(model, ws, q, v, y, x);
    CHECK((M_dense * x + bias - y).norm() < 1e-7 * bias.norm());
  }
}

TEST_CASE("all instruction sets agree up to rounding", "[dynamics][isa]") {
  const bool planar = GENERATE(false, true);
  const int prismatic_every = GENERATE(0, 3);
  const int n = 9;
  const Model model(test::random_robot(31, n, prismatic_every, planar));
  Rng rng(31);
  const VectorXd q = test::random_joints(rng, n, 3.0), v = test::random_joints(rng, n),
                 y = test::random_joints(rng, n);
  std::vector<VectorXd> first;
  for (const auto& set : sets_here()) {
    CAPTURE(name_of(set));
    Workspace ws(model, set);
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
    for (std::size_t i = 0; i < all.size(); ++i)
      CHECK((all[i] - first[i]).norm() < 1e-11 * (1.0 + first[i].norm()));
  }
}
