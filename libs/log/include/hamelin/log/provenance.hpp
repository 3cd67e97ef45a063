#pragma once
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/core/json.hpp"

namespace hamelin::log {

/// Where and from what a run was made: {host {os, cpu, cores}, isa, build {compiler, flags, type, sanitizers}, versions
/// {hamelin, git_commit, eigen, octomap}, argv, inputs [{path, sha256}]}. What is not known is null.
/// @param inputs files the run depends on, hashed in this order
/// @param argv the command line, as given
/// @throws Error io for an input that cannot be read
[[nodiscard]] Json provenance(const std::vector<std::filesystem::path>& inputs,
                              const std::vector<std::string>& argv = {});

}  // namespace hamelin::log
