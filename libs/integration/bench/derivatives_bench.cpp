#include <fmt/format.h>

#include <Eigen/LU>

#include <catch2/catch.hpp>
#include <cmath>
#include <ctime>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/integration/step_derivatives.hpp"
#include "hamelin/model/make_chain.hpp"
#include "linear_system.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

// The least processor time of one call in microseconds.
template <class F>
double least_us(F&& f) {
  const auto now_us = [] {
    std::timespec t{};
    ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
    return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
  };
  constexpr int calls = 100;
  double least = 1e9;
  for (int r = 0; r < 50; ++r) {
    const double start = now_us();
    for (int k = 0; k < calls; ++k) f();
    least = std::min(least, (now_us() - start) / calls);
  }
  return least;
}

}  // namespace

TEST_CASE("what the derivatives of a step cost", "[!benchmark][integration]") {
  // A moving arm at 1 ms. Finite differences take 3n + 1 further steps by (q, p, u, h).
  fmt::print("{:<22}{:>6}{:>10}{:>16}{:>10}{:>20}\n", "scheme", "links", "step, us",
             "derivatives, us", "in steps", "differences, us");
  for (const int n : {2, 7, 20}) {
    const Model model(model::make_chain({.links = n}));
    VectorXd q(n), v(n);
    for (int i = 0; i < n; ++i) q[i] = 0.3 * std::sin(1.0 + i), v[i] = std::cos(2.0 * i);
    for (const char* scheme : {"hamel-variational", "gauss:4", "gauss:6", "gauss:8"}) {
      const auto integrator = make_integrator(scheme, model);
      const auto differentiator = make_step_differentiator(model, make_options(scheme));
      State state = integrator->start(q, v);
      for (int k = 0; k < 5; ++k) (void)integrator->step(state, {}, 1e-3);
      StepDerivatives out(n);
      State next = state;
      const double step = least_us([&] {
        next = state;
        (void)integrator->step(next, {}, 1e-3);
      });
      const double derivatives = least_us([&] { differentiator->differentiate(next, {}, out); });
      fmt::print("{:<22}{:>6}{:>10.2f}{:>16.2f}{:>10.1f}{:>20.1f}\n", scheme, n, step, derivatives,
                 derivatives / step, (3 * n + 1) * step);
    }
  }
}

TEST_CASE("small dense equations, ours and Eigen's", "[!benchmark][integration]") {
  // Of the sizes that derivatives of steps have: n joints times stages, 2n + 1 or 3n columns.
  fmt::print("{:>6}{:>10}{:>14}{:>14}{:>12}\n", "size", "columns", "baseline, us", "default, us",
             "Eigen, us");
  for (const auto& [n, columns] : {std::pair<int, int>{7, 15}, {14, 21}, {28, 21}, {56, 21}}) {
    const Eigen::MatrixXd S = Eigen::MatrixXd::Random(n, n) + n * Eigen::MatrixXd::Identity(n, n),
                          R = Eigen::MatrixXd::Random(n, columns);
    const auto ours = [&, n = n, columns = columns](Isa isa) {
      LinearSystem system(n, columns, isa);
      return least_us([&] {
        system.matrix() = S;
        system.right() = R;
        REQUIRE(system.solve());
      });
    };
    Eigen::PartialPivLU<Eigen::MatrixXd> factors(n);
    Eigen::MatrixXd X(n, columns);
    const double eigen = least_us([&] {
      factors.compute(S);
      X = factors.solve(R);
    });
    fmt::print("{:>6}{:>10}{:>14.2f}{:>14.2f}{:>12.2f}\n", n, columns, ours(Isa::baseline),
               ours(default_isa()), eigen);
  }
}
