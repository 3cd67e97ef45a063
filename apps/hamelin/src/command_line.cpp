#include "command_line.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>

#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/integration/options.hpp"
#include "hamelin/planning/plugin_host.hpp"
#include "help.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

std::vector<std::string>& stored_command_line() {
  static std::vector<std::string> arguments;
  return arguments;
}

// The deepest subcommand that the parser has reached.
const CLI::App* innermost(const CLI::App* app) {
  while (!app->get_subcommands().empty()) app = app->get_subcommands().back();
  return app;
}

std::vector<std::string> command_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const auto* command : shown_commands(app)) names.push_back(command->get_name());
  return names;
}

std::string did_you_mean(const std::string& name, const std::vector<std::string>& names) {
  const auto near = nearest_name(name, names);
  return near.empty() ? "" : fmt::format(", did you mean '{}'?", near);
}

std::string unknown_argument_message(const CLI::App& app, const std::string& argument) {
  const bool option = argument.starts_with("-");
  std::vector<std::string> names;
  if (option) {
    for (const CLI::App* at = &app; at != nullptr; at = at->get_parent())
      for (const auto* known : at->get_options())
        for (const auto& name : known->get_lnames()) names.push_back("--" + name);
  } else {
    names = command_names(app);
  }
  if (option &&
      std::find(names.begin(), names.end(), argument.substr(0, argument.find('='))) != names.end())
    return fmt::format("option '{}' belongs after the command", argument);
  const char* problem = option          ? "unknown option"
                        : names.empty() ? "unexpected argument"
                                        : "unknown command";
  return fmt::format("{} '{}'{}", problem, argument,
                     did_you_mean(argument.substr(0, argument.find('=')), names));
}

}  // namespace

CLI::App* add_command(CLI::App& parent, const std::string& name, const std::string& description,
                      const std::string& examples) {
  auto* command = parent.add_subcommand(name, description);
  command->footer(examples);
  command->fallthrough();
  return command;
}

namespace {

// Why `given` is refused if it is not one of `values`; empty if it is one of them.
std::string value_error(const std::string& given, const std::vector<std::string>& values) {
  if (std::find(values.begin(), values.end(), given) != values.end()) return {};
  return fmt::format("'{}' is not known, expected one of {}{}", given, fmt::join(values, ", "),
                     did_you_mean(given, values));
}

std::string in_braces(const std::vector<std::string>& values) {
  return fmt::format("{{{}}}", fmt::join(values, ","));
}

}  // namespace

CLI::Option* restrict_values(CLI::Option* option, const std::vector<std::string>& values) {
  const auto check = [values](const std::string& given) { return value_error(given, values); };
  return option->check(CLI::Validator(check, in_braces(values)));
}

CLI::Option* restrict_to_integrators(CLI::Option* option) {
  const auto check = [](const std::string& given) -> std::string {
    try {
      auto refusal =
          value_error(integration::parse_scheme_name(given).name, integration::integrator_names());
      if (refusal.empty()) (void)integration::make_options(given);
      return refusal;
    } catch (const Error& error) {
      return error.what();
    }
  };
  return option->check(CLI::Validator(check, in_braces(integration::integrator_names())))
      ->type_name("NAME[:ORDER]");
}

std::string full_name(const CLI::App& command) {
  return command.get_parent() == nullptr
             ? command.get_name()
             : full_name(*command.get_parent()) + " " + command.get_name();
}

const CLI::App* find_command(const CLI::App& parent, const std::string& name) {
  for (const auto* command : shown_commands(parent))
    if (command->get_name() == name) return command;
  if (const auto absence = absence_of(name); !absence.empty())
    throw Error(ErrorCode::usage, absence);
  throw Error(ErrorCode::usage, unknown_argument_message(parent, name));
}

std::string usage_message(const CLI::App& app, const CLI::ParseError& error) {
  const CLI::App* at = innermost(&app);
  std::string text;
  if (const auto rest = app.remaining(true); !rest.empty()) {
    text = unknown_argument_message(*at, rest.front());
  } else if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr &&
             !command_names(*at).empty()) {
    text = fmt::format("a command is missing, expected one of {}",
                       fmt::join(command_names(*at), ", "));
  } else {
    text = error.what();
    std::replace(text.begin(), text.end(), '\n', ' ');
  }
  const std::string place =
      at == &app ? "" : full_name(*at).substr(app.get_name().size() + 1) + ": ";
  return fmt::format("{}{} (see {} --help)", place, text, full_name(*at));
}

CLI::Range unsigned_range() {
  return {0L, (1L << 53) - 1L};
}

void print_json(const Json& document) {
  fmt::print("{}\n", document.dump(2, ' ', false, Json::error_handler_t::replace));
}

std::vector<double> number_list(const std::string& option, const std::string& text,
                                std::optional<std::size_t> count) {
  std::vector<double> numbers;
  for (std::size_t begin = 0; begin <= text.size();) {
    const auto end = std::min(text.find(',', begin), text.size());
    double number = 0.0;
    const char* const stop = text.data() + end;
    const auto [read_to, ec] = std::from_chars(text.data() + begin, stop, number);
    if (ec != std::errc() || read_to != stop || !std::isfinite(number))
      throw Error(ErrorCode::usage,
                  fmt::format("{}: '{}' is not a number, expected a list such as 0.1,-0.2", option,
                              text.substr(begin, end - begin)));
    numbers.push_back(number);
    begin = end + 1;
  }
  if (count && numbers.size() != *count)
    throw Error(ErrorCode::usage,
                fmt::format("{}: {} values given, expected {}", option, numbers.size(), *count));
  return numbers;
}

std::vector<std::string> command_line() {
  return stored_command_line();
}

void set_command_line(std::vector<std::string> words) {
  stored_command_line() = std::move(words);
}

int guarded(const std::function<int()>& action) {
  int exit_code = defect;
  try {
    exit_code = action();
  } catch (const Error& error) {
    error_line(error.what());
    return bad_input;
  } catch (const std::bad_alloc&) {
    error_line("out of memory");
    return bad_input;
  } catch (const std::exception& error) {
    error_line(fmt::format("internal error: {}", error.what()));
    return defect;
  }
  if (std::fflush(stdout) != 0 || std::ferror(stdout) != 0) {
    error_line("stdout: cannot be written");
    return bad_input;
  }
  return exit_code;
}

std::optional<std::filesystem::path> prefix() {
  std::error_code ec;
  const auto program = std::filesystem::read_symlink("/proc/self/exe", ec);
  if (ec) return {};
  return program.parent_path().parent_path();
}

void add_plugin_path_option(CLI::App& command, std::vector<std::filesystem::path>& directories) {
  command
      .add_option("--plugin-path", directories,
                  "directory to search first for planners; may be repeated")
      ->type_name("DIR")
      ->allow_extra_args(false);
}

std::vector<std::filesystem::path> plugin_path(const std::vector<std::filesystem::path>& given) {
  std::vector<std::filesystem::path> own;
  if (const auto base = prefix()) {
    own.push_back(*base / "lib" / "hamelin" / "plugins");
    if (std::string(HAMELIN_LIBDIR) != "lib")
      own.push_back(*base / HAMELIN_LIBDIR / "hamelin" / "plugins");
  }
  auto directories = planning::plugin_directories(given, own);
  std::string list;
  for (const auto& directory : directories) list += (list.empty() ? "" : ", ") + directory.string();
  detail(fmt::format("searching for planners in {}", list));
  return directories;
}

}  // namespace hamelin::app
