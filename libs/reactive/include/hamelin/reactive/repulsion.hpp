#pragma once
#include <algorithm>

namespace hamelin::reactive {

/// Khatib's repulsion at the distance ρ: its potential V(ρ) = ½ η (1/ρ − 1/ρ0)² and its force
/// −V'(ρ). Below ρ_min the force is constant and V continues as a straight line.
/// docs/theory.md (9.2), (9.3)
struct Repulsion {
  double eta, rho0, rho_min;

  [[nodiscard]] double force(double rho) const {
    const double r = std::max(rho, rho_min);
    return eta * (1.0 / r - 1.0 / rho0) / (r * r);
  }
  [[nodiscard]] double potential(double rho) const {
    const double r = std::max(rho, rho_min), s = 1.0 / r - 1.0 / rho0;
    return 0.5 * eta * s * s + force(r) * (r - std::min(rho, r));
  }
};

}  // namespace hamelin::reactive
