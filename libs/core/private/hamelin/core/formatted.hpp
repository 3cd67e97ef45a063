#pragma once
#include <fmt/core.h>

#include <string>
#include <string_view>

/// Message formatting for the libraries that need no package but Eigen. {fmt} is compiled into core
/// once, and the other libraries include its smallest header. This header is not installed.
namespace hamelin {

[[nodiscard]] std::string formatted_arguments(fmt::string_view text, fmt::format_args arguments);

/// Same as fmt::format. The format string is checked at compile time.
template <class... T>
[[nodiscard]] std::string formatted(fmt::format_string<T...> text, const T&... arguments) {
  return formatted_arguments(text, fmt::make_format_args(arguments...));
}

/// The items with the separator between them, for example "a, b, c".
template <class Range>
[[nodiscard]] std::string joined(const Range& items, std::string_view separator) {
  std::string text;
  for (const auto& item : items) text += formatted("{}{}", text.empty() ? "" : separator, item);
  return text;
}

}  // namespace hamelin
