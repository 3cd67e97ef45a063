#pragma once
#include <unistd.h>

#include <filesystem>
#include <string>

namespace hamelin::test {

/// A path in a directory of this process's own, which goes with the process: tests run side by side.
inline std::filesystem::path temporary(const std::string& name) {
  struct Folder {
    std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("hamelin_test_" + std::to_string(::getpid()));
    Folder() { std::filesystem::create_directories(path); }
    ~Folder() {
      std::error_code ignored;
      std::filesystem::remove_all(path, ignored);
    }
    Folder(const Folder&) = delete;
    Folder& operator=(const Folder&) = delete;
  };
  static const Folder folder;
  return folder.path / name;
}

}  // namespace hamelin::test
