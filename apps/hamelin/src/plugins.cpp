#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "help.hpp"
#include "plugin_check.hpp"

namespace hamelin::app {

namespace {

struct ListOptions {
  std::vector<std::filesystem::path> plugin_path;
  bool json = false;
};

struct CheckOptions {
  std::string plugin;
  std::vector<std::filesystem::path> plugin_path;
  PluginCheckOptions how;
  bool json = false;
};

void list(const ListOptions& options) {
  const auto directories = plugin_path(options.plugin_path);
  Json all = Json::array();
  for (const auto& found : planning::list_plugins(directories)) {
    Json entry{{"file", found.file.string()}};
    if (found.plugin) {
      entry["name"] = found.plugin->name();
      entry["version"] = found.plugin->version();
      entry["description"] = found.plugin->description();
      entry["params_schema"] = found.plugin->params_schema();
    } else {
      entry["refused"] = found.refusal;
    }
    all.push_back(std::move(entry));
  }
  if (options.json) {
    print_json(all);
    return;
  }
  for (const auto& entry : all) {
    if (entry.contains("refused")) {
      fmt::print("refused: {}\n", entry["refused"].get<std::string>());
      continue;
    }
    fmt::print("{} {}: {}\n  {}\n", entry["name"].get<std::string>(),
               entry["version"].get<std::string>(), entry["description"].get<std::string>(),
               entry["file"].get<std::string>());
    const Json properties = entry["params_schema"].value("properties", Json::object());
    for (const auto& [key, rule] : properties.items()) {
      const std::string name = fmt::format("    {:<22} {:<16} ", key,
                                           rule.contains("default") ? rule["default"].dump() : "");
      fmt::print("{}{}\n", name, wrapped(rule.value("description", ""), name.size()));
    }
  }
  if (all.empty()) {
    fmt::print("no plugins found; searched:\n");
    for (const auto& directory : directories) fmt::print("  {}\n", directory.string());
  }
}

const char* to_string(PluginCheck::Outcome outcome) {
  switch (outcome) {
    case PluginCheck::Outcome::ok:
      return "ok";
    case PluginCheck::Outcome::failed:
      return "failed";
    case PluginCheck::Outcome::skipped:
      return "skipped";
  }
  return "";
}

int check(const CheckOptions& options) {
  const planning::Plugin plugin =
      planning::find_plugin(options.plugin, plugin_path(options.plugin_path));
  PluginCheckOptions how = options.how;
  if (how.scenes.empty()) how.scenes = scenes_of_checkout();
  const auto results = check_plugin(plugin, how);
  Json all = Json::array();
  bool failed = false;
  for (const auto& result : results) {
    failed = failed || result.outcome == PluginCheck::Outcome::failed;
    all.push_back({{"check", result.name},
                   {"outcome", to_string(result.outcome)},
                   {"text", result.text.empty() ? Json(nullptr) : Json(result.text)}});
    if (!options.json)
      fmt::print("{:<8} {}{}{}\n", to_string(result.outcome), result.name,
                 result.text.empty() ? "" : ": ", result.text);
  }
  if (options.json) print_json(all);
  return failed ? 1 : 0;
}

void add_plugins(CLI::App& app, int& exit_code) {
  auto* plugins = add_command(app, "plugins", "List and check planner plugins",
                              "hamelin plugins list\n"
                              "hamelin plugins check build/lib/hamelin/plugins/mine.hamelin.so");
  plugins->require_subcommand(1);

  auto* list_command =
      add_command(*plugins, "list", "List all planners found, with their parameters",
                  "hamelin plugins list\n"
                  "hamelin plugins list --plugin-path build/lib/hamelin/plugins --json");
  const auto list_options = std::make_shared<ListOptions>();
  list_command
      ->add_option("--plugin-path", list_options->plugin_path,
                   "directory to search first; may be repeated")
      ->type_name("DIR")
      ->allow_extra_args(false);
  list_command->add_flag("--json", list_options->json,
                         "print JSON, including the parameter schemas");
  list_command->callback([list_options] { list(*list_options); });

  auto* check_command =
      add_command(*plugins, "check", "Test a planner against the contract of the plugin interface",
                  "hamelin plugins check gyro\n"
                  "hamelin plugins check build/lib/hamelin/plugins/mine.hamelin.so\n"
                  "hamelin plugins check hybrid --scene cell.json --deadline 0.0005");
  const auto check_options = std::make_shared<CheckOptions>();
  check_command->add_option("plugin", check_options->plugin, "planner plugin, by name or path")
      ->required()
      ->type_name("NAME|PATH");
  check_command
      ->add_option("--plugin-path", check_options->plugin_path,
                   "directory to search first; may be repeated")
      ->type_name("DIR")
      ->allow_extra_args(false);
  check_command
      ->add_option("--scene", check_options->how.scenes,
                   "scene to try it in, besides three built-in ones; may be repeated (default: "
                   "some of data/scenes, if the working directory has that folder)")
      ->type_name("FILE")
      ->allow_extra_args(false);
  check_command
      ->add_option("--deadline", check_options->how.deadline_s,
                   "time that 99 % of its ticks may take (default: the scene's "
                   "/actuation/deadline_s, else the control period)")
      ->type_name("S")
      ->check(CLI::PositiveNumber);
  check_command
      ->add_option("--timeout", check_options->how.timeout_s,
                   "time after which a part of the test has failed (default: 120)")
      ->type_name("S")
      ->check(CLI::PositiveNumber);
  check_command->add_flag("--json", check_options->json, "print JSON");
  check_command->callback([check_options, &exit_code] { exit_code = check(*check_options); });
}

const RegisteredCommand registered_plugins("plugins", add_plugins);

}  // namespace

}  // namespace hamelin::app
