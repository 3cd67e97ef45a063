#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

/// Reading the command line: shared by all subcommands.
namespace hamelin::app {

/// The group of the options that every command takes, before and after its name.
inline constexpr const char* global_options = "Global options";

/// Adds a subcommand whose help begins with `examples`, one per line.
CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& examples);

/// Makes the option refuse all but these values, with a hint at the nearest one. Help and
/// completion list the values. Returns the option.
CLI::Option* restrict_values(CLI::Option* option, const std::vector<std::string>& values);

/// Makes the option refuse all but names of integrators, which may carry an order ("gauss:8").
/// Returns the option.
CLI::Option* restrict_to_integrators(CLI::Option* option);

/// Exit codes besides 0 and those of a run's outcomes.
inline constexpr int bad_input = 2, defect = 3;

/// Performs an action of the program; an error becomes one line on stderr.
/// @return the exit code of the action, or that of the error
[[nodiscard]] int guarded(const std::function<int()>& action);

/// "hamelin scene info"
[[nodiscard]] std::string full_name(const CLI::App& command);

/// The subcommand of that name. @throws Error usage with the nearest name
[[nodiscard]] const CLI::App* find_command(const CLI::App& parent, const std::string& name);

/// One line that says what is wrong with a command line; for an unknown name with a hint at the
/// nearest known one.
[[nodiscard]] std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

/// A check for unsigned options: 0 to 2^53 - 1, the range of a scene's seed. Without it CLI11 would
/// read -1 as the largest unsigned number.
[[nodiscard]] CLI::Range unsigned_range();

/// Prints a document on stdout, for --json.
void print_json(const Json& document);

/// The numbers of a comma-separated list.
/// @throws Error usage naming the option, for anything else or if there are not `count` values
[[nodiscard]] std::vector<double> number_list(const std::string& option, const std::string& text,
                                              std::optional<std::size_t> count = {});

/// The command line as given, for logs.
[[nodiscard]] std::vector<std::string> command_line();
void set_command_line(std::vector<std::string> words);

/// The installation prefix, which holds this program's bin/; none if the system does not reveal it.
[[nodiscard]] std::optional<std::filesystem::path> prefix();

/// Adds --plugin-path DIR, which may be repeated.
void add_plugin_path_option(CLI::App& command, std::vector<std::filesystem::path>& directories);
/// The directories searched for planners: `given`, HAMELIN_PLUGIN_PATH, then this program's prefix.
[[nodiscard]] std::vector<std::filesystem::path> plugin_path(
    const std::vector<std::filesystem::path>& given);

}  // namespace hamelin::app
