#include "hamelin/core/text.hpp"

#include <algorithm>
#include <cctype>

namespace hamelin {

namespace {

// The size in bytes of the UTF-8 character at the beginning of the text, 0 if there is none.
// Overlong forms and surrogates are not accepted.
std::size_t character_at(std::string_view text) noexcept {
  const auto byte = [&](std::size_t i) {
    return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U;
  };
  const auto follows = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0), second = byte(1);
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first <= 0xDFU) return follows(1) ? 2 : 0;
  if ((first & 0xF0U) == 0xE0U) {
    const bool good = follows(1) && follows(2) && !(first == 0xE0U && second < 0xA0U) &&
                      !(first == 0xEDU && second > 0x9FU);
    return good ? 3 : 0;
  }
  if (first >= 0xF0U && first <= 0xF4U) {
    const bool good = follows(1) && follows(2) && follows(3) &&
                      !(first == 0xF0U && second < 0x90U) && !(first == 0xF4U && second > 0x8FU);
    return good ? 4 : 0;
  }
  return 0;
}

}  // namespace

std::size_t utf8_prefix(std::string_view text) noexcept {
  std::size_t at = 0;
  while (at < text.size()) {
    const std::size_t size = character_at(text.substr(at));
    if (size == 0) break;
    at += size;
  }
  return at;
}

std::string one_line(std::string_view text) {
  constexpr std::size_t longest = 2000;
  std::string line;
  while (!text.empty()) {
    const std::size_t size = character_at(text);
    if (line.size() + size > longest) return line + "...";
    const auto first = static_cast<unsigned char>(text.front());
    if (size == 0) {
      line += '?';
    } else if (first < ' ' || first == 0x7FU) {
      line += ' ';
    } else {
      line += text.substr(0, size);
    }
    text.remove_prefix(size == 0 ? 1 : size);
  }
  return line;
}

namespace {

// The number of edits that turn a into b: insert, delete, change, or swap two neighbours (optimal
// string alignment). A difference in case does not count.
std::size_t edits_between(std::string_view a, std::string_view b) {
  const auto same = [](char x, char y) {
    return std::tolower(static_cast<unsigned char>(x)) ==
           std::tolower(static_cast<unsigned char>(y));
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
  // Longer names are not typed by hand, and the time grows with the square of the length.
  constexpr std::size_t longest = 100;
  if (name.size() > longest) return {};
  std::string best;
  std::size_t fewest = 1 + std::max<std::size_t>(1, name.size() / 3);
  for (const auto& candidate : candidates) {
    if (candidate.size() > longest) continue;
    const std::size_t edits = edits_between(name, candidate);
    // Names that share less than half of their letters are not near, even short ones.
    if (edits >= fewest || 2 * edits >= std::max(name.size(), candidate.size())) continue;
    fewest = edits;
    best = candidate;
  }
  return best;
}

std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates) {
  const std::string near = nearest_name(name, candidates);
  return near.empty() ? "" : "; did you mean '" + near + "'?";
}

}  // namespace hamelin
