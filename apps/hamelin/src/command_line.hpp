#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/io/json.hpp"

/// What the subcommands share in reading the command line.
namespace hamelin::app {

/// The group of the options that each command takes, before and after its name.
inline constexpr const char* everywhere = "Everywhere";

/// A subcommand whose help opens with `examples`, one a line.
CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& examples);

/// Refuses all but these values, with the nearest one; help and completion offer them. Returns the option.
CLI::Option* one_of(CLI::Option* option, const std::vector<std::string>& values);

/// Refuses all but names of integrators, which may carry an order ("gauss:8"). Returns the option.
CLI::Option* integrator_name(CLI::Option* option);

/// "hamelin scene info"
[[nodiscard]] std::string full_name(const CLI::App& command);

/// The subcommand of that name. @throws Error usage with the nearest name
[[nodiscard]] const CLI::App* find_command(const CLI::App& parent, const std::string& name);

/// One line that says what is wrong with a command line, with the nearest known name for an unknown one.
[[nodiscard]] std::string usage_message(const CLI::App& app, const CLI::ParseError& error);

/// A check for unsigned options: 0 to 2^53 - 1, what a scene's seed may be. CLI11 reads -1 as the largest number.
[[nodiscard]] CLI::Range whole_number();

/// Prints a document on stdout, for --json.
void print_json(const Json& document);

/// The numbers of a comma list. @throws Error usage naming the option, if it is no such list or has not `count` numbers
[[nodiscard]] std::vector<double> number_list(const std::string& option, const std::string& text,
                                              std::optional<std::size_t> count = {});

/// The command line as given.
[[nodiscard]] std::vector<std::string> command_line();
void set_command_line(int argc, char** argv);

/// The folder that holds this program's bin/ and what came with it; none if the system does not tell.
[[nodiscard]] std::optional<std::filesystem::path> prefix();

/// Where planners are looked for: `given`, HAMELIN_PLUGIN_PATH, then beside this program.
[[nodiscard]] std::vector<std::filesystem::path> plugin_path(const std::vector<std::filesystem::path>& given);

}  // namespace hamelin::app
