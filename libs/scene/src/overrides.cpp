#include "hamelin/scene/overrides.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"

namespace hamelin::scene {

std::optional<PythonPlanner> python_planner(const std::string& planner, std::string_view option) {
  constexpr std::string_view scheme = "python:";
  if (!planner.starts_with(scheme)) return {};
  const std::string rest = planner.substr(scheme.size());
  const auto colon = rest.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == rest.size())
    throw Error(ErrorCode::usage,
                fmt::format("{}: '{}', expected python:FILE:CLASS", option, planner));
  return PythonPlanner{rest.substr(0, colon), rest.substr(colon + 1)};
}

namespace {

// The planner's entry of a scene.
Json planner_entry(const std::string& planner, std::string_view option) {
  const auto python = python_planner(planner, option);
  if (!python) return {{"name", planner}};
  return {{"name", "python"}, {"params", {{"file", python->file}, {"class", python->class_name}}}};
}

}  // namespace

void apply(const Overrides& o, std::string_view planner_option, Json& document) {
  if (!document.is_object()) return;  // the reader says what is wrong
  const auto choose = [&](const char* key, const Json& entry) {
    // The scene's parameters belong to the scene's planner or integrator only.
    if (entry.contains("params") || !document.contains(key) || !document[key].is_object() ||
        document[key].value("name", Json()) != entry["name"])
      document[key] = entry;
  };
  if (o.planner) choose("planner", planner_entry(*o.planner, planner_option));
  if (o.guide) {
    if (!document.contains("planner") || !document["planner"].is_object())
      document["planner"] = {{"name", "hybrid"}};
    document["planner"]["guide"] = *o.guide;
  }
  if (o.integrator) choose("integrator", {{"name", *o.integrator}});
  if (o.plant) document["plant"] = {{"type", *o.plant}};
  if (o.step_s) document["step_s"] = *o.step_s;
  if (o.duration_s) document["duration_s"] = *o.duration_s;
  if (o.seed) document["seed"] = *o.seed;
  for (const auto& assignment : o.set) set_pointer(document, assignment);
}

void set_target_file(Scene& scene, const std::filesystem::path& file, std::string_view option) {
  if (scene.goals.empty() || scene.goals.back().type != GoalType::follow ||
      scene.goals.back().motion)
    throw Error(ErrorCode::usage,
                fmt::format("{}: no goal of {} follows a streamed target, expected a last goal of "
                            "type follow without a motion",
                            option, scene.name));
  scene.goals.back().stream.file = file;
}

}  // namespace hamelin::scene
