#pragma once
#include <cstdint>
#include <stdexcept>
#include <string_view>

namespace hamelin {

/// The kind of a fault. The program ends with exit code 2 on each of them.
enum class ErrorCode : std::int32_t {
  usage,    ///< the caller's arguments are not valid
  io,       ///< a file that cannot be read or written
  parse,    ///< a file that violates its format
  invalid,  ///< well-formed input whose content is not acceptable
  plugin,   ///< a plugin that cannot be loaded or refuses its parameters
};

[[nodiscard]] std::string_view to_string(ErrorCode code) noexcept;

/// Bad input, found by a constructor, reader or loader. The message is one line: file, place, what
/// is wrong, what was expected. Numeric outcomes (a step that did not converge) are return values,
/// never exceptions.
class Error : public std::runtime_error {
 public:
  Error(ErrorCode code, std::string_view message);
  [[nodiscard]] ErrorCode code() const noexcept { return code_; }

 private:
  ErrorCode code_;
};

/// The version of this library, "major.minor.patch".
[[nodiscard]] std::string_view version() noexcept;

}  // namespace hamelin
