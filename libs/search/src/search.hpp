#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "edges.hpp"
#include "hamelin/dynamics/joint_box.hpp"

namespace hamelin::search {

/// A search of one of OMPL's planners.
struct Search {
  scene::GuideType type;
  const dynamics::JointBox& box;
  const Eigen::VectorXd& start;
  const std::vector<Eigen::VectorXd>& goals;
  Edges& edges;
  std::uint64_t seed;
  long checks_end;      ///< ends without a path when Edges::checks() is this
  long improve_checks;  ///< for how many more a planner that optimises goes on
};

struct Found {
  Eigen::MatrixXd points;  ///< as Path::points; empty: none
  long first_checks = 0;   ///< Edges::checks() when the first path was found
  long states = 0;
};

/// @throws Error invalid if the build has no OMPL, or OMPL reports an error
[[nodiscard]] Found search(const Search& search);

}  // namespace hamelin::search
