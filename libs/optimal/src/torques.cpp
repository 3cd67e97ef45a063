#include "torques.hpp"

#include <fmt/format.h>

#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::optimal {

namespace {

VectorXd weights_of(const Problem& problem) {
  if (problem.effort_weights.size() > 0) return problem.effort_weights;
  const VectorXd& limit = problem.limits.torque;
  VectorXd out = VectorXd::Ones(problem.q_start.size());
  for (Index j = 0; j < limit.size(); ++j)
    if (std::isfinite(limit[j])) out[j] = 1.0 / (limit[j] * limit[j]);
  return out;
}

}  // namespace

Torques::Torques(const Problem& problem, const Layout& layout, Bounds& bounds)
    : layout_(layout),
      lagrangian_(*problem.model),
      effort_weights_(weights_of(problem)),
      torques_(MatrixXd::Zero(layout.n, layout.intervals + 1)),
      intervals_(static_cast<std::size_t>(layout.intervals),
                 DiscreteLagrangian::Derivatives(layout.n)),
      nodes_(static_cast<std::size_t>(layout.intervals),
             {MatrixXd::Zero(layout.n, 3 * layout.n), VectorXd::Zero(layout.n)}),
      direction_(layout.n) {
  dynamics::Workspace ws(*problem.model);
  VectorXd tau(layout.n);
  dynamics::bias_torque(*problem.model, ws, problem.q_start, problem.v_start, tau);
  torques_.col(0) = tau;
  dynamics::bias_torque(*problem.model, ws, problem.q_goal, problem.v_goal, tau);
  torques_.col(layout.intervals) = tau;
  end_effort_ = 0.5 * (torques_.col(0).cwiseAbs2().dot(effort_weights_) +
                       torques_.col(layout.intervals).cwiseAbs2().dot(effort_weights_));
  const VectorXd& limit = problem.limits.torque;
  for (Index k = 1; k < layout.intervals; ++k)
    for (Index j = 0; j < limit.size(); ++j) {
      if (!std::isfinite(limit[j])) continue;
      rows_.push_back({k, j, 1.0 / limit[j]});
      bounds.lower.push_back(-1.0);
      bounds.upper.push_back(1.0);
    }
}

// docs/theory.md (18.3), (18.4)
void Torques::evaluate(const Knots& knots, double* values) {
  knots_ = knots;
  const Index n = layout_.n, N = layout_.intervals;
  const double h = knots.h;
  for (Index k = 0; k < N; ++k)
    lagrangian_.evaluate(knots.q.col(k), knots.q.col(k + 1), h,
                         intervals_[static_cast<std::size_t>(k)]);
  effort_ = end_effort_;
  for (Index k = 1; k < N; ++k) {
    const auto &before = intervals_[static_cast<std::size_t>(k - 1)],
               &after = intervals_[static_cast<std::size_t>(k)];
    Node& node = nodes_[static_cast<std::size_t>(k)];
    auto tau = torques_.col(k);
    tau = -(before.b + after.a) / h;
    node.by_q.leftCols(n) = -before.ab.transpose() / h;
    node.by_q.middleCols(n, n) = -(before.bb + after.aa) / h;
    node.by_q.rightCols(n) = -after.ab / h;
    node.by_h = -(before.bh + after.ah + tau) / h;
    effort_ += tau.cwiseAbs2().dot(effort_weights_);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r)
    values[r] = rows_[r].scale * torques_(rows_[r].joint, rows_[r].knot);
}

void Torques::add_gradient(double factor, VectorXd& out) const {
  const Index n = layout_.n;
  const auto add = [&](Index v, double d) { out[v] += d; };
  for (Index k = 1; k < layout_.intervals; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    const VectorXd weighted = 2.0 * factor * torques_.col(k).cwiseProduct(effort_weights_),
                   slope = node.by_q.transpose() * weighted;
    for (Index a = -1; a <= 1; ++a)
      for (Index j = 0; j < n; ++j) layout_.chain(k + a, j, slope[(a + 1) * n + j], add);
    if (layout_.free_time) out[layout_.step_variable()] += layout_.h_ref * node.by_h.dot(weighted);
  }
}

void Torques::add_hessian(double factor, const double* y, const double* weights, bool curved,
                          HessianSum& out) {
  const Index n = layout_.n, N = layout_.intervals;
  // of each torque: what multiplies its second derivative, and the weight of its square
  MatrixXd slope = MatrixXd::Zero(n, N + 1), square = slope;
  for (Index k = 1; k < N; ++k) {
    square.col(k) = 2.0 * factor * effort_weights_;
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
  const Index n = layout_.n;
  const double h_ref = layout_.h_ref;
  MatrixXd weighted(n, 3 * n), product(3 * n, 3 * n);
  for (Index k = 1; k < layout_.intervals; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    weighted = weights.col(k).asDiagonal() * node.by_q;
    product.noalias() = node.by_q.transpose() * weighted;
    for (Index a = -1; a <= 1; ++a) {
      for (Index b = -1; b <= a; ++b)
        out.add(k + a, k + b, product.block((a + 1) * n, (b + 1) * n, n, n));
      if (layout_.free_time)
        out.add_mixed(k + a, h_ref * (weighted.middleCols((a + 1) * n, n).transpose() * node.by_h));
    }
    out.add_step(h_ref * h_ref * node.by_h.cwiseAbs2().dot(weights.col(k)));
  }
}

// Σ_k y_k·∇²τ_k, docs/theory.md (18.5)
void Torques::add_curvature(const MatrixXd& y, HessianSum& out) {
  const Index n = layout_.n, N = layout_.intervals;
  const double h = knots_.h, h_ref = layout_.h_ref;
  for (Index k = 0; k < N; ++k) {
    lagrangian_.differentiate(knots_.q.col(k), knots_.q.col(k + 1), h, y.col(k), y.col(k + 1),
                              direction_);
    const auto& d = direction_;
    out.add(k, k, -d.aa / h);
    out.add(k + 1, k + 1, -d.bb / h);
    out.add(k + 1, k, -d.ab.transpose() / h);
    if (!layout_.free_time) continue;
    out.add_mixed(k, -h_ref / h * d.ah);
    out.add_mixed(k + 1, -h_ref / h * d.bh);
    out.add_step(-h_ref * h_ref / h * d.hh);
  }
  if (!layout_.free_time) return;
  for (Index k = 1; k < N; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    for (Index a = -1; a <= 1; ++a)
      out.add_mixed(k + a,
                    -h_ref / h * (node.by_q.middleCols((a + 1) * n, n).transpose() * y.col(k)));
    out.add_step(-h_ref * h_ref * 2.0 / h * node.by_h.dot(y.col(k)));
  }
}

std::string Torques::describe(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return fmt::format("torque of joint {} at knot {}", row.joint + 1, row.knot);
}

}  // namespace hamelin::optimal
