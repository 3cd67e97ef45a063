#include <fmt/format.h>

#include <cstdio>
#include <cstdlib>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "help.hpp"
#include "terminal.hpp"

namespace {

constexpr int bad_input = 2, defect = 3;

using namespace hamelin::app;

// The commands by purpose, in the order in which help shows them.
struct Purpose {
  const char* title;
  std::vector<void (*)(CLI::App&, int&)> add;
};

const std::vector<Purpose>& commands() {
  static const std::vector<Purpose> all{
      {"Run things", {add_run, add_integrate, add_accuracy, add_replay, add_sweep}},
      {"Look at things", {add_report, add_robot, add_scene, add_plugins}},
      {"Files", {add_export, add_validate, add_schema}},
      {"Help", {add_help, add_completion}},
      {"", {add_man}},
  };
  return all;
}

void add_everywhere(CLI::App& app) {
  app.set_help_flag("-h,--help", "print this help")->group(everywhere);
  app.set_version_flag("--version", std::string(hamelin::version()), "print the version")->group(everywhere);
  auto* quiet = app.add_flag_callback(
      "-q,--quiet", [] { set_loudness(Loudness::quiet); },
      "errors only: no notes, progress or report of what was done");
  auto* verbose = app.add_flag_callback(
      "-v,--verbose", [] { set_loudness(Loudness::verbose); },
      "also say what is read, where planners are looked for and what takes how long");
  quiet->group(everywhere);
  verbose->group(everywhere)->excludes(quiet);
  app.add_flag_callback("--no-color", set_no_colour, "no colour")->group(everywhere);
}

// The environment is read here and nowhere else; libraries take the instruction set as an argument or a default.
void take_environment() {
  const char* asked = std::getenv("HAMELIN_ISA");
  if (asked != nullptr && *asked != '\0') hamelin::set_default_isa(hamelin::isa_from_name(asked, "HAMELIN_ISA"));
}

int run_command_line(int argc, char** argv) {
  take_environment();
  set_command_line(argc, argv);
  const Phase phase("in all");
  int exit_code = 0;
  CLI::App app("Moves robot arms through cluttered OctoMap scenes and integrates their motion", "hamelin");
  app.formatter(std::make_shared<HelpFormatter>());
  app.footer(
      "hamelin run data/scenes/shelf.json\n"
      "hamelin scene info data/scenes/shelf.json\n"
      "hamelin help run");
  add_everywhere(app);
  app.require_subcommand(1);
  for (const auto& purpose : commands())
    for (const auto add : purpose.add) {
      add(app, exit_code);
      app.get_subcommands({}).back()->group(purpose.title);
    }
  if (argc == 1) {
    fmt::print("{}", overview_text(app));
    return 0;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& asked) {  // --help, --version
    return app.exit(asked);
  } catch (const CLI::ParseError& error) {
    error_line(usage_message(app, error));
    return bad_input;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  int exit_code = defect;
  try {
    exit_code = run_command_line(argc, argv);
  } catch (const hamelin::Error& error) {
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
