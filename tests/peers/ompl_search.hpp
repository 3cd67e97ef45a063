#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "hamelin/dynamics/joint_box.hpp"
#include "hamelin/search/query.hpp"

namespace hamelin::peers {

/// A search between two configurations by one of OMPL's planners, on the motions of a query.
struct OmplSearch {
  std::string planner;  ///< one of ompl_planners()
  const dynamics::JointBox& box;
  const Eigen::VectorXd &start, &goal;
  search::Query& query;
  std::uint64_t seed;
  long checks_max;
};

/// RRTConnect, RRT, RRTstar, InformedRRTstar, BITstar; none where OMPL was not found.
[[nodiscard]] std::vector<std::string> ompl_planners();
/// The first path, as columns; of size zero if none was found.
/// @param simplifies whether OMPL's simplification of the path follows
[[nodiscard]] Eigen::MatrixXd ompl_search(const OmplSearch& search, bool simplifies);

}  // namespace hamelin::peers
