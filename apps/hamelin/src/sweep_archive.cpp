#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/archive.hpp"
#include "output.hpp"
#include "sweep.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

namespace fs = std::filesystem;

struct ArchiveOptions {
  fs::path input, output;
  bool json = false;
};

void show(const ArchiveOptions& options, const fs::path& place, const sweep::Archived& archived,
          const Json& more) {
  if (!options.json) {
    report(fmt::format("{}: {} files, the sweep is in {}\n", options.output.string(),
                       archived.files, place.string()));
    return;
  }
  Json document{
      {"file", options.output.string()}, {"directory", place.string()}, {"files", archived.files}};
  document.update(more);
  print_json(document);
}

int sweep_pack(const ArchiveOptions& options) {
  const fs::path output = output_target(options.output, {});
  const sweep::Archived archived = sweep::pack(options.input, output);
  show(options, archived.directory, archived, {{"sha256", sha256_of_file(output)}});
  return 0;
}

int sweep_unpack(const ArchiveOptions& options) {
  const sweep::Archived archived = sweep::unpack(options.input, options.output);
  show(options, options.output / archived.directory, archived, Json::object());
  return 0;
}

}  // namespace

void add_sweep_pack(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "pack",
      "Write a planned sweep and all files that its runs read into one archive, with hashes, for "
      "machines that do not share a file system",
      "hamelin sweep pack tries -o tries.tar.zst\n"
      "hamelin sweep pack tries -o tries.tar.zst --json");
  const auto options = std::make_shared<ArchiveOptions>();
  command->add_option("directory", options->input, "directory written by `hamelin sweep plan`")
      ->required()
      ->type_name("DIR");
  command->add_option("-o,--output", options->output, "archive to write")
      ->required()
      ->type_name("FILE.tar.zst");
  command->add_flag("--json", options->json, "print a summary as JSON");
  command->callback([options, &exit_code] { exit_code = sweep_pack(*options); });
}

void add_sweep_unpack(CLI::App& sweep, int& exit_code) {
  auto* command = add_command(
      sweep, "unpack", "Unpack an archive of `hamelin sweep pack` into a new folder, and check it",
      "hamelin sweep unpack tries.tar.zst -o work\n"
      "hamelin sweep unpack tries.tar.zst -o work --json");
  const auto options = std::make_shared<ArchiveOptions>();
  command->add_option("archive", options->input, "archive written by `hamelin sweep pack`")
      ->required()
      ->type_name("FILE.tar.zst");
  command->add_option("-o,--output", options->output, "folder to make")
      ->required()
      ->type_name("DIR");
  command->add_flag("--json", options->json, "print a summary as JSON");
  command->callback([options, &exit_code] { exit_code = sweep_unpack(*options); });
}

}  // namespace hamelin::app
