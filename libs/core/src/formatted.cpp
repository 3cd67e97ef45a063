#define FMT_HEADER_ONLY
#include "hamelin/core/formatted.hpp"

#include <fmt/format.h>

namespace hamelin {

std::string formatted_arguments(fmt::string_view text, fmt::format_args arguments) {
  return fmt::vformat(text, arguments);
}

}  // namespace hamelin
