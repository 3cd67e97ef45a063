#include "hamelin/reactive/inertia.hpp"

namespace hamelin::reactive {

Inertia::Inertia(Eigen::Index dof)
    : identity_(Eigen::MatrixXd::Identity(dof, dof)), M_(identity_), W_(identity_) {
  llt_.compute(identity_);  // allocates its memory
}

void Inertia::update(const model::Model& model, dynamics::Workspace& ws, const Eigen::VectorXd& q) {
  dynamics::mass_matrix(model, ws, q, M_);
  llt_.compute(M_);
  W_ = identity_;
  llt_.solveInPlace(W_);
}

}  // namespace hamelin::reactive
