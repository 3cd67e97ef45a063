#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::dynamics {

namespace {

std::variant<kernel::Scratch<kernel::Spatial<double>>, kernel::Scratch<kernel::Planar<double>>> scratch_for(
    const Model& model) {
  const auto n = static_cast<std::size_t>(model.dof());
  if (model.planar()) return kernel::Scratch<kernel::Planar<double>>(n);
  return kernel::Scratch<kernel::Spatial<double>>(n);
}

}  // namespace

Workspace::Workspace(const Model& model)
    : links(scratch_for(model)),
      frames(static_cast<std::size_t>(model.dof())),
      motions(static_cast<std::size_t>(model.dof())),
      forces(static_cast<std::size_t>(model.dof())),
      column_in(model.dof()),
      column_out(model.dof()) {}

void inverse_dynamics(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, const VectorXd& a,
                      VectorXd& tau) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::inverse_dynamics<Space>(chain, k, q.data(), v.data(), a.data(), tau.data());
  });
}

void forward_dynamics(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, const VectorXd& tau,
                      VectorXd& a) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::forward_dynamics<Space>(chain, k, q.data(), v.data(), tau.data(), a.data());
  });
}

void bias_torque(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, VectorXd& tau) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::inverse_dynamics<Space>(chain, k, q.data(), v.data(), nullptr, tau.data());
  });
}

void gravity_torque(const Model& model, Workspace& ws, const VectorXd& q, VectorXd& tau) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::inverse_dynamics<Space>(chain, k, q.data(), nullptr, nullptr, tau.data());
  });
}

void solve_mass(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& y, VectorXd& x) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::solve_mass<Space>(chain, k, q.data(), y.data(), x.data());
  });
}

void momentum(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v, VectorXd& p) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::momentum<Space>(chain, k, q.data(), v.data(), p.data());
  });
}

void mass_matrix(const Model& model, Workspace& ws, const VectorXd& q, Eigen::MatrixXd& M) {
  with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    kernel::mass_matrix<Space>(chain, k, q.data(), M.data(), static_cast<std::size_t>(M.outerStride()));
  });
}

double kinetic_energy(const Model& model, Workspace& ws, const VectorXd& q, const VectorXd& v) {
  return with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    return kernel::kinetic_energy<Space>(chain, k, q.data(), v.data());
  });
}

double potential_energy(const Model& model, Workspace& ws, const VectorXd& q) {
  return with_group(model, ws, [&]<class Space>(Space, const auto& chain, auto& k) {
    return kernel::potential_energy<Space>(chain, k, q.data()) + chain.potential_constant;
  });
}

}  // namespace hamelin::dynamics
