#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

/// What the program tells of its commands: read off the tree of CLI::App once, shown as --help, `hamelin help`, manual
/// pages and completion.
namespace hamelin::app {

/// A line of a list: "--step H" and what it means.
struct HelpEntry {
  std::string name, text;
};

struct HelpSection {
  std::string title;
  std::vector<HelpEntry> entries;
};

struct HelpPage {
  std::string name;         ///< with those of its parents: "hamelin scene info"
  std::string usage;        ///< what follows the name
  std::string description;  ///< sentences
  std::vector<std::string> examples;
  std::vector<HelpSection> sections;
};

[[nodiscard]] HelpPage help_page(const CLI::App& command);

/// The first sentence of a description, without its stop.
[[nodiscard]] std::string first_sentence(const std::string& description);

/// What --help prints: opens with the examples, lines of at most 100 columns.
[[nodiscard]] std::string help_text(const CLI::App& command);

/// What the program prints without arguments: what it is, its commands, where to go on.
[[nodiscard]] std::string overview_text(const CLI::App& program);

class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override;
};

/// Subcommands that help shows: all but hidden ones.
[[nodiscard]] std::vector<const CLI::App*> shown_commands(const CLI::App& command);

/// An option's placeholder, e.g. FILE, without what its checks add; empty for a flag.
[[nodiscard]] std::string placeholder(const CLI::Option& option);

/// "-o", "--output"; none for an argument.
[[nodiscard]] std::vector<std::string> names_of(const CLI::Option& option);

/// The only values an option takes (see one_of); empty: any.
[[nodiscard]] std::vector<std::string> values_of(const CLI::Option& option);

}  // namespace hamelin::app
