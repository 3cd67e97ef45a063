#include "hamelin/core/error.hpp"

namespace hamelin {

namespace {

// Bytes of the UTF-8 character that text begins with, 0 if it begins with none: no overlong form, no surrogate.
std::size_t character_at(std::string_view text) noexcept {
  const auto byte = [&](std::size_t i) { return i < text.size() ? static_cast<unsigned char>(text[i]) : 0U; };
  const auto follows = [&](std::size_t i) { return (byte(i) & 0xC0U) == 0x80U; };
  const unsigned first = byte(0), second = byte(1);
  if (first < 0x80U) return 1;
  if (first >= 0xC2U && first <= 0xDFU) return follows(1) ? 2 : 0;
  if ((first & 0xF0U) == 0xE0U) {
    const bool good =
        follows(1) && follows(2) && !(first == 0xE0U && second < 0xA0U) && !(first == 0xEDU && second > 0x9FU);
    return good ? 3 : 0;
  }
  if (first >= 0xF0U && first <= 0xF4U) {
    const bool good = follows(1) && follows(2) && follows(3) && !(first == 0xF0U && second < 0x90U) &&
                      !(first == 0xF4U && second > 0x8FU);
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

std::string_view to_string(ErrorCode code) noexcept {
  switch (code) {
    case ErrorCode::usage:
      return "usage";
    case ErrorCode::io:
      return "io";
    case ErrorCode::parse:
      return "parse";
    case ErrorCode::invalid:
      return "invalid";
    case ErrorCode::plugin:
      return "plugin";
  }
  return "unknown";
}

std::string_view version() noexcept {
  return HAMELIN_VERSION;
}

}  // namespace hamelin
