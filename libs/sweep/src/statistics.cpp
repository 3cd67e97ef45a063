#include "statistics.hpp"

#include <algorithm>
#include <cstddef>

namespace hamelin::sweep {

// docs/theory.md (13.14)
std::optional<double> median(std::vector<double> values) {
  if (values.empty()) return std::nullopt;
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>((values.size() - 1) / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

std::optional<double> smallest(const std::vector<double>& values) {
  return values.empty() ? std::nullopt
                        : std::optional(*std::min_element(values.begin(), values.end()));
}

std::optional<double> largest(const std::vector<double>& values) {
  return values.empty() ? std::nullopt
                        : std::optional(*std::max_element(values.begin(), values.end()));
}

std::optional<double> mean(const std::vector<double>& values) {
  if (values.empty()) return std::nullopt;
  double sum = 0.0;
  for (const double value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

}  // namespace hamelin::sweep
