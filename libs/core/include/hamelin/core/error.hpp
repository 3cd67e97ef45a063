#pragma once
#include <cstddef>
#include <cstdint>
#include <stdexcept>
#include <string>
#include <string_view>

namespace hamelin {

/// What kind of thing went wrong. The program maps every one of them to exit code 2.
enum class ErrorCode : std::int32_t {
  usage,    ///< the caller asked for something that makes no sense
  io,       ///< a file that cannot be read or written
  parse,    ///< a file that is not what its format promises
  invalid,  ///< well-formed input whose content is not acceptable
  plugin,   ///< a plugin that cannot be loaded or refuses its parameters
};

[[nodiscard]] std::string_view to_string(ErrorCode code) noexcept;

/// How many bytes from the beginning are UTF-8: all of them if it is UTF-8 text.
[[nodiscard]] std::size_t utf8_prefix(std::string_view text) noexcept;

/// Text for one line, whatever was in the file it speaks of: control characters become blanks, what is not UTF-8
/// question marks, and beyond 2000 bytes it is cut.
[[nodiscard]] std::string one_line(std::string_view text);

/// Bad input, found by a constructor, reader or loader. The text is one line: file, place, what is wrong, what was
/// expected. Numeric outcomes (a step that did not converge) are values, never exceptions.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, std::string_view what) : std::runtime_error(one_line(what)), code_(code) {}
  [[nodiscard]] ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

/// The version of this library, "major.minor.patch".
[[nodiscard]] std::string_view version() noexcept;

}  // namespace hamelin
