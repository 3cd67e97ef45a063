#pragma once
#include "hamelin/integration/integrator.hpp"

/// Helpers for the tests of integrators.
namespace hamelin::test {

/// Parameters with the order of a scheme (composition, gauss); 0 selects the scheme's default.
inline integration::Parameters of_order(int order) {
  integration::Parameters parameters;
  if (order > 0) parameters.order = order;
  return parameters;
}

/// Parameters that enable step control.
inline integration::Parameters tolerances(double rtol, double atol) {
  integration::Parameters parameters;
  parameters.rtol = rtol;
  parameters.atol = atol;
  return parameters;
}

/// The names of the schemes with step control.
inline std::vector<std::string> controlled_names() {
  std::vector<std::string> names;
  for (const auto& name : integration::integrator_names())
    if (integration::find_scheme(name)->step_control) names.push_back(name);
  return names;
}

inline Eigen::VectorXd velocity(const integration::Integrator& integrator,
                                const integration::State& state) {
  Eigen::VectorXd v(state.q.size());
  integrator.velocity(state, v);
  return v;
}

/// Whether all fields of two states are the same numbers.
inline bool same_state(const integration::State& a, const integration::State& b) {
  const auto same = [](const Eigen::VectorXd& x, const Eigen::VectorXd& y) {
    return x.size() == y.size() && x == y;
  };
  return a.time_s == b.time_s && a.k == b.k && same(a.q, b.q) && same(a.v, b.v) && same(a.p, b.p) &&
         a.jumped == b.jumped && same(a.memory, b.memory) &&
         same(a.force_previous, b.force_previous) && a.step_previous == b.step_previous &&
         a.history == b.history && a.step_next == b.step_next;
}

}  // namespace hamelin::test
