#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <string_view>
#include <system_error>
#include <utility>

#include "hamelin/core/error.hpp"
#include "plugin_library.hpp"

namespace hamelin::planning {

namespace fs = std::filesystem;

namespace {

[[noreturn]] void refuse(const fs::path& file, std::string_view reason) {
  throw Error(ErrorCode::plugin, fmt::format("{}: {}", file.string(), reason));
}

// The loader's message begins with the file's name, which the caller's message has already.
std::string system_reason(const fs::path& file) {
  const char* raw = dlerror();
  std::string text = raw != nullptr ? raw : "unknown reason";
  const std::string prefix = file.string() + ": ";
  if (text.compare(0, prefix.size(), prefix) == 0) text.erase(0, prefix.size());
  return text;
}

// JSON Schema accepts unknown keys by default, but a mistyped parameter must be an error.
void forbid_unknown_keys(Json& schema) {
  if (!schema.is_object() || !schema.contains("properties") || !schema["properties"].is_object())
    return;
  schema["additionalProperties"] = false;
  for (auto& [key, rule] : schema["properties"].items()) forbid_unknown_keys(rule);
}

// The versions come first, because the meaning of the other fields depends on them. Before version
// 4 a plugin stated one version only, where its struct now has the newest.
void check_versions(const fs::path& path, const hamelin_plugin& raw) {
  constexpr std::uint32_t newest = HAMELIN_PLUGIN_ABI_VERSION,
                          oldest = HAMELIN_PLUGIN_ABI_VERSION_MIN;
  const auto range = [](std::uint32_t from, std::uint32_t to) {
    return from == to ? fmt::format("{}", to) : fmt::format("{} to {}", from, to);
  };
  if (raw.abi_version < oldest)
    refuse(path, fmt::format("built for version {} of the plugin interface, expected {}; rebuild "
                             "it with this version's headers",
                             raw.abi_version, range(oldest, newest)));
  if (raw.abi_version_min > newest)
    refuse(path, fmt::format("needs version {} of the plugin interface, expected {}; it needs a "
                             "later hamelin",
                             range(raw.abi_version_min, raw.abi_version), range(oldest, newest)));
  if (!HAMELIN_HAS_FIELD(&raw, hamelin_plugin, world_changed))
    refuse(path, fmt::format("hamelin_plugin has {} bytes, expected at least {}", raw.struct_size,
                             sizeof(hamelin_plugin)));
}

}  // namespace

Plugin::Library::Library(fs::path path)
    : file(std::move(path)), handle(dlopen(file.c_str(), RTLD_NOW | RTLD_LOCAL)) {
  if (handle == nullptr) refuse(file, fmt::format("cannot be loaded: {}", system_reason(file)));
}

Plugin::Library::~Library() {
#ifndef HAMELIN_SANITIZED  // the sanitizers' reports need the symbols of the library
  if (handle != nullptr) dlclose(handle);
#endif
}

Plugin Plugin::load(const fs::path& file) {
  std::error_code code;
  const fs::path path = fs::absolute(file, code);
  if (code || !fs::exists(path, code)) refuse(file, "no such file, expected a planner plugin");
  if (!fs::is_regular_file(path, code))
    refuse(path, "not a regular file, expected a planner plugin");
  const auto library = std::make_shared<Library>(path);

  void* symbol = dlsym(library->handle, HAMELIN_PLUGIN_ENTRY_NAME);
  if (symbol == nullptr)
    refuse(path, fmt::format("no symbol {}, expected a planner plugin", HAMELIN_PLUGIN_ENTRY_NAME));
  // POSIX guarantees that a void* can hold the address of a function.
  const auto* raw = reinterpret_cast<hamelin_plugin_entry_fn>(symbol)();
  if (raw == nullptr) refuse(path, fmt::format("{} returned null", HAMELIN_PLUGIN_ENTRY_NAME));
  check_versions(path, *raw);
  using Required = std::pair<const char*, bool>;
  for (const auto& [function, present] :
       {Required{"create", raw->create != nullptr}, Required{"tick", raw->tick != nullptr},
        Required{"destroy", raw->destroy != nullptr},
        Required{"apply_params", raw->apply_params != nullptr || raw->prepare_params == nullptr},
        Required{"free_params", raw->free_params != nullptr || raw->prepare_params == nullptr}})
    if (!present) refuse(path, fmt::format("function '{}' is null", function));
  if (raw->name == nullptr || *raw->name == '\0') refuse(path, "the plugin has no name");
  const auto text = [](const char* string) {
    std::string line = string != nullptr ? string : "";
    std::replace(line.begin(), line.end(), '\n', ' ');
    return line;
  };
  library->raw = raw;
  library->name = text(raw->name);
  library->version = text(raw->version);
  library->description = text(raw->description);
  try {
    library->params_schema =
        parse_json(raw->params_schema != nullptr ? raw->params_schema : "", "parameter schema");
  } catch (const Error& e) {
    refuse(path, e.what());
  }
  if (!library->params_schema.is_object()) refuse(path, "parameter schema: not a JSON object");
  forbid_unknown_keys(library->params_schema);
  return Plugin(library);
}

const fs::path& Plugin::file() const noexcept {
  return library_->file;
}
const std::string& Plugin::name() const noexcept {
  return library_->name;
}
const std::string& Plugin::version() const noexcept {
  return library_->version;
}
const std::string& Plugin::description() const noexcept {
  return library_->description;
}
const Json& Plugin::params_schema() const noexcept {
  return library_->params_schema;
}

std::vector<std::string> Plugin::file_params() const {
  std::vector<std::string> names;
  const Json properties = params_schema().value("properties", Json::object());
  for (const auto& [name, rule] : properties.items())
    if (rule.is_object() && rule.value("input_file", Json()) == true) names.push_back(name);
  return names;
}

bool Plugin::tick_allocates() const noexcept {
  return (library_->raw->properties & HAMELIN_TICK_ALLOCATES) != 0;
}
bool Plugin::uses_threads() const noexcept {
  return (library_->raw->properties & HAMELIN_USES_THREADS) != 0;
}
bool Plugin::follows_targets() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_TARGETS) != 0;
}
bool Plugin::follows_trajectories() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_TRAJECTORIES) != 0;
}
bool Plugin::follows_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_FOLLOWS_PATHS) != 0;
}
bool Plugin::asks_for_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_ASKS_FOR_PATHS) != 0;
}
bool Plugin::trusts_certified_paths() const noexcept {
  return (library_->raw->properties & HAMELIN_TRUSTS_CERTIFIED_PATHS) != 0;
}
bool Plugin::can_change_params() const noexcept {
  return library_->raw->prepare_params != nullptr;
}
bool Plugin::can_reset() const noexcept {
  return library_->raw->reset != nullptr;
}
std::uint32_t Plugin::abi_version() const noexcept {
  return std::min(library_->raw->abi_version, HAMELIN_PLUGIN_ABI_VERSION);
}

std::optional<double> Plugin::influence_m(const Json& checked_params) const {
  if (library_->raw->influence_m == nullptr) return std::nullopt;
  const std::string text = checked_params.dump();
  const double answer = library_->raw->influence_m(text.data(), text.size());
  if (!(answer >= 0.0)) return std::nullopt;
  return answer;
}

Json check_params(const Plugin& plugin, const Json& params) {
  const std::string where = fmt::format("parameters of planner '{}'", plugin.name());
  const Json given = params.is_null() ? Json::object() : params;
  if (!given.is_object()) throw Error(ErrorCode::invalid, where + ": /: expected an object");
  check_schema(given, plugin.params_schema(), where);
  return with_defaults(given, plugin.params_schema());
}

}  // namespace hamelin::planning
