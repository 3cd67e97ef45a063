#pragma once
#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace hamelin {

/// How many bytes from the beginning are UTF-8: all of them if it is UTF-8 text.
[[nodiscard]] std::size_t utf8_prefix(std::string_view text) noexcept;

/// Text for one line, whatever was in the file it speaks of: control characters become blanks, what is not UTF-8
/// question marks, and beyond 2000 bytes it is cut.
[[nodiscard]] std::string one_line(std::string_view text);

/// The candidate nearest to `name`, or empty if none is near (edits up to a third of its letters, a swap of neighbours
/// being one edit, and less than half of the longer name): for "did you mean". Of names beyond 100 bytes none is near.
[[nodiscard]] std::string nearest_name(std::string_view name, const std::vector<std::string>& candidates);

/// "; did you mean 'x'?" with the nearest name, or nothing if none is near: the end of an error message.
[[nodiscard]] std::string did_you_mean(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace hamelin
