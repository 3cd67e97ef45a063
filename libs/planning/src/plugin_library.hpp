#pragma once
#include <filesystem>
#include <string>

#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::planning {

/// The shared object of a plugin, and what its entry point returned.
struct Plugin::Library {
  /// @throws Error plugin with the system's reason
  explicit Library(std::filesystem::path path);
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;
  ~Library();

  std::filesystem::path file;
  void* handle;
  const hamelin_plugin* raw = nullptr;
  std::string name, version, description;
  Json params_schema;
};

}  // namespace hamelin::planning
