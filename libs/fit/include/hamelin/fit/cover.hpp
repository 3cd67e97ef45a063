#pragma once
#include <vector>

#include "hamelin/fit/shape.hpp"
#include "hamelin/fit/solid.hpp"

namespace hamelin::fit {

struct CoverOptions {
  double excess_m = 0.025;  ///< how far a shape may stick out of the solid
  int count_max = 64;       ///< at most so many shapes; if they are too few, they stick out farther
  bool capsules = false;    ///< else balls
};

/// What covers a solid's surface wholly.
struct Cover {
  std::vector<Shape> shapes;
  double bulge_m = 0.0;  ///< radius less the least depth of the axis, at most: a bound of how far any shape sticks out
};

/// Few shapes that cover the surface of a solid: a greedy choice among segments between points of the solid's inside,
/// with the radius depth + excess, then, over and over, one shape less and the rest moved so that the largest
///     max_j min_i |x_j − axis_i| − depth(axis_i)
/// over surface points x_j is least; at last radii are raised until coverage is proven (see seal). Coordinates are
/// multiples of 1e-5 m. The same input gives the same cover.
/// @param covered balls that are there already; what they hold need not be covered
[[nodiscard]] Cover cover(const Solid& solid, const std::vector<Shape>& covered, const CoverOptions& options);

}  // namespace hamelin::fit
