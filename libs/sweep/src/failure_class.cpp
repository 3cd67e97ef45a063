#include "hamelin/sweep/failure_class.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <optional>
#include <string_view>

namespace hamelin::sweep {

namespace {

bool is_digit(char c) {
  return c >= '0' && c <= '9';
}
bool is_word(char c) {
  return std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '_';
}

/// Remarks that follow a cause and do not make it another one.
std::string_view without_remarks(std::string_view cause) {
  for (const std::string_view remark :
       {"; the exit direction is ", "; start elsewhere; or, if they always touch, ",
        "; if they always touch, ", "; it is within the tolerances, but "})
    cause = cause.substr(0, cause.find(remark));
  return cause;
}

/// Reads a cause and writes it without names and numbers.
class Normaliser {
 public:
  explicit Normaliser(std::string_view text) : text_(text) {}

  std::string run() {
    while (at_ < text_.size())
      if (!name() && !number() && !word()) out_ += text_[at_++];
    return std::move(out_);
  }

 private:
  [[nodiscard]] bool begins() const { return at_ == 0 || !is_word(text_[at_ - 1]); }
  [[nodiscard]] char next(std::size_t i) const { return i < text_.size() ? text_[i] : '\0'; }

  // A name in quotes; an apostrophe within a word is none.
  bool name() {
    if (text_[at_] != '\'' || !begins()) return false;
    for (auto end = text_.find('\'', at_ + 1); end != std::string_view::npos;
         end = text_.find('\'', end + 1)) {
      if (is_word(next(end + 1))) continue;
      out_ += "'*'";
      at_ = end + 1;
      return true;
    }
    return false;
  }

  // A number with its sign, or the sign of a direction such as "-joint".
  bool number() {
    if (!begins()) return false;
    const bool sign = text_[at_] == '+' || text_[at_] == '-';
    const std::size_t start = at_ + (sign ? 1 : 0);
    if (sign && at_ > 0 &&
        std::string_view(" (,=['").find(text_[at_ - 1]) == std::string_view::npos)
      return false;
    const std::string_view rest = text_.substr(std::min(start, text_.size()));
    const bool word = rest.starts_with("inf") || rest.starts_with("nan");
    if (sign && !word && is_word(next(start)) && !is_digit(next(start))) {
      at_ = start;  // the word follows
      return true;
    }
    if (!is_digit(next(start)) && !(word && !is_word(next(start + 3)))) return false;
    double value = 0.0;
    const auto [end, error] = std::from_chars(rest.data(), rest.data() + rest.size(), value);
    if (error == std::errc::invalid_argument) return false;
    at_ = static_cast<std::size_t>(end - text_.data());
    out_ += 'N';
    return true;
  }

  // A word; those that count parts ("joint3") become "joint N".
  bool word() {
    if (!is_word(text_[at_])) return false;
    std::size_t end = at_;
    while (is_word(next(end))) ++end;
    std::string_view word = text_.substr(at_, end - at_), stem = word;
    at_ = end;
    while (!stem.empty() && is_digit(stem.back())) stem.remove_suffix(1);
    if (stem.ends_with('_')) stem.remove_suffix(1);
    for (const std::string_view part : {"joint", "link", "sphere", "capsule", "obstacle", "goal"})
      if (stem == part && stem != word) {
        out_ += fmt::format("{} N", part);
        return true;
      }
    out_ += word;
    return true;
  }

  std::string_view text_;
  std::size_t at_ = 0;
  std::string out_;
};

// "sphere N of link" and "capsule N of part" name the same thing with different detail.
void join_parts_of_links(std::string& text) {
  for (const std::string_view shape : {"sphere N of ", "capsule N of "})
    for (const std::string_view part : {"link '*'", "part '*'"}) {
      const std::string whole = fmt::format("{}{}", shape, part);
      for (auto at = text.find(whole); at != std::string::npos; at = text.find(whole, at))
        text.replace(at, whole.size(), "link '*'");
    }
}

/// The parts of a crash that name it: "signal 11 (Segmentation fault)", "exit code 3".
std::string crash_class(const std::string& cause) {
  const auto end = cause.find(": ");
  std::string head = cause.substr(0, end);
  if (end == std::string::npos || !head.starts_with("exit code")) return head;
  return fmt::format("{}: {}", head, normalised_cause(cause.substr(end + 2)));
}

const char* kind_of_contact(const std::string& kind, const Json& closest) {
  if (kind == "self") return "the arm touch itself";
  return closest.value("other", "") == "map" ? "the arm touch the map"
                                             : "the arm touch an obstacle";
}

/// The findings of the judge that are contacts.
template <class Visit>
void for_each_contact(const Json& record, Visit visit) {
  const Json& judge = record["judge"];
  if (!judge.is_object()) return;
  for (const char* kind : {"obstacles", "self"})
    if (const auto found = judge.find(kind);
        found != judge.end() && found->is_object() && found->value("clearance_m", 1.0) <= 0.0)
      visit(kind, *found);
}

}  // namespace

bool is_success(std::string_view outcome) noexcept {
  return outcome == "reached" || outcome == "followed";
}

std::string normalised_cause(const std::string& cause) {
  std::string text = Normaliser(without_remarks(cause)).run();
  join_parts_of_links(text);
  return text;
}

std::string failure_class(const Json& record) {
  if (record.is_null()) return "";
  const std::string outcome = record["outcome"],
                    cause = record["cause"].is_string() ? record["cause"].get<std::string>() : "";
  if (is_success(outcome)) return "";
  if (outcome == "crashed") return fmt::format("crashed: {}", crash_class(cause));
  const Json& result = record["result"];
  const std::string own = result.is_object() ? result.value("outcome", outcome) : outcome;
  if (outcome == "collision" && own != outcome) {
    std::string seen;
    for_each_contact(record, [&](const char* kind, const Json& closest) {
      if (seen.empty()) seen = kind_of_contact(kind, closest);
    });
    return fmt::format("collision: only the judge saw {}; the run ended as {}",
                       seen.empty() ? "contact" : seen, own);
  }
  return cause.empty() ? outcome : fmt::format("{}: {}", outcome, normalised_cause(cause));
}

std::string judged_contact(const Json& record) {
  std::string text;
  if (record.is_null()) return text;
  for_each_contact(record, [&](const char*, const Json& closest) {
    text += fmt::format("{}the judge saw {} touch {} at {:.3f} s, {:.2g} mm deep",
                        text.empty() ? "" : "; ", closest.value("sphere", "?"),
                        closest.value("other", "?"), closest.value("time_s", 0.0),
                        -1e3 * closest.value("clearance_m", 0.0));
  });
  return text;
}

double judged_contact_time(const Json& record) {
  std::optional<double> first;
  if (record.is_null()) return 0.0;
  for_each_contact(record, [&](const char*, const Json& closest) {
    const double time_s = closest.value("time_s", 0.0);
    first = std::min(first.value_or(time_s), time_s);
  });
  return first.value_or(0.0);
}

}  // namespace hamelin::sweep
