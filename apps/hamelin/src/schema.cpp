#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/json.hpp"

namespace hamelin::app {

namespace {

const std::vector<std::string> names = {"robot", "scene", "primitives", "integrator", "run", "result"};

void print_schema(const std::string& name) {
  if (name.empty()) {
    fmt::print("{}\n", fmt::join(names, "\n"));
    return;
  }
  const auto text = schema_text(name);
  if (text.empty()) {
    const auto near = nearest_name(name, names);
    throw Error(ErrorCode::usage, fmt::format("schema '{}' is not known, expected {}", name,
                                              near.empty() ? fmt::format("one of {}", fmt::join(names, ", "))
                                                           : fmt::format("'{}'?", near)));
  }
  fmt::print("{}", text);
}

}  // namespace

void add_schema(CLI::App& app, int& exit_code) {
  auto* schema = add_command(app, "schema", "The JSON Schemas of all file formats", "hamelin schema print scene");
  schema->require_subcommand(1);
  auto* print = add_command(*schema, "print", "Print a schema (draft-07); without a name, their names",
                            "hamelin schema print scene");
  const auto name = std::make_shared<std::string>();
  print->add_option("name", *name, fmt::format("one of {}", fmt::join(names, ", ")))->type_name("NAME");
  print->callback([name, &exit_code] {
    print_schema(*name);
    exit_code = 0;
  });
}

}  // namespace hamelin::app
