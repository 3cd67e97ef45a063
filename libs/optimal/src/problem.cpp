#include "hamelin/optimal/problem.hpp"

#include <fmt/format.h>

#include <limits>

#include "hamelin/core/error.hpp"

namespace hamelin::optimal {

using Eigen::Index;

Limits Limits::of(const model::Model& model) {
  constexpr double none = std::numeric_limits<double>::infinity();
  const Index n = model.dof();
  Limits out;
  out.position_min = VectorXd::Constant(n, -none);
  out.position_max = out.velocity = out.torque = VectorXd::Constant(n, none);
  for (Index j = 0; j < n; ++j) {
    const model::Joint& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
    out.position_min[j] = joint.lower.value_or(-none);
    out.position_max[j] = joint.upper.value_or(none);
    out.velocity[j] = joint.velocity_max.value_or(none);
    out.torque[j] = joint.effort_max.value_or(none);
  }
  return out;
}

void check(const Problem& problem) {
  (void)problem;
}

}  // namespace hamelin::optimal
