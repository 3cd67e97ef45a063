#include "scene_flags.hpp"

#include <fmt/format.h>

#include "command_line.hpp"
#include "document.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

// The joints of MuJoCo take torques, so that --plant mujoco implies sampled actuation where the
// file has the ideal one. --set may still say otherwise, and is then refused.
bool imply_sampled_actuation(const SceneFlags& flags, Json& document) {
  if (flags.plant != "mujoco" || !document.is_object()) return false;
  Json& actuation = document["actuation"];
  if (actuation.is_null()) actuation = Json::object();
  if (!actuation.is_object() || actuation.value("type", Json("ideal")) != "ideal") return false;
  actuation["type"] = "sampled";
  return true;
}

}  // namespace

scene::Scene read_scene(const std::filesystem::path& file, const SceneFlags& flags) {
  if (const Kind kind = kind_of(file); kind != Kind::scene)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is a {}, expected a scene", file.string(), to_string(kind)));
  Json document = read_json(file);
  apply_flags(flags, document, file.string());
  return scene::scene_from_json(document, file.parent_path(), file.string());
}

void apply_flags(const SceneFlags& flags, Json& document, const std::string& where) {
  const bool implied = imply_sampled_actuation(flags, document);
  scene::apply(flags, "--planner", document);
  if (implied && document["actuation"].is_object() &&
      document["actuation"].value("type", Json()) == "sampled")
    note(
        fmt::format("{}: /actuation/type: is sampled instead of ideal, because the joints of "
                    "MuJoCo take torques",
                    where));
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
  restrict_values(command.add_option(
                      "--guide", flags.guide,
                      "who is given paths to goals: planners that ask for them, nobody, or every "
                      "planner (default the scene's, or on-request)"),
                  {"on-request", "none", "rrt-connect"});
}

std::vector<std::filesystem::path> files_of(const scene::Scene& scene) {
  std::vector<std::filesystem::path> files = scene::input_files(scene);
  files.emplace_back(scene.name);
  return files;
}

}  // namespace hamelin::app
