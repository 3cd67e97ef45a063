#pragma once
#include <CLI/CLI.hpp>
#include <string>
#include <vector>

/// Help texts of the commands, taken from the tree of CLI::App. They appear as --help,
/// `hamelin help`, manual pages and completion.
namespace hamelin::app {

/// An entry of a list: "--step H" and its explanation.
struct HelpEntry {
  std::string name, text;
};

struct HelpSection {
  std::string title;
  std::vector<HelpEntry> entries;
};

struct HelpPage {
  std::string name;         ///< including the parents: "hamelin scene info"
  std::string usage;        ///< what follows the name
  std::string description;  ///< sentences
  std::vector<std::string> examples;
  std::vector<HelpSection> sections;
};

[[nodiscard]] HelpPage help_page(const CLI::App& command);

/// Text in lines of at most 100 columns that are indented by `left`, the first line excepted.
[[nodiscard]] std::string wrapped(const std::string& text, std::size_t left);

/// The first sentence of a description, without its full stop.
[[nodiscard]] std::string first_sentence(const std::string& description);

/// The output of --help, which begins with the examples, in lines of at most 100 columns.
[[nodiscard]] std::string help_text(const CLI::App& command);

/// The output of the program without arguments: its purpose, its commands and how to get more help.
[[nodiscard]] std::string overview_text(const CLI::App& program);

class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_help(const CLI::App* app, std::string name,
                        CLI::AppFormatMode mode) const override;
};

/// The subcommands that help shows: all but hidden ones.
[[nodiscard]] std::vector<const CLI::App*> shown_commands(const CLI::App& command);

/// An option's placeholder, e.g. FILE, without the text that its checks add; empty for a flag.
[[nodiscard]] std::string placeholder(const CLI::Option& option);

/// The names of an option, "-o" and "--output"; none for a positional argument.
[[nodiscard]] std::vector<std::string> names_of(const CLI::Option& option);

/// The values that an option accepts (see restrict_values); empty: any.
[[nodiscard]] std::vector<std::string> values_of(const CLI::Option& option);

}  // namespace hamelin::app
