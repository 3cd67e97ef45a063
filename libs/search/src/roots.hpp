#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/joint_box.hpp"
#include "hamelin/search/search.hpp"

namespace hamelin::search {

/// A configuration at which a goal is reached, with its clearance [m].
struct Root {
  Eigen::VectorXd q;
  double clearance;
};

/// Finds configurations at a goal, nearest to `start` first: the goal of a joint goal, or a clear
/// place within its tolerance; several solutions of inverse kinematics for a goal of the tip.
[[nodiscard]] std::vector<Root> find_roots(const model::Model& model, const dynamics::JointBox& box,
                                           const Settings& settings, const Problem& problem,
                                           Query& query, Rng& rng);

}  // namespace hamelin::search
