#pragma once
#include <optional>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::sweep {

/// The middle value; of an even number of values, the lower of the two in the middle.
[[nodiscard]] std::optional<double> median(std::vector<double> values);
[[nodiscard]] std::optional<double> smallest(const std::vector<double>& values);
[[nodiscard]] std::optional<double> largest(const std::vector<double>& values);
[[nodiscard]] std::optional<double> mean(const std::vector<double>& values);

[[nodiscard]] inline Json or_null(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

}  // namespace hamelin::sweep
