#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/model/model.hpp"
#include "hamelin/search/query.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::search {

/// A configuration at a goal.
struct Posture {
  Eigen::VectorXd q;
  double clearance_m = 0.0;
  std::size_t goal = 0;  ///< index of the goal
};

/// Many configurations at goals.
struct Postures {
  std::vector<Posture> found;  ///< in the order in which they were found
  long repeated = 0;           ///< clear ones that were too near to another
  GoalFigures figures;         ///< of all goals
};

/// Which are asked for.
struct PosturesWanted {
  std::size_t count = 10;
  double apart = 0.1;    ///< in some joint, from each other [rad or m]
  long attempts = 1000;  ///< at most about so many
};

/// Solutions of inverse kinematics that are clear, without repeats, seeded by the problem's number.
/// They come from starts all over the joint limits; docs/theory.md, chapter 17.
/// @param query its constraints are kept
/// @throws Error invalid as Search::begin() does
[[nodiscard]] Postures find_postures(const model::Model& model, const Settings& settings,
                                     const Problem& problem, Query& query,
                                     const PosturesWanted& wanted);

}  // namespace hamelin::search
