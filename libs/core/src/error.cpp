#include "hamelin/core/error.hpp"

namespace hamelin {

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
