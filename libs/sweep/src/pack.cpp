#include <fmt/format.h>

#include <map>
#include <set>
#include <string>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/sweep/archive.hpp"
#include "hamelin/sweep/plan.hpp"
#include "tar.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// Refuses the absolute path of a file, which another machine would not have.
void refuse_absolute_path(const fs::path& path, const std::string& where) {
  std::error_code ec;
  if (path.is_absolute() && fs::exists(path, ec))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: names the absolute path '{}', expected a path relative to the "
                            "scene, which an archive can keep",
                            where, path.string()));
}

void refuse_absolute_paths(const Json& value, const std::string& where) {
  if (value.is_string()) refuse_absolute_path(value.get<std::string>(), where);
  if (value.is_structured())
    for (const Json& member : value) refuse_absolute_paths(member, where);
}

void refuse_what_stays_here(const Plan& plan, const fs::path& directory) {
  for (const auto& plugin : plan.plugins)
    if (plugin.name.find('/') != std::string::npos)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: planner '{}' is named by its path, expected a name that each "
                              "machine finds with --plugin-path",
                              plan_file(directory).string(), plugin.name));
  for (const auto& run : plan.runs)
    for (const auto& assignment : run.set) {
      std::string value = assignment.substr(assignment.find('=') + 1);
      std::erase(value, '"');  // a string may be quoted as in JSON
      refuse_absolute_path(value, fmt::format("run '{}'", run.id));
    }
  for (const auto& scene : plan.scenes) {
    const fs::path file = resolve_path(directory, scene.file);
    refuse_absolute_paths(read_json(file), file.string());
  }
}

/// The files of an archive, by their paths in it, and where they are.
struct Contents {
  fs::path plan;
  std::map<std::string, fs::path> files;
};

Contents contents_of(const Plan& plan, const fs::path& directory) {
  // The system resolves ".." of a relative path from the real place of the directory.
  const fs::path base = fs::canonical(directory);
  std::set<fs::path> files{plan_file(base)};
  for (const auto& scene : plan.scenes) files.insert((base / scene.file).lexically_normal());
  for (const auto& input : plan.inputs) files.insert((base / input.file).lexically_normal());
  fs::path common = base;
  for (const auto& file : files)
    while (file.lexically_relative(common).native().starts_with(".."))
      common = common.parent_path();
  Contents contents{plan_file(base).lexically_relative(common), {}};
  for (const auto& file : files)
    contents.files[file.lexically_relative(common).generic_string()] = file;
  return contents;
}

}  // namespace

Archived pack(const fs::path& directory, const fs::path& file) {
  const Plan plan = read_plan(directory);
  std::vector<const PlannedRun*> runs;
  for (const auto& run : plan.runs) runs.push_back(&run);
  check_files(plan, directory, runs);
  refuse_what_stays_here(plan, directory);
  const Contents contents = contents_of(plan, directory);
  Json manifest{{"schema", "hamelin.archive/1"},
                {"plan", contents.plan.generic_string()},
                {"files", Json::array()}};
  for (const auto& [name, place] : contents.files)
    manifest["files"].push_back(
        {{"file", name}, {"sha256", sha256_of_file(place)}, {"bytes", fs::file_size(place)}});
  const fs::path temporary = file.string() + ".part";
  try {
    TarWriter out(temporary);
    out.add(manifest_name, manifest.dump(1) + "\n");
    for (const auto& [name, place] : contents.files) out.add(name, read_file(place));
    out.close();
    fs::rename(temporary, file);
  } catch (...) {
    std::error_code ec;
    fs::remove(temporary, ec);
    throw;
  }
  return {contents.plan.parent_path(), contents.files.size()};
}

}  // namespace hamelin::sweep
