#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::app {

namespace {

const std::vector<std::string> names = {
    "robot",   "scene",       "task",     "primitives", "integrator", "run",
    "result",  "explanation", "path",     "trajectory", "sweep",      "record",
    "summary", "comparison",  "accuracy", "problems",   "benchmark",  "archive"};

void print_schema(const std::string& name, bool json) {
  if (!name.empty())
    fmt::print("{}", schema_text(name));
  else if (json)
    print_json(names);
  else
    fmt::print("{}\n", fmt::join(names, "\n"));
}

void add_schema(CLI::App& app, int& exit_code) {
  auto* schema = add_command(app, "schema", "Print the JSON Schemas of the file formats",
                             "hamelin schema print\n"
                             "hamelin schema print scene");
  schema->require_subcommand(1);
  auto* print = add_command(
      *schema, "print", "Print the JSON Schema (draft-07) of a file format, or the names of all",
      "hamelin schema print\n"
      "hamelin schema print scene");
  const auto name = std::make_shared<std::string>();
  restrict_values(print->add_option("name", *name, "name of the file format"), names)
      ->type_name("NAME");
  const auto json = std::make_shared<bool>(false);
  print->add_flag("--json", *json, "print the names as JSON (a schema is always JSON)");
  print->callback([name, json, &exit_code] {
    print_schema(*name, *json);
    exit_code = 0;
  });
}

const RegisteredCommand registered_schema("schema", add_schema);

}  // namespace

}  // namespace hamelin::app
