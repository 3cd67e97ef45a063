#include "hamelin/core/json.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <set>
#include <vector>

#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"

namespace hamelin {

namespace {

std::string position_of(std::string_view text, std::size_t byte) {
  byte = std::min(byte, text.size());
  const std::string_view before = text.substr(0, byte);
  const auto line = 1 + std::count(before.begin(), before.end(), '\n');
  const auto last_newline = before.rfind('\n');
  const auto column = last_newline == std::string_view::npos ? byte : byte - last_newline - 1;
  return fmt::format("line {}, column {}", line, std::max<std::size_t>(column, 1));
}

}  // namespace

Json parse_json(std::string_view text, const std::string& where) {
  // nlohmann keeps the last of two equal keys without a word; a typo in a scene must not vanish like that.
  std::vector<std::set<std::string>> keys;
  std::string doubled;
  const auto watch = [&](int, Json::parse_event_t event, Json& value) {
    if (event == Json::parse_event_t::object_start) keys.emplace_back();
    if (event == Json::parse_event_t::object_end) keys.pop_back();
    if (event == Json::parse_event_t::key && !keys.back().insert(value.get<std::string>()).second && doubled.empty())
      doubled = value.get<std::string>();
    return true;
  };
  try {
    Json document = Json::parse(text, watch);
    if (!doubled.empty()) throw Error(ErrorCode::parse, fmt::format("{}: key '{}' is given twice", where, doubled));
    return document;
  } catch (const nlohmann::json::parse_error& e) {
    std::string reason = e.what();
    if (const auto colon = reason.rfind("syntax error"); colon != std::string::npos) reason = reason.substr(colon);
    std::replace(reason.begin(), reason.end(), '\n', ' ');
    throw Error(ErrorCode::parse, fmt::format("{}: {}: not JSON: {}", where, position_of(text, e.byte), reason));
  } catch (const nlohmann::json::out_of_range& e) {
    const std::string_view reason = e.what();  // opens with the exception's name in brackets
    throw Error(ErrorCode::parse, fmt::format("{}: not JSON: {}", where, reason.substr(reason.find("] ") + 2)));
  }
}

Json read_json(const std::filesystem::path& file) {
  return parse_json(read_file(file), file.string());
}

namespace {

// Edits that turn a into b: insert, delete, change, or swap two neighbours (optimal string alignment). Case is no edit.
std::size_t edits_between(std::string_view a, std::string_view b) {
  const auto same = [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) == std::tolower(static_cast<unsigned char>(y));
  };
  std::vector<std::vector<std::size_t>> d(a.size() + 1, std::vector<std::size_t>(b.size() + 1));
  for (std::size_t i = 0; i <= a.size(); ++i)
    for (std::size_t j = 0; j <= b.size(); ++j) {
      if (i == 0 || j == 0) {
        d[i][j] = i + j;
        continue;
      }
      const std::size_t change = d[i - 1][j - 1] + (same(a[i - 1], b[j - 1]) ? 0 : 1);
      d[i][j] = std::min({change, d[i - 1][j] + 1, d[i][j - 1] + 1});
      if (i > 1 && j > 1 && same(a[i - 1], b[j - 2]) && same(a[i - 2], b[j - 1]))
        d[i][j] = std::min(d[i][j], d[i - 2][j - 2] + 1);
    }
  return d[a.size()][b.size()];
}

}  // namespace

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t fewest = 1 + std::max<std::size_t>(1, name.size() / 3);
  for (const auto& candidate : candidates) {
    const std::size_t edits = edits_between(name, candidate);
    // Names that share less than half of their letters are not alike, however short they are.
    if (edits >= fewest || 2 * edits >= std::max(name.size(), candidate.size())) continue;
    fewest = edits;
    best = candidate;
  }
  return best;
}

}  // namespace hamelin
