#include "hamelin/timing/curve.hpp"

#include <algorithm>
#include <cmath>

namespace hamelin::timing {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

Curve::Curve(Index dof, int degree) : dof_(dof), degree_(degree) {}

// docs/theory.md (18.14), (18.15), by powers of the time.
Curve::Curve(const scene::JointTrajectory& trajectory)
    : Curve(trajectory.q.rows(), trajectory.a.cols() > 0 ? 5 : 3) {
  MatrixXd c(dof(), degree_ + 1);
  for (Index i = 0; i + 1 < trajectory.points(); ++i) {
    const double h = trajectory.time_s[i + 1] - trajectory.time_s[i];
    const VectorXd c1 = h * trajectory.v.col(i), dv = h * trajectory.v.col(i + 1) - c1;
    VectorXd dq = trajectory.q.col(i + 1) - trajectory.q.col(i) - c1;
    c.col(0) = trajectory.q.col(i);
    c.col(1) = c1 / h;
    if (degree_ == 5) {
      const VectorXd c2 = 0.5 * h * h * trajectory.a.col(i), slope = dv - 2.0 * c2,
                     bend = 0.5 * h * h * (trajectory.a.col(i + 1) - trajectory.a.col(i));
      dq -= c2;
      c.col(2) = c2 / (h * h);
      c.col(3) = (10.0 * dq - 4.0 * slope + bend) / (h * h * h);
      c.col(4) = (-15.0 * dq + 7.0 * slope - 2.0 * bend) / (h * h * h * h);
      c.col(5) = (6.0 * dq - 3.0 * slope + bend) / (h * h * h * h * h);
    } else {
      c.col(2) = (3.0 * dq - dv) / (h * h);
      c.col(3) = (dv - 2.0 * dq) / (h * h * h);
    }
    add(h, c);
  }
}

void Curve::add(double length, const MatrixXd& coefficients) {
  coefficients_.insert(coefficients_.end(), coefficients.data(),
                       coefficients.data() + coefficients.size());
  knots_.push_back(knots_.back() + length);
}

Index Curve::at(double s, VectorXd& q, VectorXd& dq, VectorXd& ddq, Index first) const {
  s = std::clamp(s, 0.0, end());
  const double *const knots = knots_.data(), *const last = knots + pieces(),
                      *const next =
                          std::upper_bound(knots + std::min(first, pieces() - 1) + 1, last, s);
  const Index piece = std::min(next - knots, pieces()) - 1;
  const double x = s - knots[piece];
  const Index n = dof();
  const double* c = coefficient(piece, degree_);
  for (Index j = 0; j < n; ++j) {
    q[j] = c[j];
    dq[j] = ddq[j] = 0.0;
  }
  for (int k = degree_ - 1; k >= 0; --k) {  // Horner's rule, for all three
    c = coefficient(piece, k);
    for (Index j = 0; j < n; ++j) {
      ddq[j] = ddq[j] * x + dq[j];
      dq[j] = dq[j] * x + q[j];
      q[j] = q[j] * x + c[j];
    }
  }
  ddq *= 2.0;
  return piece;
}

bool Curve::is_smooth() const {
  constexpr double rounding = 1e-6;
  for (Index k = 0; k + 1 < pieces(); ++k) {
    const double x = knot(k + 1) - knot(k);
    for (Index j = 0; j < dof(); ++j) {
      double before = 0.0;
      for (int power = degree_; power >= 1; --power)
        before = before * x + power * coefficient(k, power)[j];
      const double behind = coefficient(k + 1, 1)[j];
      if (!(std::abs(before - behind) <= rounding * (1.0 + std::abs(before)))) return false;
    }
  }
  return true;
}

void Curve::bound_bend(double from, double to, VectorXd& bend) const {
  const double* const knots = knots_.data();
  Index piece = std::upper_bound(knots + 1, knots + pieces(), from) - knots - 1;
  bend.setZero();
  for (; piece < pieces() && knots[piece] < to; ++piece)
    include_bend(piece, std::max(from, knots[piece]), std::min(to, knots[piece + 1]), bend);
}

// The second derivative is a polynomial of degree three at most: it is within the hull of its
// Bernstein coefficients.
void Curve::include_bend(Index piece, double from, double to, VectorXd& bend) const {
  const double a = from - knot(piece), h = to - from;
  const auto second = [&](Index j, double x, double& value, double& slope) {
    value = slope = 0.0;
    for (int k = degree_; k >= 2; --k) {
      const double c = coefficient(piece, k)[j] * k * (k - 1);
      slope = slope * x + value;
      value = value * x + c;
    }
  };
  for (Index j = 0; j < dof(); ++j) {
    double f0 = 0.0, g0 = 0.0, f1 = 0.0, g1 = 0.0;
    second(j, a, f0, g0);
    second(j, a + h, f1, g1);
    bend[j] = std::max({bend[j], std::abs(f0), std::abs(f0 + g0 * h / 3.0),
                        std::abs(f1 - g1 * h / 3.0), std::abs(f1)});
  }
}

void Curve::add(const Curve& curve) {
  Eigen::MatrixXd c(dof_, degree_ + 1);
  for (Index k = 0; k < curve.pieces(); ++k) {
    c.setZero();
    for (int power = 0; power <= curve.degree_; ++power)
      c.col(power) = Eigen::Map<const VectorXd>(curve.coefficient(k, power), dof_);
    add(curve.knot(k + 1) - curve.knot(k), c);
  }
}

// A polynomial of x by powers of x − d: c_i gets Σ_k binomial(k, i) d^(k − i) c_k.
Curve Curve::part(double from, double to) const {
  Curve out(dof_, degree_);
  for (Index k = 0; k < pieces(); ++k) {
    const double begin = std::max(from, knot(k)), end = std::min(to, knot(k + 1));
    if (!(end > begin)) continue;
    Eigen::MatrixXd c(dof_, degree_ + 1);
    for (int power = 0; power <= degree_; ++power)
      c.col(power) = Eigen::Map<const VectorXd>(coefficient(k, power), dof_);
    const double d = begin - knot(k);
    for (int i = 0; i < degree_; ++i)
      for (int j = degree_ - 1; j >= i; --j) c.col(j) += d * c.col(j + 1);
    out.add(end - begin, c);
  }
  return out;
}

double Curve::next_straight(double from) const {
  constexpr double zero = 1e-9;
  VectorXd q(dof_), dq(dof_), before(dof_), behind(dof_);
  for (Index k = 1; k < pieces(); ++k) {
    const double at_knot = knot(k);
    if (at_knot < from) continue;
    if (is_straight(k - 1) && knot(k - 1) <= from) return from;
    at(at_knot, q, dq, behind, k);
    const double h = knot(k) - knot(k - 1);
    before.setZero();
    for (int power = degree_; power >= 2; --power)
      before = h * before + static_cast<double>(power * (power - 1)) *
                                Eigen::Map<const VectorXd>(coefficient(k - 1, power), dof_);
    if (before.lpNorm<Eigen::Infinity>() < zero && behind.lpNorm<Eigen::Infinity>() < zero)
      return at_knot;
  }
  return is_straight(pieces() - 1) && knot(pieces() - 1) <= from ? from : end();
}

bool Curve::is_straight(Index piece) const {
  for (int power = 2; power <= degree_; ++power)
    if (!Eigen::Map<const VectorXd>(coefficient(piece, power), dof_).isZero(0.0)) return false;
  return true;
}

}  // namespace hamelin::timing
