#include "hamelin/log/provenance.hpp"

#include <sys/utsname.h>
#include <unistd.h>

#include <Eigen/Core>
#include <fstream>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"

namespace hamelin::log {

namespace {

// The text behind `key` and `separator` on the first line that begins with the key, quotes removed; empty if there is
// none.
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

Json host() {
  std::string os = line_value("/etc/os-release", "PRETTY_NAME", '=');
  utsname system{};
  if (::uname(&system) == 0) os += (os.empty() ? "" : ", ") + std::string(system.sysname) + " " + system.release;
  return {{"os", known(os)},
          {"cpu", known(line_value("/proc/cpuinfo", "model name", ':'))},
          {"cores", ::sysconf(_SC_NPROCESSORS_ONLN)}};
}

// The instruction set this code was compiled for.
constexpr const char* isa() {
#if defined(__AVX512F__) && defined(__AVX512VL__)
  return "x86-64-v4";
#elif defined(__AVX2__) && defined(__FMA__)
  return "x86-64-v3";
#elif defined(__SSE4_2__)
  return "x86-64-v2";
#elif defined(__x86_64__)
  return "x86-64";
#elif defined(__aarch64__)
  return "aarch64";
#else
  return "other";
#endif
}

}  // namespace

Json provenance(const std::vector<std::filesystem::path>& inputs, const std::vector<std::string>& argv) {
  Json hashed = Json::array();
  for (const auto& file : inputs) hashed.push_back({{"path", file.string()}, {"sha256", sha256_hex(read_file(file))}});
  const std::string eigen = std::to_string(EIGEN_WORLD_VERSION) + "." + std::to_string(EIGEN_MAJOR_VERSION) + "." +
                            std::to_string(EIGEN_MINOR_VERSION);
  return {{"host", host()},
          {"isa", isa()},
          {"build",
           {{"compiler", HAMELIN_COMPILER},
            {"flags", HAMELIN_BUILD_FLAGS},
            {"type", known(HAMELIN_BUILD_TYPE)},
            {"sanitizers", known(HAMELIN_SANITIZERS)}}},
          {"versions",
           {{"hamelin", std::string(version())},
            {"git_commit", known(HAMELIN_GIT_COMMIT)},
            {"eigen", eigen},
            {"octomap", known(HAMELIN_OCTOMAP_VERSION)}}},
          {"argv", argv},
          {"inputs", hashed}};
}

}  // namespace hamelin::log
