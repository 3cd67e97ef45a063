#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <cstdint>
#include <limits>
#include <string_view>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/identification/record.hpp"
#include "hamelin/io/file.hpp"

namespace hamelin::identification {

namespace {

using Eigen::Index;
using Eigen::MatrixXd;

/// Reads the fields of comma-separated values (RFC 4180) one row at a time.
class CsvRows {
 public:
  CsvRows(std::string text, std::string file) : text_(std::move(text)), file_(std::move(file)) {}

  /// @return false at the end; empty lines are skipped
  bool next(std::vector<std::string>& fields) {
    while (at_ < text_.size() && (text_[at_] == '\n' || text_[at_] == '\r')) skip_end();
    fields.clear();
    if (at_ >= text_.size()) return false;
    row_line_ = line_;
    do {
      fields.push_back(field());
    } while (at_ < text_.size() && text_[at_] == ',' && ++at_ > 0);
    skip_end();
    return true;
  }
  [[nodiscard]] std::string where() const { return fmt::format("{}: line {}", file_, row_line_); }

 private:
  void skip_end() {
    if (at_ < text_.size() && text_[at_] == '\r') ++at_;
    if (at_ < text_.size() && text_[at_] == '\n') {
      ++at_;
      ++line_;
    }
  }
  std::string field() {
    if (at_ < text_.size() && text_[at_] == '"') return quoted();
    const std::size_t end = std::min(text_.find_first_of(",\r\n", at_), text_.size());
    std::string out = text_.substr(at_, end - at_);
    at_ = end;
    return out;
  }
  std::string quoted() {
    std::string out;
    for (++at_; at_ < text_.size(); ++at_) {
      if (text_[at_] != '"') {
        line_ += text_[at_] == '\n' ? 1 : 0;
        out += text_[at_];
      } else if (at_ + 1 < text_.size() && text_[at_ + 1] == '"') {
        out += text_[++at_];
      } else {
        ++at_;
        break;
      }
    }
    return out;
  }

  std::string text_, file_;
  std::size_t at_ = 0, line_ = 1, row_line_ = 1;
};

// An empty field is NaN.
double number_of(std::string_view text, const std::string& where, const std::string& column) {
  const auto blank = [](char c) { return c == ' ' || c == '\t'; };
  while (!text.empty() && blank(text.front())) text.remove_prefix(1);
  while (!text.empty() && blank(text.back())) text.remove_suffix(1);
  if (text.empty()) return std::numeric_limits<double>::quiet_NaN();
  if (text.front() == '+') text.remove_prefix(1);
  double value = 0.0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
  if (error != std::errc() || end != text.data() + text.size())
    throw Error(ErrorCode::parse, fmt::format("{}: column '{}': '{}', expected a number", where,
                                              column, one_line(text)));
  return value;
}

/// The columns of a table that are used.
struct Columns {
  std::size_t time = 0;
  std::vector<std::size_t> q, tau;  ///< per joint
  std::size_t count = 0;            ///< of all columns

  Columns(const std::vector<std::string>& names, const model::Robot& robot,
          const std::string& where)
      : count(names.size()) {
    const auto find = [&](const std::string& name) {
      const auto found = std::find(names.begin(), names.end(), name);
      if (found == names.end())
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: has no column '{}', expected time_s, and q_ and tau_ of each "
                                "joint of robot '{}'{}",
                                where, name, robot.name, did_you_mean(name, names)));
      return static_cast<std::size_t>(found - names.begin());
    };
    time = find("time_s");
    for (const auto& link : robot.links) {
      q.push_back(find("q_" + link.joint.name));
      tau.push_back(find("tau_" + link.joint.name));
    }
  }
};

}  // namespace

Record read_csv(const std::filesystem::path& file, const model::Robot& robot, TorqueTiming timing,
                long every) {
  CsvRows rows(read_file(file), file.string());
  std::vector<std::string> fields;
  if (!rows.next(fields))
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: is empty, expected a table of comma-separated values", file.string()));
  if (fields.front().starts_with("\xef\xbb\xbf")) fields.front().erase(0, 3);  // byte order mark
  const std::vector<std::string> names = fields;
  const Columns columns(names, robot, rows.where());
  Record record;
  record.where = file.string();
  std::vector<double> q, tau;
  while (rows.next(fields)) {
    if (fields.size() != columns.count)
      throw Error(ErrorCode::parse, fmt::format("{}: {} fields, expected {}", rows.where(),
                                                fields.size(), columns.count));
    const auto read = [&](std::size_t at) {
      return number_of(fields[at], rows.where(), names[at]);
    };
    const double time = read(columns.time);
    if (!std::isfinite(time) || (!record.time_s.empty() && !(time > record.time_s.back())))
      throw Error(ErrorCode::invalid, fmt::format("{}: column 'time_s': {}, expected increasing "
                                                  "times",
                                                  rows.where(), fields[columns.time]));
    bool finite = true;
    for (std::size_t j = 0; j < columns.q.size(); ++j) {
      q.push_back(read(columns.q[j]));
      tau.push_back(read(columns.tau[j]));
      finite = finite && std::isfinite(q.back()) && std::isfinite(tau.back());
    }
    record.time_s.push_back(time);
    record.usable.push_back(finite ? 1 : 0);
  }
  const auto ticks = static_cast<Index>(record.ticks());
  const auto matrix = [&](const std::vector<double>& numbers) {
    return MatrixXd(Eigen::Map<const MatrixXd>(numbers.data(), robot.dof(), ticks));
  };
  record.q = matrix(q);
  (timing == TorqueTiming::held ? record.held : record.sampled) = matrix(tau);
  return thinned(record, every);
}

}  // namespace hamelin::identification
