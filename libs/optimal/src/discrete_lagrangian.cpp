#include "discrete_lagrangian.hpp"

#include <algorithm>

namespace hamelin::optimal {

DiscreteLagrangian::Derivatives::Derivatives(Eigen::Index dof)
    : a(VectorXd::Zero(dof)), b(a), aa(MatrixXd::Zero(dof, dof)), ab(aa), bb(aa), ah(a), bh(a) {}

DiscreteLagrangian::DiscreteLagrangian(const model::Model& model)
    : model_(model),
      ws_(model),
      kinetic_(model.dof()),
      potential_(model.dof()),
      q_(VectorXd::Zero(model.dof())),
      v_(q_),
      a_(q_),
      b_(q_),
      ahead_(model.dof()) {}

// docs/theory.md (18.5)
void DiscreteLagrangian::evaluate(const VectorXd& a, const VectorXd& b, double h,
                                  Derivatives& out) {
  q_ = 0.5 * (a + b);
  v_ = (b - a) / h;
  dynamics::kinetic_derivatives(model_, ws_, q_, v_, kinetic_);
  const auto& k = kinetic_;
  out.ah = 0.5 * k.dK_dq;
  out.ah.noalias() -= 0.5 * (k.dp_dq.transpose() * v_);
  out.bh = out.ah - k.p / h;
  out.ah += k.p / h;
  out.a = (0.5 * h) * k.dK_dq - k.p;
  out.b = (0.5 * h) * k.dK_dq + k.p;
  out.hh = v_.dot(k.p) / h;
  out.aa = k.M / h + (0.25 * h) * k.d2K_dq2;
  out.bb = out.aa + 0.5 * (k.dp_dq + k.dp_dq.transpose());
  out.aa -= 0.5 * (k.dp_dq + k.dp_dq.transpose());
  out.ab = (0.25 * h) * k.d2K_dq2 + 0.5 * (k.dp_dq.transpose() - k.dp_dq) - k.M / h;
  dynamics::potential_derivatives(model_, ws_, a, potential_);
  out.a -= (0.5 * h) * potential_.dU_dq;
  out.ah -= 0.5 * potential_.dU_dq;
  out.aa -= (0.5 * h) * potential_.d2U_dq2;
  dynamics::potential_derivatives(model_, ws_, b, potential_);
  out.b -= (0.5 * h) * potential_.dU_dq;
  out.bh -= 0.5 * potential_.dU_dq;
  out.bb -= (0.5 * h) * potential_.d2U_dq2;
}

void DiscreteLagrangian::differentiate(const VectorXd& a, const VectorXd& b, double h,
                                       const VectorXd& da, const VectorXd& db, Derivatives& out) {
  // The change of both angle and velocity is small where the difference is taken; its error is of
  // second order and only slows the convergence of Newton's method.
  const double size = std::max({da.lpNorm<Eigen::Infinity>(), db.lpNorm<Eigen::Infinity>(),
                                (db - da).lpNorm<Eigen::Infinity>() / h});
  out = Derivatives(model_.dof());
  if (!(size > 0.0)) return;
  const double step = 1e-4 / size;
  a_ = a + step * da;
  b_ = b + step * db;
  evaluate(a_, b_, h, ahead_);
  a_ = a - step * da;
  b_ = b - step * db;
  evaluate(a_, b_, h, out);
  const double scale = 0.5 / step;
  out.aa = scale * (ahead_.aa - out.aa);
  out.ab = scale * (ahead_.ab - out.ab);
  out.bb = scale * (ahead_.bb - out.bb);
  out.ah = scale * (ahead_.ah - out.ah);
  out.bh = scale * (ahead_.bh - out.bh);
  out.hh = scale * (ahead_.hh - out.hh);
}

}  // namespace hamelin::optimal
