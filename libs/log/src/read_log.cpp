#include "hamelin/log/read_log.hpp"

#include <fmt/format.h>
#include <zstd.h>
#include <zstd_errors.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <map>

#include "hamelin/core/error.hpp"

namespace hamelin::log {

namespace {

constexpr std::size_t chunk = std::size_t{1} << 16;
// A frame written by RunLog holds 256 lines and is buffered until its checksum is verified. A file
// compressed by another program may be one frame of any size: beyond this size it is passed on as
// it comes.
constexpr std::size_t buffered_max = std::size_t{8} << 20;
// Logs of an arm at rest compress to a fiftieth. A file that expands by more than these factors is
// not a log but a decompression bomb.
constexpr std::size_t unpacked_per_byte = 200, line_per_byte = 4;
constexpr std::size_t line_always = std::size_t{1} << 20;

std::string place(const std::filesystem::path& file, std::size_t line) {
  return fmt::format("{}: line {}", file.string(), line);
}

// The schema of one kind of line, with the definitions that it refers to.
Json line_schema(const std::string& type) {
  if (type == "result") {
    Json schema = shipped_schema("result");
    schema["properties"]["type"] = {{"description", "kind of line"}, {"const", "result"}};
    return schema;
  }
  const Json run = shipped_schema("run");
  Json schema = run["definitions"][type];
  schema["definitions"] = run["definitions"];
  return schema;
}

constexpr std::array<const char*, 4> line_types{"header", "tick", "event", "result"};

const Schema& schema_of(const std::string& type) {
  static const std::map<std::string, Schema> all = [] {
    std::map<std::string, Schema> made;
    for (const char* name : line_types) made.emplace(name, Schema(line_schema(name), name));
    return made;
  }();
  return all.at(type);
}

// The line's type. @throws Error invalid for an unknown type
std::string type_of(const Json& line, const std::string& where) {
  const Json type = line.value("type", Json(nullptr));
  for (const char* known : line_types)
    if (type == known) return known;
  throw Error(ErrorCode::invalid, fmt::format("{}: type {}, expected header, tick, event or result",
                                              where, type.dump()));
}

}  // namespace

struct LogReader::Decompressor {
  ZSTD_DCtx* context = ZSTD_createDCtx();
  std::string input, frame;
  std::size_t at = 0;                  ///< end of what was read of `input`
  std::size_t offset = 0, number = 1;  ///< of the frame: first byte in the file, and its number
  std::size_t taken = 0, given = 0;    ///< bytes read from the file so far, and bytes of text made

  Decompressor() {
    if (context == nullptr) throw std::bad_alloc();
  }
  ~Decompressor() { ZSTD_freeDCtx(context); }
  Decompressor(const Decompressor&) = delete;
  Decompressor& operator=(const Decompressor&) = delete;
};

LogReader::LogReader(const std::filesystem::path& file) : file_(file) {
  std::error_code ec;
  if (std::filesystem::is_directory(file, ec))
    throw Error(ErrorCode::io, fmt::format("{}: cannot be read: Is a directory", file.string()));
  // A device may be endless.
  if (std::filesystem::is_character_file(file, ec) || std::filesystem::is_block_file(file, ec))
    throw Error(ErrorCode::io, fmt::format("{}: is a device, expected a file", file.string()));
  errno = 0;
  in_.open(file, std::ios::binary);
  if (!in_)
    throw Error(ErrorCode::io,
                fmt::format("{}: cannot be read: {}", file.string(),
                            errno != 0 ? std::strerror(errno) : "the stream failed"));
  constexpr std::string_view magic = "\x28\xb5\x2f\xfd";
  std::string first(magic.size(), '\0');
  in_.read(first.data(), static_cast<std::streamsize>(first.size()));
  first.resize(static_cast<std::size_t>(in_.gcount()));
  in_.clear();
  in_.seekg(0);
  if (!first.empty() && magic.starts_with(first)) decompressor_ = std::make_unique<Decompressor>();
}

LogReader::~LogReader() = default;

std::string LogReader::where() const {
  return place(file_, lines_);
}

bool LogReader::read_more() {
  const auto fill = [this](std::string& bytes) {
    const std::size_t before = bytes.size();
    bytes.resize(before + chunk);
    in_.read(bytes.data() + before, static_cast<std::streamsize>(chunk));
    const auto got = static_cast<std::size_t>(in_.gcount());
    bytes.resize(before + got);
    if (in_.bad())
      throw Error(ErrorCode::io,
                  fmt::format("{}: cannot be read: the stream failed", file_.string()));
    return got;
  };
  if (!decompressor_) return fill(text_) > 0;

  auto& d = *decompressor_;
  const auto damaged = [&](const std::string& what) {
    return Error(ErrorCode::parse, fmt::format("{}: frame {} at byte {}: {}", file_.string(),
                                               d.number, d.offset, what));
  };
  for (;;) {
    if (d.at == d.input.size()) {
      d.input.clear();
      d.at = 0;
      if (fill(d.input) == 0) {
        // An incomplete frame is skipped: its checksum is at its end.
        cut_ = d.taken > d.offset;
        return false;
      }
    }
    const std::size_t before = d.frame.size();
    d.frame.resize(before + ZSTD_DStreamOutSize());
    ZSTD_inBuffer in{d.input.data(), d.input.size(), d.at};
    ZSTD_outBuffer out{d.frame.data(), d.frame.size(), before};
    const std::size_t left = ZSTD_decompressStream(d.context, &out, &in);
    if (ZSTD_isError(left) != 0)
      throw damaged(fmt::format("is damaged ({})", ZSTD_getErrorName(left)));
    d.taken += in.pos - d.at;
    d.at = in.pos;
    d.frame.resize(out.pos);
    d.given += out.pos - before;
    if (d.given > buffered_max + unpacked_per_byte * d.taken)
      throw damaged(
          fmt::format("decompresses to more than {} times its size, expected a log of hamelin",
                      unpacked_per_byte));
    if (left == 0 || d.frame.size() > buffered_max) {
      text_ += d.frame;
      d.frame.clear();
      if (left != 0) return true;
      d.offset = d.taken;
      ++d.number;
      return true;
    }
  }
}

bool LogReader::next_text(std::string_view& line) {
  const auto check_size = [this](std::size_t bytes) {
    const std::size_t most =
        decompressor_ ? line_always + line_per_byte * decompressor_->taken : bytes;
    if (bytes > most)
      throw Error(ErrorCode::parse,
                  fmt::format("{}: has more than {} bytes, expected a log of hamelin",
                              place(file_, lines_ + 1), most));
  };
  std::size_t end = text_.find('\n', at_);
  while (end == std::string::npos) {
    text_.erase(0, at_);
    at_ = 0;
    const std::size_t searched = text_.size();
    check_size(searched);
    if (!read_more()) {
      cut_ = cut_ || !text_.empty();
      return false;
    }
    end = text_.find('\n', searched);
  }
  line = std::string_view(text_).substr(at_, end - at_);
  check_size(line.size());
  ++lines_;
  at_ = end + 1;
  return true;
}

bool LogReader::next(Json& line) {
  std::string_view text;
  if (!next_text(text)) return false;
  line = parse_json(text, where());
  if (!line.is_object())
    throw Error(ErrorCode::parse,
                fmt::format("{}: not a JSON object, expected one per line", where()));
  return true;
}

LogLines read_log(const std::filesystem::path& file) {
  LogReader reader(file);
  LogLines log;
  for (Json line; reader.next(line);) log.lines.push_back(std::move(line));
  log.cut = reader.cut();
  return log;
}

void check_line(const Json& line, const std::string& where) {
  schema_of(type_of(line, where)).check(line, where);
}

LogSummary check_log(const std::filesystem::path& file) {
  LogReader reader(file);
  LogSummary summary;
  double k_before = -1.0;
  for (Json line; reader.next(line);) {
    const std::string where = reader.where();
    const std::string type = type_of(line, where);
    if ((type == "header") != (reader.lines() == 1))
      throw Error(
          ErrorCode::invalid,
          fmt::format("{}: type \"{}\", expected a header on line 1 and only there", where, type));
    if (summary.has_result)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: follows the result, expected nothing after it", where));
    summary.ticks += type == "tick" ? 1 : 0;
    summary.events += type == "event" ? 1 : 0;
    summary.has_result = type == "result";
    schema_of(type).check(line, where);
    if (type == "tick") {
      const double k = line["k"].get<double>();
      if (k <= k_before)
        throw Error(
            ErrorCode::invalid,
            fmt::format("{}: /k: {} after {}, expected increasing steps", where, k, k_before));
      k_before = k;
    }
  }
  summary.cut = reader.cut();
  if (reader.lines() == 0)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: has no complete line, expected a header", file.string()));
  return summary;
}

}  // namespace hamelin::log
