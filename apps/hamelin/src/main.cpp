#include <fmt/format.h>

#include <cstdio>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "terminal.hpp"

namespace {

constexpr int bad_input = 2, defect = 3;

int run_command_line(int argc, char** argv) {
  using namespace hamelin::app;
  set_command_line(argc, argv);
  int exit_code = 0;
  CLI::App app("Moves robot arms through cluttered OctoMap scenes and integrates their motion.", "hamelin");
  app.formatter(std::make_shared<HelpFormatter>());
  app.footer("hamelin run data/scenes/shelf.json");
  app.set_version_flag("--version", std::string(hamelin::version()), "print the version");
  app.require_subcommand(1);
  for (const auto add :
       {add_run, add_integrate, add_robot, add_scene, add_sweep, add_plugins, add_validate, add_schema})
    add(app, exit_code);
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
  using hamelin::app::error_line;
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
