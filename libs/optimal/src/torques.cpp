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
    : problem_(problem),
      layout_(layout),
      lagrangian_(*problem.model),
      effort_weights_(weights_of(problem)),
      p_start_(VectorXd::Zero(layout.n)),
      p_goal_(p_start_),
      torques_(MatrixXd::Zero(layout.n, layout.intervals + 1)),
      intervals_(static_cast<std::size_t>(layout.intervals),
                 DiscreteLagrangian::Derivatives(layout.n)),
      nodes_(static_cast<std::size_t>(layout.intervals + 1),
             {MatrixXd::Zero(layout.n, 3 * layout.n), VectorXd::Zero(layout.n)}),
      direction_(layout.n) {
  dynamics::Workspace ws(*problem.model);
  dynamics::momentum(*problem.model, ws, problem.q_start, problem.v_start, p_start_);
  dynamics::momentum(*problem.model, ws, problem.q_goal, problem.v_goal, p_goal_);
  const VectorXd& limit = problem.limits.torque;
  for (Index k = 0; k <= layout.intervals; ++k)
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
  effort_ = 0.0;
  for (Index k = 0; k <= N; ++k) {
    Node& node = nodes_[static_cast<std::size_t>(k)];
    const double factor = 1.0 / (share(k) * h);  // half a step at the ends
    auto tau = torques_.col(k);
    node.by_q.setZero();
    node.by_h.setZero();
    tau.setZero();
    if (k == 0) tau -= p_start_;
    if (k == N) tau += p_goal_;
    if (k > 0) {
      const auto& before = intervals_[static_cast<std::size_t>(k - 1)];
      tau -= before.b;
      node.by_q.leftCols(n) = -factor * before.ab.transpose();
      node.by_q.middleCols(n, n) = -factor * before.bb;
      node.by_h -= factor * before.bh;
    }
    if (k < N) {
      const auto& after = intervals_[static_cast<std::size_t>(k)];
      tau -= after.a;
      node.by_q.middleCols(n, n) -= factor * after.aa;
      node.by_q.rightCols(n) = -factor * after.ab;
      node.by_h -= factor * after.ah;
    }
    tau *= factor;
    node.by_h -= tau / h;
    effort_ += share(k) * tau.cwiseAbs2().dot(effort_weights_);
  }
  for (std::size_t r = 0; r < rows_.size(); ++r)
    values[r] = rows_[r].scale * torques_(rows_[r].joint, rows_[r].knot);
}

void Torques::add_gradient(double factor, VectorXd& out) const {
  const Index n = layout_.n;
  for (Index k = 0; k <= layout_.intervals; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    const VectorXd weighted =
        2.0 * factor * share(k) * torques_.col(k).cwiseProduct(effort_weights_);
    for (Index a = -1; a <= 1; ++a)
      if (layout_.varies(k + a))
        out.segment((k + a - 1) * n, n).noalias() +=
            node.by_q.middleCols((a + 1) * n, n).transpose() * weighted;
    if (layout_.free_time) out[layout_.step_variable()] += layout_.h_ref * node.by_h.dot(weighted);
  }
}

void Torques::add_hessian(double factor, const double* y, const double* weights, bool curved,
                          BandedMatrix& out) {
  const Index n = layout_.n, N = layout_.intervals;
  // of each torque: what multiplies its second derivative, and the weight of its square
  MatrixXd slope(n, N + 1), square(n, N + 1);
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
void Torques::add_products(const MatrixXd& weights, BandedMatrix& out) {
  const Index n = layout_.n;
  MatrixXd weighted(n, 3 * n);
  for (Index k = 0; k <= layout_.intervals; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    weighted = weights.col(k).asDiagonal() * node.by_q;
    for (Index a = -1; a <= 1; ++a) {
      if (!layout_.varies(k + a)) continue;
      for (Index b = -1; b <= a; ++b)
        if (layout_.varies(k + b))
          out.block(k + a - 1, k + b - 1).noalias() +=
              node.by_q.middleCols((a + 1) * n, n).transpose() *
              weighted.middleCols((b + 1) * n, n);
      if (layout_.free_time)
        out.border().segment((k + a - 1) * n, n).noalias() +=
            layout_.h_ref * (weighted.middleCols((a + 1) * n, n).transpose() * node.by_h);
    }
    if (layout_.free_time)
      out.corner() += layout_.h_ref * layout_.h_ref * node.by_h.cwiseAbs2().dot(weights.col(k));
  }
}

// Σ_k y_k·∇²τ_k, docs/theory.md (18.5)
void Torques::add_curvature(const MatrixXd& y, BandedMatrix& out) {
  const Index n = layout_.n, N = layout_.intervals;
  const double h = knots_.h;
  const auto direction = [&](Index k) -> VectorXd { return y.col(k) / share(k); };
  for (Index k = 0; k < N; ++k) {
    lagrangian_.differentiate(knots_.q.col(k), knots_.q.col(k + 1), h, direction(k),
                              direction(k + 1), direction_);
    const auto& d = direction_;
    if (layout_.varies(k)) out.block(k - 1, k - 1) -= d.aa / h;
    if (layout_.varies(k + 1)) out.block(k, k) -= d.bb / h;
    if (layout_.varies(k) && layout_.varies(k + 1)) out.block(k, k - 1) -= d.ab.transpose() / h;
    if (!layout_.free_time) continue;
    if (layout_.varies(k)) out.border().segment((k - 1) * n, n) -= layout_.h_ref / h * d.ah;
    if (layout_.varies(k + 1)) out.border().segment(k * n, n) -= layout_.h_ref / h * d.bh;
    out.corner() -= layout_.h_ref * layout_.h_ref / h * d.hh;
  }
  if (!layout_.free_time) return;
  for (Index k = 0; k <= N; ++k) {
    const Node& node = nodes_[static_cast<std::size_t>(k)];
    for (Index a = -1; a <= 1; ++a)
      if (layout_.varies(k + a))
        out.border().segment((k + a - 1) * n, n).noalias() -=
            layout_.h_ref / h * (node.by_q.middleCols((a + 1) * n, n).transpose() * y.col(k));
    out.corner() -= layout_.h_ref * layout_.h_ref * 2.0 / h * node.by_h.dot(y.col(k));
  }
}

std::string Torques::describe(Index r) const {
  const Row& row = rows_[static_cast<std::size_t>(r)];
  return fmt::format("torque of joint {} at knot {}", row.joint + 1, row.knot);
}

}  // namespace hamelin::optimal
