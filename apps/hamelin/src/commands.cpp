#include "commands.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <vector>

#include "hamelin/core/error.hpp"

namespace hamelin::app {

namespace {

// A group of commands, in the order in which help shows them.
struct CommandGroup {
  const char* title;  ///< empty: hidden from help
  std::vector<const char*> names;
};

const std::vector<CommandGroup>& command_groups() {
  static const std::vector<CommandGroup> all{
      {"Run",
       {"run", "task", "plan", "optimize", "integrate", "accuracy", "replay", "sweep", "bench",
        "serve", "plant"}},
      {"Inspect", {"report", "explain", "robot", "scene", "map", "plugins"}},
      {"Files", {"export", "validate", "schema"}},
      {"Help", {"help", "completion"}},
      {"", {"man"}},
  };
  return all;
}

std::map<std::string, AddCommand>& registered() {
  static std::map<std::string, AddCommand> all;
  return all;
}

void add_absent(CLI::App& app, const std::string& name) {
  auto* command = app.add_subcommand(name)->group("")->allow_extras();
  command->set_help_flag();  // `--help` is refused, too
  command->callback([name] { throw Error(ErrorCode::usage, absence_of(name)); });
}

}  // namespace

RegisteredCommand::RegisteredCommand(const char* name, AddCommand add) {
  registered().emplace(name, add);
}

void add_commands(CLI::App& app, int& exit_code) {
  for (const auto& group : command_groups())
    for (const char* name : group.names) {
      const auto at = registered().find(name);
      if (at == registered().end()) {
        add_absent(app, name);
        continue;
      }
      at->second(app, exit_code);
      app.get_subcommand(name)->group(group.title);
    }
}

std::string absence_of(const std::string& name) {
  const auto& groups = command_groups();
  const bool known = std::any_of(groups.begin(), groups.end(), [&](const CommandGroup& group) {
    return std::find(group.names.begin(), group.names.end(), name) != group.names.end();
  });
  if (!known || registered().contains(name)) return {};
  return fmt::format(
      "{}: is not part of this build; `./dev build demo` in the checkout builds all commands",
      name);
}

}  // namespace hamelin::app
