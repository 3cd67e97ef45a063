#pragma once
#include <cstdint>
#include <stdexcept>
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

/// Bad input, found by a constructor, reader or loader. The text is one line: file, place, what is wrong, what was
/// expected. Numeric outcomes (a step that did not converge) are values, never exceptions.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, std::string_view what);
  [[nodiscard]] ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

/// The version of this library, "major.minor.patch".
[[nodiscard]] std::string_view version() noexcept;

}  // namespace hamelin
