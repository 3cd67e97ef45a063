#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "help.hpp"

namespace hamelin::app {

namespace {

// The fixed part of the script, before the generated cases: how each kind of word is completed.
// $cur is the word that is being typed.
constexpr const char* beginning =
    R"bash(# Completion of hamelin in bash, written by `hamelin completion bash`; requires only bash.

_hamelin_words() {
  mapfile -t COMPREPLY < <(compgen -W "$*" -- "$cur")
}

# Directories, and files whose extension is one of the arguments; without arguments, all files.
_hamelin_files() {
  local file extension
  compopt -o filenames 2>/dev/null
  while IFS= read -r file; do
    if [[ -d $file || $# -eq 0 ]]; then
      COMPREPLY+=("$file")
      continue
    fi
    for extension; do
      if [[ $file == *."$extension" ]]; then COMPREPLY+=("$file"); fi
    done
  done < <(compgen -f -- "$cur")
}

_hamelin_directories() {
  compopt -o filenames 2>/dev/null
  mapfile -t COMPREPLY < <(compgen -d -- "$cur")
}

# Names of the plugins found, or the path of one.
_hamelin_planners() {
  if [[ $cur == */* ]]; then
    _hamelin_files so
  else
    _hamelin_words "$("${COMP_WORDS[0]}" plugins list 2>/dev/null | sed -n 's/^\([^ :]*\) [^ ]*: .*/\1/p')"
  fi
}

_hamelin() {
  local cur="${COMP_WORDS[COMP_CWORD]}" at="" last="" i
  COMPREPLY=()
  # Bash splits --option=value at the equals sign.
  if [[ $cur == = ]]; then cur=""; fi
  for ((i = 1; i < COMP_CWORD; ++i)); do
    if [[ ${COMP_WORDS[i]} != = ]]; then last="${COMP_WORDS[i]}"; fi
    case "$at ${COMP_WORDS[i]}" in
)bash";

// The shell function that offers values for an option; empty for numbers and free names.
std::string completer_of(const CLI::Option& option) {
  static const std::map<std::string, const char*> known{
      {"DIR", "_hamelin_directories"},
      {"NAME|PATH", "_hamelin_planners"},
      {"FILE", "_hamelin_files"},
      {"LOG", "_hamelin_files jsonl zst"},
      {"SCENE_OR_ROBOT", "_hamelin_files json urdf"},
      {"MAP_OR_SCENE", "_hamelin_files bt ot json"}};
  if (const auto values = values_of(option); !values.empty())
    return fmt::format("_hamelin_words {}", fmt::join(values, " "));
  std::string name = placeholder(option);
  if (name.ends_with("...")) name.resize(name.size() - 3);
  if (const auto at = known.find(name); at != known.end()) return at->second;
  const auto dot = name.find('.');
  const bool file =
      dot != std::string::npos &&
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyz", dot + 1) == std::string::npos &&
      dot + 1 < name.size();
  return file ? "_hamelin_files " + name.substr(dot + 1) : "";
}

// The path to a command, e.g. " scene info".
std::string path_to(const CLI::App& command) {
  return command.get_parent() == nullptr
             ? ""
             : path_to(*command.get_parent()) + " " + command.get_name();
}

// Calls `visit` for the program itself, then for each command that help shows.
template <typename Visit>
void walk(const CLI::App& command, const Visit& visit) {
  visit(command);
  for (const auto* sub : shown_commands(command)) walk(*sub, visit);
}

// The generated `case` lines: paths of commands, values of options, options and operands.
struct Cases {
  std::string paths, values, options, operands;
};

void add_cases(const CLI::App& command, const CLI::App& root, Cases& cases) {
  const std::string path = path_to(command);
  if (path == " help") {  // the words after it are completed as if it were absent
    cases.paths += "      \" help\") at=\"\" ;;\n";
    return;
  }
  if (!path.empty()) cases.paths += fmt::format("      \"{}\") at=\"{}\" ;;\n", path, path);

  std::vector<std::string> options, words;
  for (const CLI::App* owner : {&command, &root})
    for (const auto* option : owner->get_options())
      for (const auto& name : names_of(*option))
        if (std::find(options.begin(), options.end(), name) == options.end())
          options.push_back(name);
  cases.options +=
      fmt::format("      \"{}\") _hamelin_words {} ;;\n", path, fmt::join(options, " "));

  for (const auto* sub : shown_commands(command)) words.push_back(sub->get_name());
  std::string operand =
      words.empty() ? "" : fmt::format("_hamelin_words {}", fmt::join(words, " "));
  for (const auto* option : command.get_options()) {
    const std::string completer = completer_of(*option);
    if (option->get_positional()) {
      if (operand.empty()) operand = completer;
    } else if (!placeholder(*option).empty()) {
      std::vector<std::string> patterns;
      for (const auto& name : names_of(*option))
        patterns.push_back(fmt::format("\"{} {}\"", path, name));
      cases.values += fmt::format("    {}) {}return ;;\n", fmt::join(patterns, " | "),
                                  completer.empty() ? "" : completer + "; ");
    }
  }
  if (!operand.empty()) cases.operands += fmt::format("      \"{}\") {} ;;\n", path, operand);
}

std::string bash_script(const CLI::App& root) {
  Cases cases;
  walk(root, [&](const CLI::App& command) { add_cases(command, root, cases); });
  return fmt::format(
      "{}{}    esac\n  done\n"
      "  case \"$at $last\" in\n{}  esac\n"
      "  if [[ $cur == -* ]]; then\n    case \"$at\" in\n{}    esac\n"
      "  else\n    case \"$at\" in\n{}    esac\n  fi\n}}\n\n"
      "complete -F _hamelin hamelin\n",
      beginning, cases.paths, cases.values, cases.options, cases.operands);
}

void add_completion(CLI::App& app, int& exit_code) {
  auto* completion = add_command(
      app, "completion", "Print a shell completion script for commands, options and file names",
      "source <(hamelin completion bash)\n"
      "hamelin completion bash > ~/.local/share/bash-completion/completions/hamelin");
  const auto shell = std::make_shared<std::string>();
  restrict_values(completion->add_option("shell", *shell, "shell to complete for"), {"bash"})
      ->required()
      ->type_name("SHELL");
  completion->callback([&app, shell, &exit_code] {  // the option writes to `shell`
    fmt::print("{}", bash_script(app));
    exit_code = 0;
  });
}

const RegisteredCommand registered_completion("completion", add_completion);

}  // namespace

}  // namespace hamelin::app
