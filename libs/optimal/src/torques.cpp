#include "torques.hpp"

#include <fmt/format.h>

#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::optimal {

namespace {

// Torques that hold the arm at the start and accelerate one joint there [Nm or N].
VectorXd usual_torques(const Problem& problem) {
  constexpr double acceleration = 10.0;
  const Index n = problem.model->dof();
  dynamics::Workspace ws(*problem.model);
  VectorXd hold(n);
  MatrixXd M(n, n);
  dynamics::gravity_torque(*problem.model, ws, problem.q_start, hold);
  dynamics::mass_matrix(*problem.model, ws, problem.q_start, M);
  return hold.cwiseAbs() + acceleration * M.diagonal();
}

VectorXd weights_of(const Problem& problem) {
  if (problem.effort_weights.size() > 0) return problem.effort_weights;
  VectorXd scale = problem.objective == Objective::time
                       ? usual_torques(problem)
                       : VectorXd(VectorXd::Ones(problem.q_start.size()));
  const VectorXd& limit = problem.limits.torque;
  for (Index j = 0; j < limit.size(); ++j)
    if (std::isfinite(limit[j])) scale[j] = limit[j];
  return scale.cwiseAbs2().cwiseInverse();
}

}  // namespace

Torques::Torques(const Problem& problem, const Layout& layout, Bounds& bounds)
    : layout_(layout),
      lagrangian_(*problem.model),
      effort_weights_(weights_of(problem)),
      torques_(MatrixXd::Zero(layout.joints(), layout.intervals() + 1)),
      intervals_(static_cast<std::size_t>(layout.intervals() + 2),
                 DiscreteLagrangian::Derivatives(layout.joints())),
      knots_(
          static_cast<std::size_t>(layout.intervals() + 1),
          {MatrixXd::Zero(layout.joints(), 3 * layout.joints()), VectorXd::Zero(layout.joints())}),
      direction_(layout.joints()) {
  const VectorXd& limit = problem.limits.torque;
  for (Index k = 0; k <= layout.intervals(); ++k)
    for (Index j = 0; j < limit.size(); ++j) {
      if (!std::isfinite(limit[j])) continue;
      rows_.push_back({k, j, 1.0 / limit[j]});
      const double share =
          problem.torque_reserve.size() > 0 ? 1.0 - problem.torque_reserve(j, k) / limit[j] : 1.0;
      bounds.lower.push_back(-share);
      bounds.upper.push_back(share);
    }
}

// docs/theory.md (18.4), (18.5). Knot k lies at the control point k + 1.
void Torques::evaluate(const Points& points, double* values) {
  points_ = points;
  const Index n = layout_.joints();
  const double h = points.h;
  for (Index i = 0; i + 1 < layout_.points(); ++i)
    lagrangian_.evaluate(points.q.col(i), points.q.col(i + 1), h,
                         intervals_[static_cast<std::size_t>(i)]);
  effort_ = 0.0;
  for (Index k = 0; k <= layout_.intervals(); ++k) {
    const auto &before = intervals_[static_cast<std::size_t>(k)],
               &after = intervals_[static_cast<std::size_t>(k + 1)];
    Knot& knot = knots_[static_cast<std::size_t>(k)];
    auto tau = torques_.col(k);
    tau = -(before.b + after.a) / h;
    knot.by_q.leftCols(n) = -before.ab.transpose() / h;
    knot.by_q.middleCols(n, n) = -(before.bb + after.aa) / h;
    knot.by_q.rightCols(n) = -after.ab / h;
    knot.by_h = -(before.bh + after.ah + tau) / h;
    effort_ += share(k) * tau.cwiseAbs2().dot(effort_weights_);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r)
    values[r] = rows_[r].scale * torques_(rows_[r].joint, rows_[r].knot);
}

void Torques::add_gradient(double factor, VectorXd& out) const {
  const Index n = layout_.joints();
  const auto add = [&](Index v, double d) { out[v] += d; };
  for (Index k = 0; k <= layout_.intervals(); ++k) {
    const Knot& knot = knots_[static_cast<std::size_t>(k)];
    const VectorXd weighted =
                       2.0 * factor * share(k) * torques_.col(k).cwiseProduct(effort_weights_),
                   slope = knot.by_q.transpose() * weighted;
    for (Index a = 0; a < 3; ++a)
      for (Index j = 0; j < n; ++j) layout_.chain(k + a, j, slope[a * n + j], add);
    if (layout_.free_time())
      out[layout_.step_variable()] += layout_.h_ref() * knot.by_h.dot(weighted);
  }
}

void Torques::add_hessian(double factor, const double* y, const double* weights, bool curved,
                          HessianSum& out) {
  const Index N = layout_.intervals();
  // of each torque: what multiplies its second derivative, and the weight of its square
  MatrixXd slope(layout_.joints(), N + 1), square(layout_.joints(), N + 1);
  for (Index k = 0; k <= N; ++k) {
    square.col(k) = 2.0 * factor * share(k) * effort_weights_;
    slope.col(k) = square.col(k).cwiseProduct(torques_.col(k));
  }
  for (std::size_t r = 0; r < rows_.size(); ++r) {
    const Row& row = rows_[r];
    slope(row.joint, row.knot) += row.scale * y[r];
    square(row.joint, row.knot) += row.scale * row.scale * weights[r];
  }
  add_products(square, out);
  if (curved) add_curvature(slope, out);
}

// Σ_k J_kᵀ diag(weights_k) J_k
void Torques::add_products(const MatrixXd& weights, HessianSum& out) {
  const Index n = layout_.joints();
  const double h_ref = layout_.h_ref();
  MatrixXd weighted(n, 3 * n), product(3 * n, 3 * n);
  for (Index k = 0; k <= layout_.intervals(); ++k) {
    const Knot& knot = knots_[static_cast<std::size_t>(k)];
    weighted = weights.col(k).asDiagonal() * knot.by_q;
    product.noalias() = knot.by_q.transpose() * weighted;
    for (Index a = 0; a < 3; ++a) {
      for (Index b = 0; b <= a; ++b) out.add(k + a, k + b, product.block(a * n, b * n, n, n));
      if (layout_.free_time())
        out.add_mixed(k + a, h_ref * (weighted.middleCols(a * n, n).transpose() * knot.by_h));
    }
    out.add_step(h_ref * h_ref * knot.by_h.cwiseAbs2().dot(weights.col(k)));
  }
}

// Σ_k y_k·∇²τ_k, docs/theory.md (18.6)
void Torques::add_curvature(const MatrixXd& y, HessianSum& out) {
  const Index n = layout_.joints(), N = layout_.intervals();
  const double h = points_.h, h_ref = layout_.h_ref();
  const VectorXd none = VectorXd::Zero(n);
  for (Index i = 0; i <= N + 1; ++i) {
    lagrangian_.differentiate(points_.q.col(i), points_.q.col(i + 1), h,
                              i > 0 ? VectorXd(y.col(i - 1)) : none,
                              i <= N ? VectorXd(y.col(i)) : none, direction_);
    const auto& d = direction_;
    out.add(i, i, -d.aa / h);
    out.add(i + 1, i + 1, -d.bb / h);
    out.add(i + 1, i, -d.ab.transpose() / h);
    if (!layout_.free_time()) continue;
    out.add_mixed(i, -h_ref / h * d.ah);
    out.add_mixed(i + 1, -h_ref / h * d.bh);
    out.add_step(-h_ref * h_ref / h * d.hh);
  }
  if (!layout_.free_time()) return;
  for (Index k = 0; k <= N; ++k) {
    const Knot& knot = knots_[static_cast<std::size_t>(k)];
    for (Index a = 0; a < 3; ++a)
      out.add_mixed(k + a, -h_ref / h * (knot.by_q.middleCols(a * n, n).transpose() * y.col(k)));
    out.add_step(-h_ref * h_ref * 2.0 / h * knot.by_h.dot(y.col(k)));
  }
}

std::string Torques::describe(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return fmt::format("torque of joint {} at knot {}", row.joint + 1, row.knot);
}

}  // namespace hamelin::optimal
