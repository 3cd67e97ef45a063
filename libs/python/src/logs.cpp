#include <fmt/format.h>
#include <pybind11/stl.h>

#include <charconv>
#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <string_view>
#include <vector>

#include "arguments.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/log/read_log.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "whole.hpp"

namespace hamelin::python {

namespace {

constexpr double nan = std::numeric_limits<double>::quiet_NaN();

// The values of one field in all ticks of a chunk.
struct Column {
  std::string name;       // the path of its keys, separated by dots
  std::size_t width = 0;  // numbers per tick; 0: none was seen yet
  bool vector = false;    // a list of numbers, else a number
  bool boolean = true;    // only true and false were seen
  bool missing = false;   // some tick did not have it
  bool irregular =
      false;  // lists of different sizes, or a list in one tick and a number in another
  std::vector<double> values;
  std::size_t rows = 0;

  void fill_to(std::size_t count) {
    if (rows >= count) return;
    missing = true;
    if (width > 0) values.resize(values.size() + (count - rows) * width, nan);
    rows = count;
  }
  // Makes place for a tick. @return whether its numbers are to be appended
  bool begin_row(std::size_t row, std::size_t size, bool is_vector) {
    if (irregular) return false;
    if (width == 0) {
      width = size;
      vector = is_vector;
      values.resize(rows * width, nan);
    }
    if (size != width || is_vector != vector || size == 0 || rows > row) {
      irregular = true;
      values.clear();
      return false;
    }
    fill_to(row);
    return true;
  }
};

// Reads the numbers of tick lines into columns, without making a document of each line: a scanner
// of JSON that skips texts and nested lists.
class Columns {
 public:
  void add_tick(std::string_view line) {
    at_ = line.data();
    end_ = at_ + line.size();
    path_.clear();
    next_ = 0;
    space();
    object();
    space();
    if (at_ != end_) fail();
    ++ticks_;
  }
  [[nodiscard]] std::size_t ticks() const noexcept { return ticks_; }

  [[nodiscard]] py::dict take() {
    py::dict out;
    for (auto& column : columns_) {
      column.fill_to(ticks_);
      if (column.width == 0 || column.irregular) continue;
      const auto count = static_cast<py::ssize_t>(ticks_);
      if (column.boolean && !column.missing && !column.vector) {
        py::array_t<bool> array(count);
        for (py::ssize_t i = 0; i < count; ++i)
          array.mutable_data()[i] = column.values[static_cast<std::size_t>(i)] != 0.0;
        out[py::str(column.name)] = array;
        continue;
      }
      auto array = column.vector ? new_array({count, static_cast<py::ssize_t>(column.width)})
                                 : new_array({count});
      std::copy(column.values.begin(), column.values.end(), array.mutable_data());
      out[py::str(column.name)] = array;
    }
    columns_.clear();
    index_.clear();
    ticks_ = 0;
    return out;
  }

 private:
  struct Malformed {};
  [[noreturn]] static void fail() { throw Malformed(); }

 public:
  // Whether add_tick() found a line that is not JSON.
  template <class F>
  static bool well_formed(const F& f) {
    try {
      f();
      return true;
    } catch (const Malformed&) {
      return false;
    }
  }

 private:
  [[nodiscard]] char peek() const { return at_ < end_ ? *at_ : '\0'; }
  void space() {
    while (at_ < end_ && (*at_ == ' ' || *at_ == '\t' || *at_ == '\r')) ++at_;
  }
  void expect(char c) {
    if (peek() != c) fail();
    ++at_;
  }
  bool accept(std::string_view word) {
    if (!std::string_view(at_, static_cast<std::size_t>(end_ - at_)).starts_with(word))
      return false;
    at_ += word.size();
    return true;
  }
  // The text between quotes, with escapes as they are.
  std::string_view text() {
    expect('"');
    const char* const begin = at_;
    while (at_ < end_ && *at_ != '"') at_ += *at_ == '\\' ? 2 : 1;
    if (at_ >= end_) fail();
    return {begin, static_cast<std::size_t>(at_++ - begin)};
  }
  double number() {
    double value = 0.0;
    if (peek() != '-' && (peek() < '0' || peek() > '9')) fail();
    const auto [end, error] = std::from_chars(at_, end_, value);
    if (error == std::errc::invalid_argument) fail();
    at_ = end;
    return value;
  }
  void object() {
    if (++depth_ > 100) fail();
    expect('{');
    space();
    if (peek() == '}') {
      ++at_;
      --depth_;
      return;
    }
    const std::size_t size = path_.size();
    for (;;) {
      space();
      const std::string_view key = text();
      if (size > 0) path_ += '.';
      path_ += key;
      space();
      expect(':');
      space();
      value();
      path_.resize(size);
      space();
      if (peek() != ',') break;
      ++at_;
    }
    expect('}');
    --depth_;
  }
  void value() {
    switch (peek()) {
      case '{':
        return object();
      case '[':
        return list();
      case '"':
        text();
        return;
      case 't':
        if (!accept("true")) fail();
        return scalar(1.0, true);
      case 'f':
        if (!accept("false")) fail();
        return scalar(0.0, true);
      case 'n':
        if (!accept("null")) fail();
        return;
      default:
        scalar(number(), false);
    }
  }
  void scalar(double value, bool is_boolean) {
    Column& column = current();
    if (!column.begin_row(ticks_, 1, false)) return;
    column.boolean = column.boolean && is_boolean;
    column.values.push_back(value);
    column.rows = ticks_ + 1;
  }
  // A list of numbers and nulls is a row; any other list is skipped.
  void list() {
    const char* const begin = at_;
    expect('[');
    list_.clear();
    space();
    if (peek() == ']') {
      ++at_;
      return;
    }
    for (;;) {
      space();
      if (peek() == 'n') {
        if (!accept("null")) fail();
        list_.push_back(nan);
      } else if (peek() == '-' || (peek() >= '0' && peek() <= '9')) {
        list_.push_back(number());
      } else {
        at_ = begin;
        return skip();
      }
      space();
      if (peek() != ',') break;
      ++at_;
    }
    expect(']');
    Column& column = current();
    if (!column.begin_row(ticks_, list_.size(), true)) return;
    column.boolean = false;
    column.values.insert(column.values.end(), list_.begin(), list_.end());
    column.rows = ticks_ + 1;
  }
  void skip() {
    int depth = 0;
    do {
      const char c = peek();
      if (c == '"') {
        text();
        continue;
      }
      if (c == '[' || c == '{') ++depth;
      if (c == ']' || c == '}') --depth;
      if (c == '\0') fail();
      ++at_;
    } while (depth > 0);
  }
  // The column of the present path. Lines have the same keys in the same order, mostly.
  Column& current() {
    if (next_ < columns_.size() && columns_[next_].name == path_) return columns_[next_++];
    const auto [at, is_new] = index_.try_emplace(path_, columns_.size());
    if (is_new) {
      columns_.emplace_back();
      columns_.back().name = path_;
      columns_.back().rows = 0;
      columns_.back().fill_to(ticks_);
    }
    next_ = at->second + 1;
    return columns_[at->second];
  }

  const char* at_ = nullptr;
  const char* end_ = nullptr;
  int depth_ = 0;
  std::string path_;
  std::vector<double> list_;
  std::vector<Column> columns_;
  std::map<std::string, std::size_t> index_;
  std::size_t next_ = 0, ticks_ = 0;
};

// hamelin.LogStream: reads a log in chunks of ticks.
class LogStream : public Whole {
 public:
  explicit LogStream(const std::filesystem::path& file) : file_(file), reader_(file) {
    std::string_view line;
    if (!next(line))
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: line 1: is missing, expected a header", file_.string()));
    header_ = parse_json(line, reader_.where());
    if (!header_.is_object() || header_.value("type", Json()) != "header")
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: is not a header, expected a log of hamelin", reader_.where()));
  }

  // Reads up to so many ticks. @return their columns, or None at the end
  py::object read(std::size_t ticks) {
    if (reading_)
      throw Error(ErrorCode::usage, "LogStream: another call uses it, expected one call at a time");
    reading_ = true;
    const struct Done {
      bool& reading;
      ~Done() { reading = false; }
    } done{reading_};
    {
      const py::gil_scoped_release unlocked;
      InterruptCheck interrupts;
      std::string_view line;
      for (std::size_t i = 1; columns_.ticks() < ticks && next(line); ++i) {
        take(line);
        if (i % 10'000 == 0) interrupts.raise();
      }
    }
    if (columns_.ticks() == 0) return py::none();
    return columns_.take();
  }
  [[nodiscard]] const Json& header() const noexcept { return header_; }
  [[nodiscard]] const std::vector<Json>& events() const noexcept { return events_; }
  [[nodiscard]] const Json& result() const noexcept { return result_; }
  [[nodiscard]] bool cut() const noexcept { return reader_.cut(); }
  [[nodiscard]] std::string file() const { return file_.string(); }

 private:
  bool next(std::string_view& line) { return reader_.next_text(line); }

  void take(std::string_view line) {
    constexpr std::string_view tick = R"({"type":"tick",)";
    if (line.starts_with(tick)) return add_tick(line);
    const Json document = parse_json(line, reader_.where());
    const Json type = document.is_object() ? document.value("type", Json()) : Json();
    if (type == "tick")
      add_tick(document.dump());
    else if (type == "event")
      events_.push_back(document);
    else if (type == "result")
      result_ = document;
    else
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: type {}, expected tick, event or result", reader_.where(),
                              type.dump(-1, ' ', false, Json::error_handler_t::replace)));
  }
  void add_tick(std::string_view line) {
    if (Columns::well_formed([&] { columns_.add_tick(line); })) return;
    (void)parse_json(line, reader_.where());  // says what is wrong
    throw Error(ErrorCode::parse, fmt::format("{}: is not a tick", reader_.where()));
  }

  std::filesystem::path file_;
  log::LogReader reader_;
  Json header_, result_;
  std::vector<Json> events_;
  Columns columns_;
  bool reading_ = false;
};

py::list to_list(const std::vector<Json>& all) {
  py::list out;
  for (const auto& one : all) out.append(to_python(one));
  return out;
}

}  // namespace

void add_logs(py::module_& module) {
  py::class_<LogStream, std::shared_ptr<LogStream>>(
      module, "LogStream",
      "Reads a log in chunks of ticks, plain or zstd; read_log() reads all at once.\n\n"
      "Iterating gives a dict of arrays per chunk of 1000 ticks. Fields of a tick that are\n"
      "numbers have shape (N,), those that are lists of numbers (N, m); keys of nested objects "
      "are\n"
      "joined by dots, as 'energy.kinetic_J'. NaN where a tick does not have the field. Texts and\n"
      "nested lists are left out.")
      .def(py::init([](py::handle file) { return std::make_shared<LogStream>(path_of(file)); }),
           py::arg("file"), "Opens a log and reads its header.")
      .def(
          "read",
          [](LogStream& stream, const std::optional<std::size_t>& ticks) {
            if (ticks && *ticks == 0) refuse("LogStream.read", "ticks", "0, expected 1 or more");
            return stream.read(ticks.value_or(std::numeric_limits<std::size_t>::max()));
          },
          py::arg("ticks") = py::none(),
          "The next ticks as a dict of arrays; None at the end. ticks None: all that are left.")
      .def(
          "__iter__", [](py::object self) { return self; }, "The stream itself.")
      .def(
          "__next__",
          [](LogStream& stream) {
            py::object chunk = stream.read(1000);
            if (chunk.is_none()) throw py::stop_iteration();
            return chunk;
          },
          "The next 1000 ticks.")
      .def_property_readonly("file", &LogStream::file, "The file.")
      .def_property_readonly(
          "header", [](const LogStream& s) { return to_python(s.header()); },
          "The header as a dict.")
      .def_property_readonly(
          "events", [](const LogStream& s) { return to_list(s.events()); },
          "The events that were read so far, as dicts.")
      .def_property_readonly(
          "result", [](const LogStream& s) { return to_python(s.result()); },
          "The result as a dict; None if it was not read (yet).")
      .def_property_readonly("cut", &LogStream::cut,
                             "Whether the file ended in the middle of a line; known at the end.")
      .def("__repr__",
           [](const LogStream& s) { return fmt::format("<hamelin.LogStream '{}'>", s.file()); });
}

}  // namespace hamelin::python
