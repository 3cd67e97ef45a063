#pragma once
#include <catch2/catch.hpp>
#include <filesystem>
#include <optional>
#include <string>

namespace hamelin::test {

/// A folder of the shared test data beside the checkout, or nothing with a warning that the test is skipped.
inline std::optional<std::filesystem::path> shared_data(const std::string& name) {
  const auto path = std::filesystem::path(HAMELIN_SOURCE_DIR) / ".." / "shared" / "data" / name;
  if (std::filesystem::exists(path)) return path;
  WARN("skipped: no " << path.lexically_normal().string());
  return std::nullopt;
}

}  // namespace hamelin::test
