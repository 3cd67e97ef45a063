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
// A longer list of values is moved from the placeholder to the text.
constexpr std::size_t longest_value_list = 24;

const std::vector<HelpSection>& program_sections() {
  static const std::vector<HelpSection> sections{
      {"Exit codes",
       {{"0", "success; the goal was reached"},
        {"1", "ran, but the goal was not reached or a check failed"},
        {"2",
         "bad input or usage, a refused plugin, an output that cannot be written, a start in "
         "contact"},
        {"3",
         "diverged, or an internal check failed: unconverged step, energy account, planner's "
         "answer"},
        {"130", "interrupted; log and result up to then are written"}}},
      {"Environment",
       {{"HAMELIN_PLUGIN_PATH", "colon-separated list of directories to search for planners"},
        {"HAMELIN_ISA",
         "instruction set to use: x86-64, v3 (AVX2) or v4 (AVX-512) (default the best available)"},
        {"NO_COLOR, TERM=dumb",
         "disable colour, like --no-color; TERM=dumb also disables the progress line"}}}};
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
  if (!values.empty() && !in_place)
    entry.text += fmt::format("; one of {}", fmt::join(values, ", "));
  if (!option.get_default_str().empty())
    entry.text += fmt::format(" (default {})", option.get_default_str());
  if (option.get_required() && !option.get_positional()) entry.text += " (required)";
  return entry;
}

std::string usage_of(const CLI::App& command) {
  std::string usage;
  if (!command.get_subcommands({}).empty()) usage += " COMMAND";
  for (const auto* option : command.get_options()) {
    if (option->get_positional())
      usage += option->get_required() ? " " + entry_of(*option).name
                                      : fmt::format(" [{}]", entry_of(*option).name);
    else if (option->get_required())
      usage += fmt::format(" {} {}", names_of(*option).front(), placeholder(*option));
  }
  return usage + " [OPTIONS]";
}

// Each command has its own --help option; help shows only that of the program.
bool is_inherited_help(const CLI::Option& option, const CLI::App& command) {
  return command.get_parent() != nullptr && &option == command.get_help_ptr();
}

// The options of one group; hidden options have no group.
HelpSection options_of(const CLI::App& command, const std::string& title, const std::string& group,
                       bool positional) {
  HelpSection section{title, {}};
  for (const auto* option : command.get_options())
    if (option->get_group() == group && option->get_positional() == positional &&
        !is_inherited_help(*option, command))
      section.entries.push_back(entry_of(*option));
  return section;
}

std::string section_text(const HelpSection& section) {
  std::string out = fmt::format("\n{}:\n", section.title);
  for (const auto& entry : section.entries) {
    const std::string name = "  " + entry.name;
    out += name.size() + 2 <= indent ? fmt::format("{:<{}}", name, indent)
                                     : name + "\n" + std::string(indent, ' ');
    out += wrapped(entry.text, indent) + "\n";
  }
  return out;
}

const CLI::App& root_of(const CLI::App& command) {
  return command.get_parent() == nullptr ? command : root_of(*command.get_parent());
}

}  // namespace

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

std::string placeholder(const CLI::Option& option) {
  const std::string type = option.get_type_name();
  const auto bracket = type.find('[');
  const auto from = bracket < type.find(':') ? type.find(']', bracket) : 0;  // as in NAME[:ORDER]
  return type.substr(0, type.find(':', from));
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

// The subcommands of a command, in their groups.
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
  HelpPage page{full_name(command),
                usage_of(command),
                command.get_description(),
                split(command.get_footer(), '\n'),
                {}};
  const auto add = [&page](HelpSection section) {
    if (!section.entries.empty()) page.sections.push_back(std::move(section));
  };
  for (auto& section : commands_of(command)) add(std::move(section));
  add(options_of(command, "Arguments", "Options", true));
  add(options_of(command, "Options", "Options", false));
  add(options_of(root_of(command), global_options, global_options, false));
  if (command.get_parent() == nullptr)
    for (const auto& section : program_sections()) add(section);
  return page;
}

std::string help_text(const CLI::App& command) {
  const HelpPage page = help_page(command);
  std::string out = "Examples:\n" + lines_of(page.examples);
  out += fmt::format("\n{}\n\nUsage: {}{}\n", wrapped(page.description, 0), page.name, page.usage);
  for (const auto& section : page.sections) out += section_text(section);
  if (!shown_commands(command).empty())
    out += fmt::format("\nRun `{} COMMAND --help` for help on a command.\n", page.name);
  return out;
}

std::string overview_text(const CLI::App& program) {
  std::string out =
      fmt::format("{} {}: {}\n", program.get_name(), version(), program.get_description());
  for (const auto& section : commands_of(program)) out += section_text(section);
  out += "\nExamples:\n" + lines_of(split(program.get_footer(), '\n'));
  return out + fmt::format(
                   "\nRun `{0} COMMAND --help` for help on a command, or `{0} help` for help on "
                   "the program.\n",
                   program.get_name());
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string, CLI::AppFormatMode) const {
  return help_text(*app);
}

namespace {

void add_help(CLI::App& app, int& exit_code) {
  auto* command = add_command(app, "help", "Print help on a command, or on the program",
                              "hamelin help run\n"
                              "hamelin help scene make");
  const auto path = std::make_shared<std::vector<std::string>>();
  command->add_option("command", *path, "command to explain (default: the program)")
      ->type_name("COMMAND...");
  command->callback([&app, path, &exit_code] {
    const CLI::App* at = &app;
    for (const auto& name : *path) at = find_command(*at, name);
    fmt::print("{}", help_text(*at));
    exit_code = 0;
  });
}

const RegisteredCommand registered_help("help", add_help);

}  // namespace

}  // namespace hamelin::app
