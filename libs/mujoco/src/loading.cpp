#include "loading.hpp"

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <mutex>

#include "hamelin/core/error.hpp"

namespace hamelin::mujoco {

namespace {

constexpr const char* file_name = "model.xml";

/// A virtual file system with one file.
class MemoryFile {
 public:
  explicit MemoryFile(const std::string& content) {
    api().mj_defaultVFS(files_.get());
    const bool made =
        api().mj_makeEmptyFileVFS(files_.get(), file_name, static_cast<int>(content.size())) == 0;
    if (!made) throw Error(ErrorCode::io, "MuJoCo: cannot keep a model in memory");
    std::memcpy(files_->filedata[0], content.data(), content.size());
  }
  MemoryFile(const MemoryFile&) = delete;
  MemoryFile& operator=(const MemoryFile&) = delete;
  ~MemoryFile() { api().mj_deleteVFS(files_.get()); }
  [[nodiscard]] const mjVFS* get() const noexcept { return files_.get(); }

 private:
  std::unique_ptr<mjVFS> files_ = std::make_unique<mjVFS>();  // 2 MB
};

// By default MuJoCo waits for a key and exits on an error, and writes warnings to a file in the
// working directory. Warnings are read from mjData instead.
void set_handlers() {
  *api().mju_user_error = [](const char* text) {
    throw Error(ErrorCode::invalid, fmt::format("MuJoCo: {}", text));
  };
  *api().mju_user_warning = [](const char*) {};
}

}  // namespace

const Api& api() {
  static const Api functions;
  return functions;
}

ModelPointer load_model(const std::string& mjcf, const std::string& where) {
  static std::mutex one_at_a_time;  // the reader keeps the last model that it read
  const std::lock_guard lock(one_at_a_time);
  set_handlers();
  const MemoryFile file(mjcf);
  std::array<char, 1000> error{};
  ModelPointer model(
      api().mj_loadXML(file_name, file.get(), error.data(), static_cast<int>(error.size())));
  api().mj_freeLastXML();
  if (model) return model;
  std::string reason(error.data());
  for (char& c : reason)
    if (c == '\n') c = ' ';
  throw Error(ErrorCode::invalid, fmt::format("{}: MuJoCo refuses the model: {}", where, reason));
}

}  // namespace hamelin::mujoco
