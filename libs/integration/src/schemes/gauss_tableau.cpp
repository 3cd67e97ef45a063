#include "gauss_tableau.hpp"

#include <cmath>
#include <numbers>

namespace hamelin::integration {

// Nodes are the roots of the Legendre polynomial P_s on [0, 1], found by Newton's method. The
// integrals a_ij are exact by Gauss quadrature with the same nodes. Computed in long double, so
// that the rounded numbers are correct.
kernel::GaussTableau gauss_tableau(std::size_t s) {
  using Real = long double;
  kernel::GaussTableau t{};
  t.stages = s;
  Real x[kernel::max_stages]{}, w[kernel::max_stages]{};
  for (std::size_t i = 0; i < s; ++i) {
    Real z = std::cos(std::numbers::pi_v<Real> * (static_cast<Real>(i) + 0.75L) /
                      (static_cast<Real>(s) + 0.5L));
    Real slope = 1.0L;
    for (int newton = 0; newton < 50; ++newton) {
      Real before = 1.0L, value = z;
      for (std::size_t j = 2; j <= s; ++j) {
        const auto k = static_cast<Real>(j);
        const Real next = ((2.0L * k - 1.0L) * z * value - (k - 1.0L) * before) / k;
        before = value;
        value = next;
      }
      slope = static_cast<Real>(s) * (z * value - before) / (z * z - 1.0L);
      z -= value / slope;
    }
    x[s - 1 - i] = 0.5L * (1.0L + z);
    w[s - 1 - i] = 1.0L / ((1.0L - z * z) * slope * slope);
  }
  const auto basis = [&](std::size_t j, Real at) {
    Real value = 1.0L;
    for (std::size_t m = 0; m < s; ++m)
      if (m != j) value *= (at - x[m]) / (x[j] - x[m]);
    return value;
  };
  Real a[kernel::max_stages][kernel::max_stages];
  for (std::size_t i = 0; i < s; ++i)
    for (std::size_t j = 0; j < s; ++j) {
      a[i][j] = 0.0L;
      for (std::size_t m = 0; m < s; ++m) a[i][j] += w[m] * x[i] * basis(j, x[i] * x[m]);
    }
  for (std::size_t j = 0; j < s; ++j) {
    for (std::size_t i = 0; i < s; ++i) {
      Real square = 0.0L;
      for (std::size_t m = 0; m < s; ++m) square += a[i][m] * a[m][j];
      t.nu_column[j][i] = static_cast<double>(square / w[j]);
      // The larger of μ_ij and μ_ji is rounded, and the other is then one minus it without error.
      const Real mu = a[i][j] / w[j];
      t.mu_column[j][i] = mu > 0.5L ? static_cast<double>(mu)
                          : i == j  ? 0.5
                                    : 1.0 - static_cast<double>(a[j][i] / w[i]);
    }
  }
  for (std::size_t i = 0; i < kernel::max_stages; ++i) {
    const std::size_t stage = i < s ? i : 0;
    t.c[i] = static_cast<double>(x[stage]);
    t.b[i] = static_cast<double>(w[stage]);
    for (std::size_t j = 0; j < s; ++j) {
      t.mu_column[j][i] = t.mu_column[j][stage];
      t.nu_column[j][i] = t.nu_column[j][stage];
    }
  }
  return t;
}

kernel::GaussGuess gauss_guess(const kernel::GaussTableau& t, double ratio, double older_at) {
  const std::size_t s = t.stages;
  double node[kernel::max_stages + 1], factor[kernel::max_stages + 1];
  for (std::size_t j = 0; j < s; ++j) node[j] = t.c[j];
  node[s] = older_at;
  kernel::GaussGuess guess{};
  guess.nodes = older_at < 0.0 ? s + 1 : s;
  for (std::size_t j = 0; j < guess.nodes; ++j) {
    factor[j] = t.b[j < s ? j : s - 1];
    for (std::size_t m = 0; m < guess.nodes; ++m)
      if (m != j) factor[j] *= node[j] - node[m];
  }
  // ℓ_j(x)/b_j for x beyond all nodes
  const auto lagrange = [&](double x, auto&& store) {
    double product = 1.0;
    for (std::size_t j = 0; j < guess.nodes; ++j) product *= x - node[j];
    for (std::size_t j = 0; j < guess.nodes; ++j) store(j, product / (factor[j] * (x - node[j])));
  };
  lagrange(1.0, [&](std::size_t j, double value) { guess.end[j] = value; });
  for (std::size_t i = 0; i < kernel::max_stages; ++i)
    lagrange(1.0 + ratio * t.c[i],
             [&](std::size_t j, double value) { guess.column[j][i] = ratio * t.b[i] * value; });
  return guess;
}

}  // namespace hamelin::integration
