#pragma once
#include <vector>

#include "hamelin/fit/shape.hpp"
#include "hamelin/fit/solid.hpp"

namespace hamelin::fit {

struct CoverOptions {
  double excess_m = 0.025;  ///< how far a shape may stick out of the solid
  int count_max = 64;       ///< most shapes; with too few of them the excess is exceeded
  bool capsules = false;    ///< else balls
};

/// Shapes that together cover the whole surface of a solid.
struct Cover {
  std::vector<Shape> shapes;
  /// Largest radius minus least depth of the axis: no shape sticks out farther, docs/theory.md
  /// (13.31).
  double excess_bound_m = 0.0;
};

/// Covers the surface of a solid with few shapes: a local solution of the k-centre problem of
/// docs/theory.md (13.32). Radii are then raised until coverage is proven (see close_gaps).
/// Coordinates are multiples of 1e-5 m. The same input gives the same cover.
/// @param covered balls that already exist; what they hold need not be covered
[[nodiscard]] Cover cover(const Solid& solid, const std::vector<Shape>& covered,
                          const CoverOptions& options);

}  // namespace hamelin::fit
