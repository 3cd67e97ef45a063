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
  Real x[kernel::max_stages], w[kernel::max_stages];
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
  for (std::size_t j = 0; j < s; ++j) {
    t.b[j] = static_cast<double>(w[j]);
    Real product = 1.0L;
    for (std::size_t m = 0; m < s; ++m)
      if (m != j) product *= x[j] - x[m];
    t.barycentric[j] = static_cast<double>(1.0L / product);
    for (std::size_t i = 0; i < kernel::max_stages; ++i) {
      const Real c = x[i < s ? i : 0];
      Real a = 0.0L;
      for (std::size_t m = 0; m < s; ++m) a += w[m] * c * basis(j, c * x[m]);
      t.a_column[j][i] = static_cast<double>(a);
      t.c[i] = static_cast<double>(c);
    }
  }
  return t;
}

}  // namespace hamelin::integration
