#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace hamelin {

/// The number of leading bytes that are valid UTF-8; text.size() if all of them are.
[[nodiscard]] std::size_t utf8_prefix(std::string_view text) noexcept;

/// The text as one printable line: control characters become blanks, bytes that are not UTF-8
/// become question marks, and the text is cut after 2000 bytes.
[[nodiscard]] std::string one_line(std::string_view text);

/// The candidate nearest to `name`, for "did you mean"; empty if none is near. A candidate is near
/// if it differs by at most a third of the letters of `name` (at least one edit is allowed; a swap
/// of neighbours is one edit) and by less than half of the longer name. No name of more than 100
/// bytes is near.
[[nodiscard]] std::string nearest_name(std::string_view name,
                                       const std::vector<std::string>& candidates);

/// The end of an error message: "; did you mean 'x'?" with the nearest name, empty if none is near.
[[nodiscard]] std::string did_you_mean(std::string_view name,
                                       const std::vector<std::string>& candidates);

/// The member `name` of each element, in order.
template <class List>
[[nodiscard]] std::vector<std::string> names_of(const List& list) {
  std::vector<std::string> names;
  names.reserve(list.size());
  for (const auto& each : list) names.push_back(each.name);
  return names;
}

}  // namespace hamelin
