#include "hamelin/log/run_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>
#include <zstd.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "hamelin/core/error.hpp"

namespace hamelin::log {

namespace {

constexpr int compression_level = 3;

void null_non_finite(Json& value, const std::string& pointer, std::vector<std::string>& replaced) {
  if (value.is_number_float()) {
    const double number = value.get<double>();
    if (std::isfinite(number)) return;
    replaced.push_back(fmt::format("{} is {}", pointer, number));
    value = nullptr;
  } else if (value.is_object()) {
    for (auto& [key, item] : value.items())
      null_non_finite(item, fmt::format("{}/{}", pointer, key), replaced);
  } else if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i)
      null_non_finite(value[i], fmt::format("{}/{}", pointer, i), replaced);
  }
}

[[noreturn]] void refuse(const std::filesystem::path& file, int reason) {
  throw Error(ErrorCode::io,
              fmt::format("{}: cannot be written: {}", file.string(), std::strerror(reason)));
}

}  // namespace

std::vector<std::string> null_non_finite(Json& document) {
  std::vector<std::string> replaced;
  null_non_finite(document, "", replaced);
  return replaced;
}

void check_writable(const std::filesystem::path& file) {
  int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd >= 0) {
    ::close(fd);
    ::unlink(file.c_str());
    return;
  }
  if (errno != EEXIST) refuse(file, errno);
  // O_NONBLOCK: a named pipe without a reader is refused instead of blocking.
  fd = ::open(file.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) refuse(file, errno);
  ::close(fd);
}

double estimated_bytes(int dof, double ticks, bool compressed) noexcept {
  // A number takes about 20 characters. A tick holds q, v, tau and about two channels, the names of
  // its fields and 15 single numbers.
  const double line = 650.0 + 20.0 * 5.0 * dof;
  // zstd -3 makes such lines 2.5 to 3 times smaller, as they consist mostly of digits.
  return ticks * line / (compressed ? 2.7 : 1.0);
}

void LineSink::write(const char* type, const Json& fields) {
  Json line = {{"type", type}};
  if (std::strcmp(type, "header") == 0) line["schema"] = "hamelin.run/1";
  line.update(fields);
  const auto replaced = null_non_finite(line);
  Json event;
  if (!replaced.empty())
    event = {{"type", "event"},
             {"time_s", line.value("time_s", Json(nullptr))},
             {"text", fmt::format("not finite in the {} above, written as null: {}", type,
                                  fmt::join(replaced, ", "))}};
  take(std::move(line));
  if (!replaced.empty()) take(std::move(event));
}

/// Collects the lines of a frame.
struct RunLog::Compressor {
  ZSTD_CCtx* context = ZSTD_createCCtx();
  std::string lines, frame;
  std::size_t count = 0;

  Compressor() {
    if (context == nullptr) throw std::bad_alloc();
    ZSTD_CCtx_setParameter(context, ZSTD_c_compressionLevel, compression_level);
    ZSTD_CCtx_setParameter(context, ZSTD_c_checksumFlag, 1);
  }
  ~Compressor() { ZSTD_freeCCtx(context); }
  Compressor(const Compressor&) = delete;
  Compressor& operator=(const Compressor&) = delete;

  void compress() {
    frame.resize(ZSTD_compressBound(lines.size()));
    const std::size_t size =
        ZSTD_compress2(context, frame.data(), frame.size(), lines.data(), lines.size());
    // The buffer is large enough, so only memory can be missing.
    if (ZSTD_isError(size) != 0) throw std::bad_alloc();
    frame.resize(size);
    lines.clear();
    count = 0;
  }
};

RunLog::RunLog(const std::filesystem::path& file) : file_(file) {
  check_writable(file);
  if (file.extension() == ".zst") compressor_ = std::make_unique<Compressor>();
}

RunLog::~RunLog() {
  try {
    flush();
  } catch (const std::exception&) {  // a destructor cannot report it
  }
  if (fd_ >= 0) ::close(fd_);
}

void RunLog::append(std::string_view bytes) {
  if (fd_ < 0) fd_ = ::open(file_.c_str(), O_WRONLY | O_CREAT | O_TRUNC | O_CLOEXEC, 0644);
  if (fd_ < 0) refuse(file_, errno);
  while (!bytes.empty()) {
    const ssize_t written = ::write(fd_, bytes.data(), bytes.size());
    if (written < 0 && errno == EINTR) continue;
    if (written < 0) refuse(file_, errno);
    bytes.remove_prefix(static_cast<std::size_t>(written));
  }
}

void RunLog::take(Json line) {
  // Names that are not UTF-8 (such as paths) get replacement characters, so that the line is not
  // lost.
  const std::string text = line.dump(-1, ' ', false, Json::error_handler_t::replace) + '\n';
  if (!compressor_) {
    append(text);
    return;
  }
  compressor_->lines += text;
  // The header has a frame of its own, so that it can be read from the start.
  if (++compressor_->count == lines_per_frame || line["type"] == "header" ||
      line["type"] == "result")
    flush();
}

void RunLog::flush() {
  if (!compressor_ || compressor_->count == 0) return;
  compressor_->compress();
  append(compressor_->frame);
}

}  // namespace hamelin::log
