#pragma once
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

namespace hamelin::sweep {

/// A planner with assignments, parsed from "NAME+GUIDE:key=value,…" or, for Python,
/// from "python:FILE:CLASS".
struct Variant {
  std::string label;
  std::optional<std::string> planner;
  std::vector<std::string> set;
};

/// @param directory  of the plan; files of planners in Python are named relative to it
/// @throws Error usage
[[nodiscard]] Variant parse_variant(const std::string& text,
                                    const std::filesystem::path& directory);

/// All combinations of varied values, each a list of assignments.
/// @param vary  "/json/pointer=VALUE,VALUE,…"
/// @throws Error usage
[[nodiscard]] std::vector<std::vector<std::string>> combinations(
    const std::vector<std::string>& vary);

}  // namespace hamelin::sweep
