#pragma once
#include <fmt/core.h>

#include <string>
#include <string_view>

/// Not installed. Texts of the libraries that need no package but Eigen: {fmt} is compiled into core once, and the
/// others read its smallest header.
namespace hamelin {

[[nodiscard]] std::string formatted_arguments(fmt::string_view text, fmt::format_args arguments);

/// fmt::format. The text is checked as the program is compiled.
template <class... T>
[[nodiscard]] std::string formatted(fmt::format_string<T...> text, const T&... arguments) {
  return formatted_arguments(text, fmt::make_format_args(arguments...));
}

/// "a, b, c".
template <class Range>
[[nodiscard]] std::string joined(const Range& items, std::string_view separator) {
  std::string text;
  for (const auto& item : items) text += formatted("{}{}", text.empty() ? "" : separator, item);
  return text;
}

}  // namespace hamelin
