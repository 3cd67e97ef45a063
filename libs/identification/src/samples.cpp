#include "hamelin/identification/samples.hpp"

#include <fmt/format.h>

#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/dynamics/regressor.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

void check_states(const char* name, const MatrixXd& states, Index rows, Index columns) {
  if (states.rows() != rows || states.cols() != columns || !states.allFinite())
    throw Error(
        ErrorCode::usage,
        fmt::format("exact_samples: {}: {} × {} numbers given, expected {} × {} finite ones", name,
                    states.rows(), states.cols(), rows, columns));
}

}  // namespace

Samples exact_samples(const model::Model& model, const MatrixXd& q, const MatrixXd& v,
                      const MatrixXd& a, const MatrixXd& tau, double friction_speed) {
  const Index dof = model.dof(), count = q.cols(), inertial = 10 * dof;
  check_states("q", q, dof, count);
  check_states("v", v, dof, count);
  check_states("a", a, dof, count);
  check_states("tau", tau, dof, count);
  if (!(friction_speed > 0.0) || !std::isfinite(friction_speed))
    throw Error(ErrorCode::usage, fmt::format("exact_samples: friction_speed: {}, expected a "
                                              "positive number",
                                              friction_speed));
  Samples out;
  out.joints.assign(static_cast<std::size_t>(dof),
                    {MatrixXd(count, inertial + 2), VectorXd(count)});
  out.q_noise = VectorXd::Zero(dof);
  dynamics::Workspace ws(model);
  MatrixXd Y(dof, inertial);
  for (Index k = 0; k < count; ++k) {
    dynamics::inverse_dynamics_regressor(model, ws, q.col(k), v.col(k), a.col(k), Y);
    out.time_s.push_back(static_cast<double>(k));
    for (Index j = 0; j < dof; ++j) {
      const auto at = static_cast<std::size_t>(j);
      out.joints[at].A.row(k) << Y.row(j), v(j, k), std::tanh(v(j, k) / friction_speed);
      out.joints[at].b[k] = tau(j, k) - model.robot().links[at].joint.armature * a(j, k);
    }
  }
  return out;
}

Samples between(const Samples& samples, double from_s, double to_s) {
  std::vector<Index> kept;
  Samples out = samples;
  out.time_s.clear();
  for (std::size_t k = 0; k < samples.time_s.size(); ++k) {
    if (samples.time_s[k] < from_s || samples.time_s[k] >= to_s) continue;
    kept.push_back(static_cast<Index>(k));
    out.time_s.push_back(samples.time_s[k]);
  }
  for (std::size_t j = 0; j < samples.joints.size(); ++j) {
    out.joints[j].A = samples.joints[j].A(kept, Eigen::all);
    out.joints[j].b = samples.joints[j].b(kept);
  }
  return out;
}

}  // namespace hamelin::identification
