#pragma once
#include <catch2/catch.hpp>
#include <filesystem>
#include <optional>
#include <string>

namespace hamelin::test {

inline const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
/// A third-party arm with its licence; see data/README.md.
inline const std::filesystem::path third_party_robots = data / "robots" / "third_party";

/// An optional folder of test data that does not ship with the checkout, or nothing. If it is
/// missing, the test must return: CTest then counts it as skipped because of the printed line.
inline std::optional<std::filesystem::path> shared_data(const std::string& name) {
  const auto path = std::filesystem::path(HAMELIN_SOURCE_DIR) / ".." / "shared" / "data" / name;
  if (std::filesystem::exists(path)) return path;
  WARN("skipped: no folder '" << name << "' of data that does not ship");
  return std::nullopt;
}

}  // namespace hamelin::test
