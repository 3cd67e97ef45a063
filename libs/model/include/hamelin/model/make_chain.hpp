#pragma once
#include <string>

#include "hamelin/model/robot.hpp"

namespace hamelin::model {

/// A chain of equal links along +y.
struct ChainOptions {
  int links = 7;               ///< 1 … 10000
  std::string axes = "x,z,x";  ///< joint axes at q = 0, link by link, starting over at the list's end; of x, y, z
  double length_m = 0.2;       ///< of each link
  double mass_kg = 1.0;        ///< of each link
  double radius_m = 0.03;      ///< of each link, a solid cylinder
};

/// Link i (from 0) turns about axes[i mod count] through (0, i·length, 0) and ends at (0, (i + 1)·length, 0), its COM
/// in the middle: I_xx = I_zz = m(L²/12 + r²/4), I_yy = m r²/2. It collides by one capsule of that radius a link;
/// the tip is the last link's end. No limits.
/// @throws Error usage naming the option
[[nodiscard]] Robot make_chain(const ChainOptions& options);

}  // namespace hamelin::model
