#pragma once
#include <CLI/CLI.hpp>
#include <filesystem>
#include <functional>
#include <optional>

#include "hamelin/simulation/run.hpp"

/// Shared by `run`, `integrate` and `replay`: --every, --log, --result, --json.
namespace hamelin::app {

struct RecordOptions {
  long every = 1;
  std::optional<std::filesystem::path> log, result;
  bool json = false;
};

void add_record_options(CLI::App& command, RecordOptions& options);

/// Checks the output paths, runs the simulation, writes the result and prints it.
/// @param inputs the files that the run depends on; outputs must not replace them
/// @return the exit code of the outcome
[[nodiscard]] int record(const RecordOptions& options,
                         const std::vector<std::filesystem::path>& inputs,
                         const std::function<log::Result(const simulation::Watch&)>& simulate);

}  // namespace hamelin::app
