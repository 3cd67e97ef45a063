#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <cstdlib>
#include <system_error>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::planning {

namespace fs = std::filesystem;

namespace {

std::vector<fs::path> plugin_files(const fs::path& directory) {
  std::vector<fs::path> files;
  std::error_code code;
  for (fs::directory_iterator it(directory, code), end; !code && it != end; it.increment(code)) {
    const std::string name = it->path().filename().string();
    if (name.size() > plugin_suffix.size() &&
        std::string_view(name).substr(name.size() - plugin_suffix.size()) == plugin_suffix)
      files.push_back(it->path());
  }
  std::sort(files.begin(), files.end());
  return files;
}

std::string planner_name(const fs::path& file) {
  const std::string name = file.filename().string();
  return name.substr(0, name.size() - plugin_suffix.size());
}

}  // namespace

std::vector<fs::path> plugin_directories(const std::vector<fs::path>& given,
                                         const std::vector<fs::path>& own) {
  std::vector<fs::path> all;
  const auto add = [&](const fs::path& directory) {
    if (!directory.empty() && std::find(all.begin(), all.end(), directory) == all.end())
      all.push_back(directory);
  };
  for (const auto& directory : given) add(directory);
  if (const char* variable = std::getenv("HAMELIN_PLUGIN_PATH"); variable != nullptr) {
    std::string_view rest = variable;
    while (!rest.empty()) {
      const auto colon = rest.find(':');
      add(fs::path(rest.substr(0, colon)));
      rest = colon == std::string_view::npos ? std::string_view{} : rest.substr(colon + 1);
    }
  }
  for (const auto& directory : own) add(directory);
  return all;
}

Plugin find_plugin(const std::string& name_or_path, const std::vector<fs::path>& directories) {
  return Plugin::load(find_plugin_file(name_or_path, directories));
}

fs::path find_plugin_file(const std::string& name_or_path,
                          const std::vector<fs::path>& directories) {
  const bool is_path =
      name_or_path.find('/') != std::string::npos ||
      (name_or_path.size() > plugin_suffix.size() &&
       name_or_path.substr(name_or_path.size() - plugin_suffix.size()) == plugin_suffix);
  if (is_path) return name_or_path;
  std::string searched;
  std::vector<std::string> names;
  for (const auto& directory : directories) {
    std::vector<std::string> here;
    for (const auto& file : plugin_files(directory)) {
      if (planner_name(file) == name_or_path) return file;
      here.push_back(planner_name(file));
    }
    std::error_code code;
    const std::string found = !here.empty() ? fmt::format("{}", fmt::join(here, ", "))
                              : fs::is_directory(directory, code) ? "no plugins"
                                                                  : "no such directory";
    searched += fmt::format("{}{} ({})", searched.empty() ? "" : "; ", directory.string(), found);
    names.insert(names.end(), here.begin(), here.end());
  }
  const std::string near = nearest_name(name_or_path, names);
  throw Error(
      ErrorCode::plugin,
      fmt::format("planner '{}': not found{}; searched for {}{} in: {}", name_or_path,
                  near.empty() ? "" : fmt::format(", did you mean '{}'?", near), name_or_path,
                  plugin_suffix, searched.empty() ? "no directory" : searched));
}

std::vector<ListedPlugin> list_plugins(const std::vector<fs::path>& directories) {
  std::vector<ListedPlugin> all;
  for (const auto& directory : directories) {
    for (const auto& file : plugin_files(directory)) {
      ListedPlugin listed{file, std::nullopt, {}};
      try {
        listed.plugin = Plugin::load(file);
      } catch (const Error& e) {
        listed.refusal = e.what();
      }
      all.push_back(std::move(listed));
    }
  }
  return all;
}

}  // namespace hamelin::planning
