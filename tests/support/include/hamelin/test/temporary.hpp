#pragma once
#include <filesystem>
#include <string>

namespace hamelin::test {

/// A path in the system's directory for temporary files.
inline std::filesystem::path temporary(const std::string& name) {
  return std::filesystem::temp_directory_path() / name;
}

}  // namespace hamelin::test
