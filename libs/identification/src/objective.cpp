#include "hamelin/identification/objective.hpp"

#include <Eigen/Cholesky>
#include <cmath>
#include <utility>

#include "hamelin/identification/pseudo_inertia.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

// The Newton direction on the coordinates that may move; the others stay.
VectorXd newton_direction(const VectorXd& gradient, MatrixXd hessian, const VectorXd& x,
                          Index first_bounded) {
  VectorXd right = -gradient;
  for (Index i = first_bounded; i < x.size(); ++i) {
    if (x[i] > 0.0 || gradient[i] <= 0.0) continue;
    hessian.row(i).setZero();
    hessian.col(i).setZero();
    hessian(i, i) = 1.0;
    right[i] = 0.0;
  }
  return hessian.ldlt().solve(right);
}

}  // namespace

double Objective::evaluate(const VectorXd& x, VectorXd* gradient, MatrixXd* hessian) const {
  if (gradient != nullptr) gradient->setZero(size());
  if (hessian != nullptr) hessian->setZero(size(), size());
  double value = 0.0;
  for (const Equations& joint : joints) {
    const VectorXd residual = joint.R * x - joint.y;
    value += 0.5 * joint.weight * residual.squaredNorm();
    if (gradient != nullptr) *gradient += joint.weight * (joint.R.transpose() * residual);
    if (hessian != nullptr) *hessian += joint.weight * (joint.R.transpose() * joint.R);
  }
  for (Index i = 0; i < links; ++i) {
    const Divergence part = divergence(x.segment<10>(10 * i));
    value += prior_weight * part.value;
    if (gradient != nullptr) gradient->segment<10>(10 * i) += prior_weight * part.gradient;
    if (hessian != nullptr) hessian->block<10, 10>(10 * i, 10 * i) += prior_weight * part.hessian;
  }
  const Index bounded = friction_prior.size();
  const VectorXd away = x.tail(bounded) - friction_prior;
  value += 0.5 * friction_weight * away.squaredNorm();
  if (gradient != nullptr) gradient->tail(bounded) += friction_weight * away;
  if (hessian != nullptr) hessian->diagonal().tail(bounded).array() += friction_weight;
  return value;
}

VectorXd minimum(const Objective& objective, VectorXd x) {
  constexpr int iterations_max = 100, halvings_max = 60;
  constexpr double sufficient = 1e-4, decrement_min = 1e-13;
  const Index first_bounded = 10 * objective.links, bounded = objective.friction_prior.size();
  VectorXd gradient, trial;
  MatrixXd hessian;
  for (int iteration = 0; iteration < iterations_max; ++iteration) {
    const double value = objective.evaluate(x, &gradient, &hessian);
    const VectorXd direction = newton_direction(gradient, hessian, x, first_bounded);
    double length = 1.0;
    bool moved = false;
    for (int halving = 0; halving < halvings_max && !moved; ++halving, length *= 0.5) {
      trial = x + length * direction;
      trial.tail(bounded) = trial.tail(bounded).cwiseMax(0.0);
      const double expected = gradient.dot(x - trial);
      if (expected <= decrement_min * (1.0 + std::abs(value))) return x;
      moved = objective.evaluate(trial, nullptr, nullptr) <= value - sufficient * expected;
    }
    if (!moved) return x;  // rounding is larger than any decrease
    x.swap(trial);
  }
  return x;
}

}  // namespace hamelin::identification
