#include <fmt/format.h>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <map>
#include <set>
#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/sweep/archive.hpp"
#include "tar.hpp"

namespace hamelin::sweep {

namespace {

namespace fs = std::filesystem;

// The largest description of an archive, for some 10⁶ files.
constexpr std::size_t manifest_max = std::size_t{1} << 28;

[[noreturn]] void refuse(const fs::path& file, const std::string& problem) {
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", file.string(), problem));
}

// Whether a path stays in its folder and has one form only: "a/b", but not "../b", "/b" or "a//b".
bool is_plain(const std::string& name) {
  const fs::path path(name);
  return path.is_relative() && path.has_filename() && path.lexically_normal().native() == name &&
         *path.begin() != ".." && *path.begin() != ".";
}

/// What an archive says of its files.
struct Manifest {
  std::string text;
  fs::path plan;
  std::map<std::string, std::string> sha256;  ///< by path

  [[nodiscard]] Archived archived() const { return {plan.parent_path(), sha256.size()}; }
};

Manifest parse_manifest(const fs::path& file, std::string text) {
  const std::string where = fmt::format("{}: {}", file.string(), manifest_name);
  const Json document = parse_json(text, where);
  check_shipped_schema(document, "archive", where);
  Manifest manifest{std::move(text), document["plan"].get<std::string>(), {}};
  for (const Json& entry : document["files"]) {
    const auto name = entry["file"].get<std::string>();
    const bool inside = is_plain(name) && name != manifest_name;
    if (!inside || !manifest.sha256.emplace(name, entry["sha256"].get<std::string>()).second)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: '{}' is {}, expected paths inside of the folder", where, name,
                              inside ? "listed twice" : "not a plain relative path"));
  }
  if (!manifest.sha256.contains(manifest.plan.generic_string()))
    throw Error(ErrorCode::invalid, fmt::format("{}: /plan: '{}' is not among the files", where,
                                                manifest.plan.string()));
  return manifest;
}

/// A folder that is removed unless it is renamed.
class TemporaryFolder {
 public:
  explicit TemporaryFolder(const fs::path& beside) {
    std::string name = beside.string();
    while (name.size() > 1 && name.back() == '/') name.pop_back();
    name += ".XXXXXX";
    if (::mkdtemp(name.data()) == nullptr)
      throw Error(ErrorCode::io,
                  fmt::format("{}: cannot be created: {}", beside.string(), std::strerror(errno)));
    path_ = name;
    std::error_code ec;
    fs::permissions(path_,
                    fs::perms::group_read | fs::perms::group_exec | fs::perms::others_read |
                        fs::perms::others_exec,
                    fs::perm_options::add, ec);
  }
  ~TemporaryFolder() {
    std::error_code ec;
    fs::remove_all(path_, ec);
  }
  TemporaryFolder(const TemporaryFolder&) = delete;
  TemporaryFolder& operator=(const TemporaryFolder&) = delete;
  [[nodiscard]] const fs::path& path() const noexcept { return path_; }

 private:
  fs::path path_;
};

void check_hash(const fs::path& archive, const fs::path& file, const std::string& name,
                const Manifest& manifest) {
  if (const std::string found = sha256_of_file(file); found != manifest.sha256.at(name))
    refuse(archive, fmt::format("'{}' has the SHA-256 {}, expected {}", name, found,
                                manifest.sha256.at(name)));
}

// Whether the folder holds the files of the archive already.
bool holds(const fs::path& output, const Manifest& manifest, const fs::path& archive) {
  std::error_code ec;
  if (!fs::exists(output, ec)) return false;
  if (!fs::exists(output / manifest_name, ec) || read_file(output / manifest_name) != manifest.text)
    throw Error(ErrorCode::usage,
                fmt::format("{}: exists already, expected a new folder, or one with this archive",
                            output.string()));
  for (const auto& [name, sha256] : manifest.sha256)
    check_hash(archive, output / name, name, manifest);
  return true;
}

}  // namespace

Archived unpack(const fs::path& file, const fs::path& output) {
  TarReader in(file);
  if (!in.next() || in.name() != manifest_name)
    refuse(file, fmt::format("does not begin with {}, expected an archive of `hamelin sweep pack`",
                             manifest_name));
  const Manifest manifest = parse_manifest(file, in.read_all(manifest_max));
  if (holds(output, manifest, file)) return manifest.archived();
  const TemporaryFolder folder(output);
  write_file_atomically(folder.path() / manifest_name, manifest.text);
  std::set<std::string> found;
  while (in.next()) {
    if (!manifest.sha256.contains(in.name()) || !found.insert(in.name()).second)
      refuse(file, fmt::format("'{}' is {}, expected the files of {}", in.name(),
                               manifest.sha256.contains(in.name()) ? "there twice" : "not listed",
                               manifest_name));
    const fs::path to = folder.path() / in.name();
    std::error_code ec;
    fs::create_directories(to.parent_path(), ec);
    if (ec) refuse(file, fmt::format("'{}' cannot be written: {}", in.name(), ec.message()));
    in.extract(to);
    check_hash(file, to, in.name(), manifest);
  }
  for (const auto& [name, sha256] : manifest.sha256)
    if (!found.contains(name))
      refuse(file, fmt::format("'{}' is missing, expected all files of {}", name, manifest_name));
  if (std::rename(folder.path().c_str(), output.c_str()) != 0 && !holds(output, manifest, file))
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be created: {}", output.string(), std::strerror(errno)));
  return manifest.archived();
}

}  // namespace hamelin::sweep
