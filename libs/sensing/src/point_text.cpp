#include "point_text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "hamelin/core/error.hpp"

namespace hamelin::sensing {

namespace {
constexpr std::string_view blanks = " \t\r,;";
}

bool Text::next() {
  if (at_ >= bytes_.size()) return false;
  const std::size_t end = std::min(bytes_.find('\n', at_), bytes_.size());
  line_ = bytes_.substr(at_, end - at_);
  if (!line_.empty() && line_.back() == '\r') line_.remove_suffix(1);
  at_ = std::min(end + 1, bytes_.size());
  ++number_;
  return true;
}

std::string_view Text::word(std::size_t i) const {
  std::size_t at = 0;
  for (;; --i) {
    at = line_.find_first_not_of(blanks, at);
    if (at == std::string_view::npos) return {};
    const std::size_t end = std::min(line_.find_first_of(blanks, at), line_.size());
    if (i == 0) return line_.substr(at, end - at);
    at = end;
  }
}

std::size_t Text::words() const {
  std::size_t count = 0;
  while (!word(count).empty()) ++count;
  return count;
}

std::size_t Text::count(std::size_t i) const {
  const std::string_view text = word(i);
  std::size_t out = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out);
  if (error != std::errc() || end != text.data() + text.size())
    fail(fmt::format("'{}', expected a number from 0 on", text));
  return out;
}

void Text::numbers(std::vector<double>& out) const {
  out.clear();
  for (std::size_t at = line_.find_first_not_of(blanks); at != std::string_view::npos;
       at = line_.find_first_not_of(blanks, at)) {
    const std::size_t end = std::min(line_.find_first_of(blanks, at), line_.size());
    const char* const last = line_.data() + end;
    double number = 0.0;
    const auto [stop, error] = std::from_chars(line_.data() + at, last, number);
    if (error != std::errc() || stop != last)
      fail(fmt::format("'{}', expected a number", line_.substr(at, end - at)));
    out.push_back(number);
    at = end;
  }
}

geometry::SE3 Text::pose(std::size_t first) const {
  std::vector<double> given;
  Text rest = *this;
  if (const std::string_view word = this->word(first); !word.empty())
    rest.line_ = line_.substr(static_cast<std::size_t>(word.data() - line_.data()));
  rest.numbers(given);
  const auto bad = [](double x) { return !std::isfinite(x); };
  if (given.size() != 7 || std::any_of(given.begin(), given.end(), bad))
    fail("expected seven finite numbers: a position and a quaternion w, x, y, z");
  const Eigen::Quaterniond q(given[3], given[4], given[5], given[6]);
  if (!(std::abs(q.norm() - 1.0) < 1e-2))
    fail(fmt::format("a quaternion of length {:.4g}, expected 1", q.norm()));
  return {q.normalized().toRotationMatrix(), {given[0], given[1], given[2]}};
}

bool Text::is_comment() const {
  const std::size_t first = line_.find_first_not_of(blanks);
  return first == std::string_view::npos || line_[first] == '#';
}

void Text::fail(const std::string& what) const {
  throw Error(ErrorCode::parse, fmt::format("{}: line {}: {}", where_, number_, what));
}

}  // namespace hamelin::sensing
