#pragma once
#include <catch2/catch.hpp>
#include <filesystem>
#include <optional>
#include <string>

namespace hamelin::test {

inline const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
/// An arm that is not ours, with its licence; see data/README.md.
inline const std::filesystem::path third_party_robots = data / "robots" / "third_party";

/// A folder of test data beside the checkout that may not ship with it, or nothing. Then the test must do nothing
/// else: the line makes ctest count it as skipped.
inline std::optional<std::filesystem::path> shared_data(const std::string& name) {
  const auto path = std::filesystem::path(HAMELIN_SOURCE_DIR) / ".." / "shared" / "data" / name;
  if (std::filesystem::exists(path)) return path;
  WARN("skipped: no folder '" << name << "' of data that does not ship");
  return std::nullopt;
}

}  // namespace hamelin::test
