#include "command_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/core/json.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::app {

namespace {

std::vector<std::string>& stored_command_line() {
  static std::vector<std::string> arguments;
  return arguments;
}

// The subcommand that was being read.
const CLI::App* innermost(const CLI::App* app) {
  while (!app->get_subcommands().empty()) app = app->get_subcommands().back();
  return app;
}

std::string full_name(const CLI::App* app) {
  return app->get_parent() == nullptr ? app->get_name() : full_name(app->get_parent()) + " " + app->get_name();
}

std::vector<std::string> command_names(const CLI::App* app) {
  std::vector<std::string> names;
  for (const auto* command : app->get_subcommands({})) names.push_back(command->get_name());
  return names;
}

std::string unknown(const CLI::App* app, const std::string& argument) {
  const bool option = argument.starts_with("-");
  std::vector<std::string> names;
  if (option) {
    for (const auto* known : app->get_options())
      for (const auto& name : known->get_lnames()) names.push_back("--" + name);
  } else {
    names = command_names(app);
  }
  const auto near = nearest_name(argument.substr(0, argument.find('=')), names);
  const std::string hint = near.empty() ? "" : fmt::format(", did you mean '{}'?", near);
  const char* what = option ? "unknown option" : names.empty() ? "unexpected argument" : "unknown command";
  return fmt::format("{} '{}'{}", what, argument, hint);
}

}  // namespace

HelpFormatter::HelpFormatter() {
  column_width(36);
}

std::string HelpFormatter::make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const {
  if (mode == CLI::AppFormatMode::Sub) return make_expanded(app);
  return fmt::format("Example:\n  {}\n\n{}{}{}{}{}", app->get_footer(), make_description(app), make_usage(app, name),
                     make_positionals(app), make_groups(app, mode), make_subcommands(app, mode));
}

CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& example) {
  auto* command = parent.add_subcommand(name, description);
  command->footer(example);
  return command;
}

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* at = innermost(&app);
  std::string text;
  if (const auto rest = app.remaining(true); !rest.empty()) {
    text = unknown(at, rest.front());
  } else if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr && !command_names(at).empty()) {
    text = fmt::format("a command is missing, expected one of {}", fmt::join(command_names(at), ", "));
  } else {
    text = error.what();
    std::replace(text.begin(), text.end(), '\n', ' ');
  }
  const std::string place = at == &app ? "" : full_name(at).substr(app.get_name().size() + 1) + ": ";
  return fmt::format("{}{} (see {} --help)", place, text, full_name(at));
}

CLI::Range whole_number() {
  return {0L, (1L << 53) - 1L};
}

std::vector<double> number_list(const std::string& option, const std::string& text, std::optional<std::size_t> count) {
  std::vector<double> numbers;
  for (std::size_t begin = 0; begin <= text.size();) {
    const auto end = std::min(text.find(',', begin), text.size());
    double number = 0.0;
    const char* const stop = text.data() + end;
    const auto [read_to, ec] = std::from_chars(text.data() + begin, stop, number);
    if (ec != std::errc() || read_to != stop || !std::isfinite(number))
      throw Error(ErrorCode::usage, fmt::format("{}: '{}' is no number, expected a list as 0.1,-0.2", option,
                                                text.substr(begin, end - begin)));
    numbers.push_back(number);
    begin = end + 1;
  }
  if (count && numbers.size() != *count)
    throw Error(ErrorCode::usage, fmt::format("{}: {} numbers given, expected {}", option, numbers.size(), *count));
  return numbers;
}

std::vector<std::string> command_line() {
  return stored_command_line();
}

void set_command_line(int argc, char** argv) {
  stored_command_line().assign(argv, argv + argc);
}

std::vector<std::filesystem::path> plugin_path(const std::vector<std::filesystem::path>& given) {
  std::vector<std::filesystem::path> own;
  std::error_code ec;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ec);
  if (!ec) {
    const auto prefix = program.parent_path().parent_path();
    own.push_back(prefix / "lib" / "hamelin" / "plugins");
    if (std::string(HAMELIN_LIBDIR) != "lib") own.push_back(prefix / HAMELIN_LIBDIR / "hamelin" / "plugins");
  }
  return planning::plugin_directories(given, own);
}

}  // namespace hamelin::app
