#include <fmt/format.h>

#include <map>
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

/// A file of an archive: where it is, and its SHA-256 in the plan.
struct Content {
  fs::path place;
  std::string sha256;
};

/// The files of an archive, by their paths in it.
struct Contents {
  fs::path plan;
  std::map<std::string, Content> files;
};

Contents contents_of(const Plan& plan, const fs::path& directory) {
  // The system resolves ".." of a relative path from the real place of the directory.
  const fs::path base = fs::canonical(directory);
  std::map<fs::path, std::string> files{{plan_file(base), plan.sha256}};
  for (const auto& scene : plan.scenes)
    files.emplace((base / scene.file).lexically_normal(), scene.sha256);
  for (const auto& input : plan.inputs)
    files.emplace((base / input.file).lexically_normal(), input.sha256);
  fs::path common = base;
  for (const auto& [file, sha256] : files)
    while (file.lexically_relative(common).native().starts_with(".."))
      common = common.parent_path();
  Contents contents{plan_file(base).lexically_relative(common), {}};
  for (const auto& [file, sha256] : files)
    contents.files[file.lexically_relative(common).generic_string()] = {file, sha256};
  return contents;
}

Json manifest_of(const Contents& contents) {
  Json files = Json::array();
  for (const auto& [name, file] : contents.files)
    files.push_back(
        {{"file", name}, {"sha256", file.sha256}, {"bytes", fs::file_size(file.place)}});
  return {{"schema", "hamelin.archive/1"},
          {"plan", contents.plan.generic_string()},
          {"files", std::move(files)}};
}

}  // namespace

Archived pack(const fs::path& directory, const fs::path& file) {
  const Plan plan = read_plan(directory);
  refuse_what_stays_here(plan, directory);
  const Contents contents = contents_of(plan, directory);
  TarWriter out(file);
  out.add(manifest_name, manifest_of(contents).dump(1) + "\n");
  for (const auto& [name, content] : contents.files)
    out.add(name, read_planned_file(content.place, content.sha256));
  out.commit();
  return {contents.plan.parent_path(), contents.files.size()};
}

}  // namespace hamelin::sweep
