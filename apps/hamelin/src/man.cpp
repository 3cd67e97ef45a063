#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "help.hpp"

namespace hamelin::app {

namespace {

// Escapes text for roff, so that no line is a request and characters to be typed stay ASCII.
std::string roff(const std::string& text) {
  std::string out;
  for (const char c : text) {
    if (c == '\\')
      out += "\\e";
    else if (c == '-')
      out += "\\-";
    else if (c == '\'')
      out += "\\(aq";
    else if (c == '`')
      out += "\\(ga";
    else if (c == '^')
      out += "\\(ha";
    else if (c == '~')
      out += "\\(ti";
    else
      out += c;
  }
  return out.starts_with('.') ? "\\&" + out : out;
}

std::string upper(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char c) { return static_cast<char>(std::toupper(c)); });
  return text;
}

std::string page_name(const CLI::App& command) {
  std::string name = full_name(command);
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string manual_page(const CLI::App& command) {
  const HelpPage page = help_page(command);
  std::string out = fmt::format(".TH {} 1 \"\" \"hamelin {}\" \"hamelin manual\"\n",
                                roff(upper(page_name(command))), version());
  out += fmt::format(".SH NAME\n{} \\- {}\n", roff(page_name(command)),
                     roff(first_sentence(page.description)));
  out += fmt::format(".SH SYNOPSIS\n.B {}\n{}\n", roff(page.name), roff(page.usage.substr(1)));
  out += fmt::format(".SH DESCRIPTION\n{}\n", roff(page.description));
  out += ".SH EXAMPLES\n.nf\n";
  for (const auto& example : page.examples) out += fmt::format("{}\n", roff(example));
  out += ".fi\n";
  for (const auto& section : page.sections) {
    out += fmt::format(".SH {}\n", upper(section.title));
    for (const auto& entry : section.entries)
      out += fmt::format(".TP\n.B {}\n{}\n", roff(entry.name), roff(entry.text));
  }
  std::vector<std::string> others;
  if (command.get_parent() != nullptr) others.push_back(page_name(*command.get_parent()));
  for (const auto* sub : shown_commands(command)) others.push_back(page_name(*sub));
  out += ".SH SEE ALSO\n";
  for (std::size_t i = 0; i < others.size(); ++i)
    out += fmt::format(".BR {} (1){}\n", roff(others[i]), i + 1 < others.size() ? "," : "");
  return out;
}

void write_pages(const CLI::App& command, const std::filesystem::path& directory) {
  write_file_atomically(directory / (page_name(command) + ".1"), manual_page(command));
  for (const auto* sub : shown_commands(command)) write_pages(*sub, directory);
}

void add_man(CLI::App& app, int& exit_code) {
  auto* command = add_command(app, "man", "Write the manual pages of all commands",
                              "hamelin man share/man/man1");
  const auto directory = std::make_shared<std::filesystem::path>();
  command
      ->add_option("directory", *directory, "directory to write to, created if it does not exist")
      ->required()
      ->type_name("DIR");
  command->callback([&app, directory, &exit_code] {
    std::error_code ec;
    // A failure is reported by write_pages.
    std::filesystem::create_directories(*directory, ec);
    write_pages(app, *directory);
    exit_code = 0;
  });
}

const RegisteredCommand registered_man("man", add_man);

}  // namespace

}  // namespace hamelin::app
