#include "scene_flags.hpp"

#include <fmt/format.h>

#include "command_line.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::app {

namespace {

// A planner's entry in a scene. "python:FILE:CLASS" is the planner `python` with its parameters.
Json planner_entry(const std::string& name) {
  constexpr std::string_view scheme = "python:";
  if (!name.starts_with(scheme)) return {{"name", name}};
  const std::string rest = name.substr(scheme.size());
  const auto colon = rest.rfind(':');
  if (colon == std::string::npos || colon == 0 || colon + 1 == rest.size())
    throw Error(ErrorCode::usage, fmt::format("--planner: '{}', expected python:FILE:CLASS", name));
  return {{"name", "python"},
          {"params", {{"file", rest.substr(0, colon)}, {"class", rest.substr(colon + 1)}}}};
}

}  // namespace

scene::Scene read_scene(const std::filesystem::path& file, const SceneFlags& flags) {
  if (const Kind kind = kind_of(file); kind != Kind::scene)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a scene", file.string(), to_string(kind)));
  Json document = read_json(file);
  const auto choose = [&](const char* key, const Json& entry) {
    // The scene's parameters belong to the scene's planner or integrator only.
    if (entry.contains("params") || !document.contains(key) || !document[key].is_object() ||
        document[key].value("name", Json()) != entry["name"])
      document[key] = entry;
  };
  if (flags.planner) choose("planner", planner_entry(*flags.planner));
  if (flags.guide) {
    if (!document.contains("planner") || !document["planner"].is_object())
      document["planner"] = {{"name", "hybrid"}};
    document["planner"]["guide"] = *flags.guide;
  }
  if (flags.integrator) choose("integrator", {{"name", *flags.integrator}});
  if (flags.plant) document["plant"] = {{"type", *flags.plant}};
  if (flags.step_s) document["step_s"] = *flags.step_s;
  if (flags.duration_s) document["duration_s"] = *flags.duration_s;
  if (flags.seed) document["seed"] = *flags.seed;
  for (const auto& assignment : flags.set) scene::set_pointer(document, assignment);
  return scene::scene_from_json(document, file.parent_path(), file.string());
}

void add_set_option(CLI::App& command, std::vector<std::string>& set, const std::string& help) {
  command.add_option("--set", set, help)->type_name("/json/pointer=VALUE")->allow_extra_args(false);
}

void add_seed_option(CLI::App& command, SceneFlags& flags) {
  command.add_option("--seed", flags.seed, "seed of all random numbers (default the scene's)")
      ->type_name("S")
      ->check(unsigned_range());
}

void add_guide_option(CLI::App& command, SceneFlags& flags) {
  restrict_values(
      command.add_option("--guide", flags.guide,
                         "planner of OMPL that searches a path to each goal (default the scene's, "
                         "or none)"),
      {"none", "rrt", "rrt-connect", "rrt-star", "bit-star", "informed-rrt-star"});
}

std::vector<std::filesystem::path> files_of(const scene::Scene& scene) {
  std::vector<std::filesystem::path> files = scene::input_files(scene);
  files.emplace_back(scene.name);
  return files;
}

}  // namespace hamelin::app
