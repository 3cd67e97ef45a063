#include <fmt/format.h>

#include <catch2/catch.hpp>
#include <cmath>
#include <ctime>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/model/make_chain.hpp"

using namespace hamelin;
using namespace hamelin::integration;

namespace {

double cpu_us() {
  std::timespec t{};
  ::clock_gettime(CLOCK_THREAD_CPUTIME_ID, &t);
  return 1e6 * static_cast<double>(t.tv_sec) + 1e-3 * static_cast<double>(t.tv_nsec);
}

struct Row {
  std::string name;
  int order = 0;
  bool riqn = false;
};

}  // namespace

TEST_CASE("what a step of each scheme costs", "[!benchmark][integration]") {
  // 100 steps of 1 ms from rest, the minimum of many repetitions; spatial chains with links of 0.2
  // m.
  fmt::print("{:<22}{:>6}{:>10}{:>10}{:>14}{:>16}\n", "scheme", "links", "us/step", "in ABA",
             "evaluations", "factorisations");
  for (const int n : {3, 7, 20, 100}) {
    model::ChainOptions spec;
    spec.links = n;
    const Model model(model::make_chain(spec));
    dynamics::Workspace ws(model);
    VectorXd q0(n), a(n);
    for (int i = 0; i < n; ++i) q0[i] = 0.3 * std::sin(1.0 + i);
    const VectorXd rest = VectorXd::Zero(n);
    double aba = 1e9;
    for (int r = 0; r < 50; ++r) {
      const double start_us = cpu_us();
      for (int k = 0; k < 200; ++k) dynamics::forward_dynamics(model, ws, q0, rest, rest, a);
      aba = std::min(aba, (cpu_us() - start_us) / 200.0);
    }
    std::vector<Row> rows;
    for (const auto& name : integrator_names()) {
      if (name == "rosenbrock" && n > 20) continue;  // dense
      const auto* scheme = find_scheme(name);
      if (scheme->orders.empty()) rows.push_back({name, 0, false});
      for (const int order : scheme->orders) rows.push_back({name, order, false});
      if (name == "lie-exact") rows.push_back({name, 0, true});
    }
    for (const auto& row : rows) {
      Parameters options;
      if (row.order > 0) options.order = row.order;
      if (row.riqn) options.solver = Solver::riqn;
      const auto integrator = make_integrator(row.name, model, options);
      const State start = integrator->start(q0, rest);
      State state = start;
      constexpr int steps = 100;
      double best = 1e9;
      long evaluations = 0, factorizations = 0;
      for (int r = 0; r < (n > 20 ? 5 : 20); ++r) {
        state = start;
        evaluations = factorizations = 0;
        const double start_us = cpu_us();
        for (int k = 0; k < steps; ++k) {
          const auto report = integrator->step(state, {}, 1e-3);
          evaluations += report.evaluations;
          factorizations += report.factorizations;
        }
        best = std::min(best, (cpu_us() - start_us) / steps);
      }
      const auto label = row.order > 0 ? fmt::format("{} {}", row.name, row.order)
                                       : row.name + (row.riqn ? " riqn" : "");
      fmt::print("{:<22}{:>6}{:>10.2f}{:>10.1f}{:>14.2f}{:>16.2f}\n", label, n, best, best / aba,
                 static_cast<double>(evaluations) / steps,
                 static_cast<double>(factorizations) / steps);
    }
  }
}
