#include "variant.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/overrides.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::sweep {

namespace {

// Splits at commas outside of brackets, braces and quotes.
std::vector<std::string> split_values(const std::string& text) {
  std::vector<std::string> parts(1);
  int depth = 0;
  bool quoted = false;
  for (const char c : text) {
    if (c == '"') quoted = !quoted;
    if (!quoted && (c == '[' || c == '{')) ++depth;
    if (!quoted && (c == ']' || c == '}')) --depth;
    if (c == ',' && depth == 0 && !quoted)
      parts.emplace_back();
    else
      parts.back() += c;
  }
  return parts;
}

}  // namespace

Variant parse_variant(const std::string& text, const std::filesystem::path& directory) {
  if (auto python = scene::python_planner(text, "--planner")) {
    python->file = std::filesystem::proximate(python->file, directory).generic_string();
    return {text, python->text(), {}};
  }
  const auto colon = text.find(':');
  Variant variant{text, text.substr(0, colon), {}};
  if (variant.planner->empty())
    throw Error(ErrorCode::usage,
                fmt::format("--planner {}: no name, expected NAME or NAME:key=value,...", text));
  // "NAME+GUIDE": a guide searches paths for the planner.
  if (const auto plus = variant.planner->rfind('+'); plus != std::string::npos) {
    const std::string guide = variant.planner->substr(plus + 1);
    if (scene::guide_type(guide)) {
      variant.planner->resize(plus);
      variant.set.push_back("/planner/guide=" + guide);
    }
  }
  if (colon == std::string::npos) return variant;
  for (const auto& part : split_values(text.substr(colon + 1))) {
    const auto equals = part.find('=');
    if (equals == 0 || equals == std::string::npos)
      throw Error(
          ErrorCode::usage,
          fmt::format("--planner {}: '{}' is not a parameter, expected key=value", text, part));
    variant.set.push_back("/planner/params/" + part);
  }
  return variant;
}

std::vector<std::vector<std::string>> combinations(const std::vector<std::string>& vary) {
  std::vector<std::vector<std::string>> all{{}};
  for (const auto& text : vary) {
    const auto equals = text.find('=');
    if (text.empty() || text.front() != '/' || equals == std::string::npos)
      throw Error(ErrorCode::usage,
                  fmt::format("--vary {}: expected /json/pointer=VALUE,VALUE,...", text));
    std::vector<std::vector<std::string>> extended;
    for (const auto& combination : all)
      for (const auto& value : split_values(text.substr(equals + 1))) {
        extended.push_back(combination);
        extended.back().push_back(text.substr(0, equals + 1) + value);
      }
    all = std::move(extended);
  }
  return all;
}

}  // namespace hamelin::sweep
