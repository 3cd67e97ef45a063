#include "hamelin/core/error.hpp"

#include "hamelin/core/text.hpp"

namespace hamelin {

Error::Error(ErrorCode code, std::string_view message)
    : std::runtime_error(one_line(message)), code_(code) {}

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
