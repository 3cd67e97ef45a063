#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/scene/obstacles.hpp"
#include "hamelin/sweep/judge.hpp"

/// Families of problems whose obstacles move.
namespace hamelin::bench {

/// The names of the families of moving obstacles, in the order of tables.
[[nodiscard]] const std::vector<std::string>& moving_families();
[[nodiscard]] bool is_moving(std::string_view family);
/// One line on what one of them is. @throws Error usage for an unknown family
[[nodiscard]] std::string_view describe_movers(std::string_view family);

/// Problems with as many obstacles that are as fast. People count as one obstacle each.
struct Cell {
  std::string family;
  std::size_t obstacles = 0;
  double speed_max_m_s = 0.0;  ///< of any point of an obstacle
};
/// The cells of the published set: cells of fewer and slower obstacles first.
[[nodiscard]] std::vector<Cell> cells(std::string_view family);

/// Longest simulated time of a run of this family [s].
[[nodiscard]] double duration_s(std::string_view family);

/// Draws the obstacles of a problem around an arm with its base at the origin: the ground first.
/// The same seed gives the same obstacles: positions are multiples of 0.1 mm.
/// @param ends start and goal of the arm as columns [rad]
/// @throws Error usage for an unknown family; invalid if there is no room for the obstacles
[[nodiscard]] std::vector<scene::Obstacle> make_movers(const Cell& cell, std::uint64_t seed,
                                                       const sweep::JudgedArm& arm,
                                                       const Eigen::MatrixXd& ends);

}  // namespace hamelin::bench
