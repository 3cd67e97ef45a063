#pragma once
#include <CLI/CLI.hpp>
#include <string>

/// The commands of the program. A command registers itself where it is defined, so that the program
/// has those whose sources it is built from (HAMELIN_COMMANDS in apps/hamelin/CMakeLists.txt).
namespace hamelin::app {

/// Adds a command to the program. Its action runs after the command line is parsed and sets the
/// exit code.
using AddCommand = void (*)(CLI::App& app, int& exit_code);

/// An object of this type with static storage duration registers a command.
struct RegisteredCommand {
  /// @param name  one of the names in commands.cpp, which also orders and groups them
  RegisteredCommand(const char* name, AddCommand add);
};

/// Adds all registered commands, grouped and in the order of help. Those that this build lacks are
/// added hidden, and refuse to run.
void add_commands(CLI::App& app, int& exit_code);

/// The message for a command that this build lacks; empty for any other name.
[[nodiscard]] std::string absence_of(const std::string& name);

}  // namespace hamelin::app
