#pragma once
#include <limits>

namespace hamelin {

inline constexpr double infinity = std::numeric_limits<double>::infinity();

}  // namespace hamelin
