#pragma once
#include <string>
#include <string_view>

namespace hamelin {

/// A field of a line of CSV: quoted if it has a comma, a quote or a line break, with its quotes
/// doubled (RFC 4180).
[[nodiscard]] std::string csv_field(std::string_view text);

}  // namespace hamelin
