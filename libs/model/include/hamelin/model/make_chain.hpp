#pragma once
#include <string>

#include "hamelin/model/robot.hpp"

namespace hamelin::model {

/// A chain of equal links along +y.
struct ChainOptions {
  int links = 7;               ///< 1 … 10000
  std::string axes = "x,z,x";  ///< joint axes (x, y, z) at q = 0, repeated cyclically
  double length_m = 0.2;       ///< of each link
  double mass_kg = 1.0;        ///< of each link
  double radius_m = 0.03;      ///< of each link, a solid cylinder
};

/// Link i (from 0) turns about axes[i mod count] through (0, i·L, 0) and ends at (0, (i + 1)·L, 0),
/// with its COM in the middle. With length L, mass m and radius r of a link, its inertia is
/// I_xx = I_zz = m(L²/12 + r²/4), I_yy = m r²/2. Each link has one collision capsule of radius r.
/// The tip is the end of the last link. The joints have no limits.
/// @throws Error usage, which names the option
[[nodiscard]] Robot make_chain(const ChainOptions& options);

}  // namespace hamelin::model
