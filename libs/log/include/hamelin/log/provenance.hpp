#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

namespace hamelin::log {

/// A file that a run depends on: scene, robot, spheres, map or plugin.
struct Input {
  std::string role;
  std::filesystem::path file;
};

/// Machine, build and inputs of a run: {host {os, cpu, cores, fma}, isa, build {id, compiler,
/// flags, type, sanitizers}, versions {hamelin, git_commit, eigen, octomap, libc}, cwd, argv,
/// inputs [{role, path, sha256}]}. Unknown values are null. `build/id` is the linker's build-id of
/// the program. `fma` says whether the C library's functions may fuse multiplications and
/// additions, which may change their last bit.
/// @param inputs hashed in this order
/// @param argv the command line
/// @throws Error io for an input that cannot be read
[[nodiscard]] Json provenance(const std::vector<Input>& inputs,
                              const std::vector<std::string>& argv = {});

}  // namespace hamelin::log
