#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/sweep/make_plan.hpp"

namespace hamelin::sweep {

/// A path in joint space with the position of a sphere that blocks it.
struct PathWithSphere {
  std::vector<Eigen::VectorXd> path;  ///< waypoints after the start, the goal last [rad or m]
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the sphere, world [m]
  Eigen::Vector3d swing = Eigen::Vector3d::Zero();   ///< from there to its farthest place [m]
  std::string reason;  ///< why there is no sphere; empty if there is one
};

/// Thins the nodes of a motion: each node is followed by the last one within `spacing` of it in
/// every joint, or by the next node if there is none. This omits detours that return to within
/// `spacing` of an earlier node. The first and the last node are kept.
[[nodiscard]] std::vector<Eigen::VectorXd> thin_path(const std::vector<Eigen::VectorXd>& nodes,
                                                     double spacing);

/// Searches a path of a scene with one joint goal, thins it, and searches a position for a sphere
/// on it. Candidates are the centres of the arm's moving balls, from the middle of the path
/// outwards, with the balls in an order that depends on the seed and the name of the scene. The
/// first candidate is taken that keeps the clearance of start and goal. A sphere swings at right
/// angles to the way of its ball, in a random direction in which it stays away from the base and
/// the first two links, which could not evade it.
/// @throws Error as control::plan_paths
[[nodiscard]] PathWithSphere place_sphere_on_path(const std::filesystem::path& scene_file,
                                                  const SphereOnPath& options);

}  // namespace hamelin::sweep
