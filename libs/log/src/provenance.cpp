#include "hamelin/log/provenance.hpp"

#include <elf.h>
#include <gnu/libc-version.h>
#include <link.h>
#include <sys/utsname.h>
#include <unistd.h>

#include <Eigen/Core>
#include <cstring>
#include <fstream>
#include <string_view>

#include "build_info.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::log {

namespace {

// The text after `key` and `separator` on the first line that begins with the key, without quotes;
// empty if there is no such line.
std::string line_value(const char* file, std::string_view key, char separator) {
  std::ifstream in(file);
  for (std::string line; std::getline(in, line);) {
    if (!line.starts_with(key)) continue;
    const auto at = line.find(separator);
    if (at == std::string::npos) continue;
    const auto from = line.find_first_not_of(" \"", at + 1);
    const auto to = line.find_last_not_of(" \"");
    if (from != std::string::npos && to >= from) return line.substr(from, to - from + 1);
  }
  return {};
}

Json known(const std::string& text) {
  return text.empty() ? Json(nullptr) : Json(text);
}

bool has_fma() {
#if defined(__x86_64__)
  return __builtin_cpu_supports("fma") != 0 && __builtin_cpu_supports("avx2") != 0;
#else
  return false;
#endif
}

Json host() {
  std::string os = line_value("/etc/os-release", "PRETTY_NAME", '=');
  utsname system{};
  if (::uname(&system) == 0)
    os += (os.empty() ? "" : ", ") + std::string(system.sysname) + " " + system.release;
  return {{"os", known(os)},
          {"cpu", known(line_value("/proc/cpuinfo", "model name", ':'))},
          {"cores", ::sysconf(_SC_NPROCESSORS_ONLN)},
          {"fma", has_fma()}};
}

// The build-id note of the program itself, which is the first object listed; empty if the linker
// wrote none.
std::string build_id() {
  std::string id;
  dl_iterate_phdr(
      [](dl_phdr_info* object, std::size_t, void* out) {
        for (int i = 0; i < object->dlpi_phnum; ++i) {
          const auto& segment = object->dlpi_phdr[i];
          if (segment.p_type != PT_NOTE) continue;
          const std::size_t align = segment.p_align == 8 ? 8 : 4;
          const auto padded = [align](std::size_t size) {
            return (size + align - 1) / align * align;
          };
          const char* at =
              reinterpret_cast<const char*>(object->dlpi_addr + segment.p_vaddr);  // NOLINT
          const char* const end = at + segment.p_memsz;
          while (at + sizeof(ElfW(Nhdr)) <= end) {
            ElfW(Nhdr) note;
            std::memcpy(&note, at, sizeof note);
            const char* const name = at + sizeof note;
            const char* const bytes = name + padded(note.n_namesz);
            if (note.n_type == NT_GNU_BUILD_ID && note.n_namesz == 4 &&
                std::memcmp(name, "GNU", 4) == 0) {
              for (std::size_t b = 0; b < note.n_descsz; ++b) {
                constexpr const char* digits = "0123456789abcdef";
                const auto byte = static_cast<unsigned char>(bytes[b]);
                *static_cast<std::string*>(out) += {digits[byte >> 4U], digits[byte & 15U]};
              }
              return 1;
            }
            at = bytes + padded(note.n_descsz);
          }
        }
        return 1;  // stop after the first object
      },
      &id);
  return id;
}

}  // namespace

Json provenance(const std::vector<Input>& inputs, const std::vector<std::string>& argv) {
  Json hashed = Json::array();
  for (const auto& [role, file] : inputs)
    hashed.push_back({{"role", role}, {"path", file.string()}, {"sha256", sha256_of_file(file)}});
  std::error_code ec;
  const BuildInfo& build = build_info();
  const std::string eigen = std::to_string(EIGEN_WORLD_VERSION) + "." +
                            std::to_string(EIGEN_MAJOR_VERSION) + "." +
                            std::to_string(EIGEN_MINOR_VERSION);
  return {{"host", host()},
          {"isa", std::string(name_of(default_isa()))},
          {"build",
           {{"id", known(build_id())},
            {"compiler", build.compiler},
            {"flags", build.flags},
            {"type", known(build.type)},
            {"sanitizers", known(build.sanitizers)}}},
          {"versions",
           {{"hamelin", std::string(version())},
            {"git_commit", known(build.git_commit)},
            {"eigen", eigen},
            {"octomap", known(build.octomap_version)},
            {"libc", gnu_get_libc_version()}}},
          {"cwd", known(std::filesystem::current_path(ec).string())},
          {"argv", argv},
          {"inputs", hashed}};
}

}  // namespace hamelin::log
