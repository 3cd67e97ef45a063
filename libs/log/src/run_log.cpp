#include "hamelin/log/run_log.hpp"

#include <fcntl.h>
#include <fmt/format.h>
#include <unistd.h>

#include <cerrno>
#include <cmath>
#include <cstring>

#include "hamelin/core/error.hpp"

namespace hamelin::log {

namespace {

void null_non_finite(Json& value, const std::string& pointer, std::vector<std::string>& replaced) {
  if (value.is_number_float()) {
    const double number = value.get<double>();
    if (std::isfinite(number)) return;
    replaced.push_back(fmt::format("{} is {}", pointer, number));
    value = nullptr;
  } else if (value.is_object()) {
    for (auto& [key, item] : value.items()) null_non_finite(item, fmt::format("{}/{}", pointer, key), replaced);
  } else if (value.is_array()) {
    for (std::size_t i = 0; i < value.size(); ++i)
      null_non_finite(value[i], fmt::format("{}/{}", pointer, i), replaced);
  }
}

}  // namespace

void check_writable(const std::filesystem::path& file) {
  const auto refuse = [&](int reason) {
    throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", file.string(), std::strerror(reason)));
  };
  int fd = ::open(file.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0644);
  if (fd >= 0) {
    ::close(fd);
    ::unlink(file.c_str());
    return;
  }
  if (errno != EEXIST) refuse(errno);
  // O_NONBLOCK: a named pipe without a reader is refused, not waited for.
  fd = ::open(file.c_str(), O_WRONLY | O_NONBLOCK | O_CLOEXEC);
  if (fd < 0) refuse(errno);
  ::close(fd);
}

std::vector<std::string> null_non_finite(Json& document) {
  std::vector<std::string> replaced;
  null_non_finite(document, "", replaced);
  return replaced;
}

RunLog::RunLog(const std::filesystem::path& file) : file_(file) {
  check_writable(file);
}

void RunLog::append(const Json& line) {
  errno = 0;
  if (!out_.is_open()) out_.open(file_, std::ios::binary | std::ios::trunc);
  // A name that is not UTF-8 (a path, say) is shown with replacement characters rather than losing the record.
  out_ << line.dump(-1, ' ', false, Json::error_handler_t::replace) << '\n' << std::flush;
  if (!out_)
    throw Error(ErrorCode::io, fmt::format("{}: cannot be written: {}", file_.string(),
                                           errno != 0 ? std::strerror(errno) : "the stream failed"));
}

void RunLog::write(const char* type, const Json& fields) {
  Json line = {{"type", type}};
  if (std::strcmp(type, "header") == 0) line["schema"] = "hamelin.run/1";
  line.update(fields);
  const auto replaced = null_non_finite(line);
  append(line);
  if (!replaced.empty())
    append({{"type", "event"},
            {"time_s", line.value("time_s", Json(nullptr))},
            {"text", fmt::format("not finite in the {} above, written as null: {}", type, fmt::join(replaced, ", "))}});
}

}  // namespace hamelin::log
