#pragma once
#include <algorithm>
#include <cmath>
#include <span>

namespace hamelin::mppi {

/// Replaces costs by the weights exp(−(S − S_min)/λ), which add up to 1: docs/theory.md (15.12).
/// Sums run in the order of the samples.
/// @return the effective sample size 1/Σw², docs/theory.md (15.13)
inline double weights_of_costs(std::span<double> costs, double temperature) {
  const double least = *std::min_element(costs.begin(), costs.end());
  double sum = 0.0, squares = 0.0;
  for (double& x : costs) sum += x = std::exp(-(x - least) / temperature);
  for (double& x : costs) x /= sum, squares += x * x;
  return 1.0 / squares;
}

}  // namespace hamelin::mppi
