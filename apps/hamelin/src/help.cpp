#include "help.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"

namespace hamelin::app {

namespace {

constexpr std::size_t width = 100, indent = 30;
// A list of values longer than this goes to the text.
constexpr std::size_t longest_value_list = 24;

const std::vector<HelpSection>& about_the_program() {
  static const std::vector<HelpSection> sections{
      {"Exit codes",
       {{"0", "done; the goal was reached"},
        {"1", "ran, but the goal was not reached or a check failed"},
        {"2", "bad input or usage, a refused plugin, an output that cannot be written, a start in contact"},
        {"3", "diverged, or an internal check failed: unconverged step, energy account, planner's answer"},
        {"130", "interrupted; what was recorded so far is written"}}},
      {"Environment",
       {{"HAMELIN_PLUGIN_PATH", "directories to look for planners in, separated by colons"},
        {"HAMELIN_ISA", "x86-64, v3 (AVX2) or v4 (AVX-512): the instruction set to compute with (default the best)"},
        {"NO_COLOR, TERM=dumb", "no colour, as --no-color; a dumb terminal gets no counting line either"}}}};
  return sections;
}

std::vector<std::string> split(const std::string& text, char at) {
  std::vector<std::string> parts;
  for (std::size_t begin = 0; begin < text.size();) {
    const auto end = std::min(text.find(at, begin), text.size());
    parts.push_back(text.substr(begin, end - begin));
    begin = end + 1;
  }
  return parts;
}

HelpEntry entry_of(const CLI::Option& option) {
  HelpEntry entry;
  const auto values = values_of(option);
  const std::string list = fmt::format("{}", fmt::join(values, "|"));
  const bool in_place = !values.empty() && list.size() <= longest_value_list;
  const std::string value = in_place ? list : placeholder(option);
  if (option.get_positional()) {
    entry.name = value;
  } else {
    entry.name = fmt::format("{}", fmt::join(names_of(option), ", "));
    if (!value.empty()) entry.name += " " + value;
  }
  entry.text = option.get_description();
  if (!values.empty() && !in_place) entry.text += fmt::format("; one of {}", fmt::join(values, ", "));
  if (!option.get_default_str().empty()) entry.text += fmt::format(" (default {})", option.get_default_str());
  if (option.get_required() && !option.get_positional()) entry.text += " (required)";
  return entry;
}

std::string usage_of(const CLI::App& command) {
  std::string usage;
  if (!command.get_subcommands({}).empty()) usage += " COMMAND";
  for (const auto* option : command.get_options()) {
    if (option->get_positional())
      usage += option->get_required() ? " " + entry_of(*option).name : fmt::format(" [{}]", entry_of(*option).name);
    else if (option->get_required())
      usage += fmt::format(" {} {}", names_of(*option).front(), placeholder(*option));
  }
  return usage + " [OPTIONS]";
}

// Each command has a --help of its own; the program's stands for all.
bool is_inherited_help(const CLI::Option& option, const CLI::App& command) {
  return command.get_parent() != nullptr && &option == command.get_help_ptr();
}

// Options of one kind; hidden ones are in no group.
HelpSection options_of(const CLI::App& command, const std::string& title, const std::string& group, bool positional) {
  HelpSection section{title, {}};
  for (const auto* option : command.get_options())
    if (option->get_group() == group && option->get_positional() == positional && !is_inherited_help(*option, command))
      section.entries.push_back(entry_of(*option));
  return section;
}

// Words in lines that begin after `left` columns; the first line's beginning is written already.
std::string wrapped(const std::string& text, std::size_t left) {
  std::string out;
  std::size_t column = left;
  for (const auto& word : split(text, ' ')) {
    if (column > left && column + 1 + word.size() > width) {
      out += "\n" + std::string(left, ' ');
      column = left;
    } else if (column > left) {
      out += ' ';
      ++column;
    }
    out += word;
    column += word.size();
  }
  return out;
}

std::string shown(const HelpSection& section) {
  std::string out = fmt::format("\n{}:\n", section.title);
  for (const auto& entry : section.entries) {
    const std::string name = "  " + entry.name;
    out += name.size() + 2 <= indent ? fmt::format("{:<{}}", name, indent) : name + "\n" + std::string(indent, ' ');
    out += wrapped(entry.text, indent) + "\n";
  }
  return out;
}

const CLI::App& root_of(const CLI::App& command) {
  return command.get_parent() == nullptr ? command : root_of(*command.get_parent());
}

}  // namespace

std::string placeholder(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  return type.substr(0, type.find(':'));
}

std::vector<std::string> names_of(const CLI::Option& option) {
  std::vector<std::string> names;
  for (const auto& name : option.get_snames()) names.push_back("-" + name);
  for (const auto& name : option.get_lnames()) names.push_back("--" + name);
  return names;
}

std::vector<std::string> values_of(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const auto open = type.find('{'), close = type.find('}');
  if (open == std::string::npos || close == std::string::npos) return {};
  return split(type.substr(open + 1, close - open - 1), ',');
}

std::vector<const CLI::App*> shown_commands(const CLI::App& command) {
  return command.get_subcommands([](const CLI::App* sub) { return !sub->get_group().empty(); });
}

std::string first_sentence(const std::string& description) {
  return description.substr(0, description.find(". "));
}

namespace {

// The commands below this one, by purpose.
std::vector<HelpSection> commands_of(const CLI::App& command) {
  std::vector<HelpSection> sections;
  for (const auto* sub : shown_commands(command)) {
    const std::string title = sub->get_group() == "Subcommands" ? "Commands" : sub->get_group();
    if (sections.empty() || sections.back().title != title) sections.push_back({title, {}});
    sections.back().entries.push_back({sub->get_name(), first_sentence(sub->get_description())});
  }
  return sections;
}

std::string lines_of(const std::vector<std::string>& examples) {
  std::string out;
  for (const auto& example : examples) out += fmt::format("  {}\n", example);
  return out;
}

}  // namespace

HelpPage help_page(const CLI::App& command) {
  HelpPage page{
      full_name(command), usage_of(command), command.get_description(), split(command.get_footer(), '\n'), {}};
  const auto add = [&page](HelpSection section) {
    if (!section.entries.empty()) page.sections.push_back(std::move(section));
  };
  for (auto& section : commands_of(command)) add(std::move(section));
  add(options_of(command, "Arguments", "Options", true));
  add(options_of(command, "Options", "Options", false));
  add(options_of(root_of(command), everywhere, everywhere, false));
  if (command.get_parent() == nullptr)
    for (const auto& section : about_the_program()) add(section);
  return page;
}

std::string help_text(const CLI::App& command) {
  const HelpPage page = help_page(command);
  std::string out = "Examples:\n" + lines_of(page.examples);
  out += fmt::format("\n{}\n\nUsage: {}{}\n", wrapped(page.description, 0), page.name, page.usage);
  for (const auto& section : page.sections) out += shown(section);
  if (!shown_commands(command).empty())
    out += fmt::format("\n`{} COMMAND --help` tells more of a command.\n", page.name);
  return out;
}

std::string overview_text(const CLI::App& program) {
  std::string out = fmt::format("{} {}: {}\n", program.get_name(), version(), program.get_description());
  for (const auto& section : commands_of(program)) out += shown(section);
  out += "\nExamples:\n" + lines_of(split(program.get_footer(), '\n'));
  return out + fmt::format("\n`{0} COMMAND --help` tells more of a command, `{0} help` more of the program.\n",
                           program.get_name());
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const {
  return help_text(*app);
}

void add_help(CLI::App& app, int& exit_code) {
  auto* command = add_command(app, "help", "Help on a command",
                              "hamelin help run\n"
                              "hamelin help scene make");
  const auto path = std::make_shared<std::vector<std::string>>();
  command->add_option("command", *path, "a command's name; none: what there is")->type_name("COMMAND...");
  command->callback([&app, path, &exit_code] {
    const CLI::App* at = &app;
    for (const auto& name : *path) at = find_command(*at, name);
    fmt::print("{}", help_text(*at));
    exit_code = 0;
  });
}

}  // namespace hamelin::app
