#include "hamelin/core/json.hpp"

#include <fmt/format.h>

#include <algorithm>
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

std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates) {
  std::string best;
  std::size_t best_distance = 1 + std::max<std::size_t>(1, name.size() / 3);
  for (const auto& candidate : candidates) {
    std::vector<std::size_t> row(candidate.size() + 1);
    for (std::size_t j = 0; j < row.size(); ++j) row[j] = j;
    for (std::size_t i = 1; i <= name.size(); ++i) {
      std::size_t diagonal = row[0];
      row[0] = i;
      for (std::size_t j = 1; j < row.size(); ++j) {
        const std::size_t change = diagonal + (name[i - 1] == candidate[j - 1] ? 0 : 1);
        diagonal = row[j];
        row[j] = std::min({change, row[j] + 1, row[j - 1] + 1});
      }
    }
    if (row.back() < best_distance) {
      best_distance = row.back();
      best = candidate;
    }
  }
  return best;
}

}  // namespace hamelin
