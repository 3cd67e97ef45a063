#pragma once
#include <filesystem>
#include <string>

#include "hamelin/test/skip.hpp"

namespace hamelin::test {

inline const std::filesystem::path data = std::filesystem::path(HAMELIN_SOURCE_DIR) / "data";
/// A third-party arm with its licence; see data/README.md.
inline const std::filesystem::path third_party_robots = data / "robots" / "third_party";

/// A folder of test data that does not ship with the checkout. If it is missing, the test is
/// skipped.
inline std::filesystem::path shared_data(const std::string& name) {
  const auto path = std::filesystem::path(HAMELIN_SOURCE_DIR) / ".." / "shared" / "data" / name;
  skip_unless(std::filesystem::exists(path), "the folder '" + name + "' of data does not ship");
  return path;
}

}  // namespace hamelin::test
