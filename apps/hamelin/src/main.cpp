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

using namespace hamelin::app;

void add_global_options(CLI::App& app) {
  app.set_help_flag("-h,--help", "print this help")->group(global_options);
  app.set_version_flag("--version", std::string(hamelin::version()), "print the version")
      ->group(global_options);
  auto* quiet = app.add_flag_callback(
      "-q,--quiet", [] { set_verbosity(Verbosity::quiet); },
      "print errors and requested data only: no notes, progress or reports");
  auto* verbose = app.add_flag_callback(
      "-v,--verbose", [] { set_verbosity(Verbosity::verbose); },
      "also print which files are read, where planners are searched for and how long each phase "
      "takes");
  quiet->group(global_options);
  verbose->group(global_options)->excludes(quiet);
  app.add_flag_callback("--no-color", set_no_colour, "disable colour")->group(global_options);
}

// HAMELIN_ISA is read only here. Libraries take the instruction set as an argument or use the
// default.
void apply_environment() {
  const char* name = std::getenv("HAMELIN_ISA");
  if (name != nullptr && *name != '\0')
    hamelin::set_default_isa(hamelin::isa_from_name(name, "HAMELIN_ISA"));
}

int run_command_line(int argc, char** argv) {
  apply_environment();
  set_command_line({argv, argv + argc});
  const Phase phase("total");
  int exit_code = 0;
  CLI::App app("Move robot arms through cluttered OctoMap scenes and integrate their motion",
               "hamelin");
  app.formatter(std::make_shared<HelpFormatter>());
  app.footer(
      "hamelin run data/scenes/shelf.json\n"
      "hamelin scene info data/scenes/shelf.json\n"
      "hamelin help run");
  add_global_options(app);
  app.require_subcommand(1);
  add_commands(app, exit_code);
  if (argc == 1) {
    fmt::print("{}", overview_text(app));
    return 0;
  }
  try {
    app.parse(argc, argv);
  } catch (const CLI::Success& request) {  // --help, --version
    return app.exit(request);
  } catch (const CLI::ParseError& error) {
    error_line(usage_message(app, error));
    return bad_input;
  }
  return exit_code;
}

}  // namespace

int main(int argc, char** argv) {
  return guarded([&] { return run_command_line(argc, argv); });
}
