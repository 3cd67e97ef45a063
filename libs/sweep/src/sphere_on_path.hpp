#pragma once
#include <Eigen/Core>
#include <filesystem>
#include <string>
#include <vector>

#include "hamelin/sweep/make_plan.hpp"

namespace hamelin::sweep {

/// A path in joints with a place for a sphere on it.
struct PathWithSphere {
  std::vector<Eigen::VectorXd> path;                 ///< way-points after the start, the goal last [rad or m]
  Eigen::Vector3d center = Eigen::Vector3d::Zero();  ///< of the sphere, world [m]
  std::string reason;                                ///< why there is none; empty if there is
};

/// Takes nodes of a motion from its end backwards: no step of a joint is larger than `spacing`, and where the motion
/// came back to within `spacing` of an earlier node, what it did in between is left out. The first and last node stay.
[[nodiscard]] std::vector<Eigen::VectorXd> thinned(const std::vector<Eigen::VectorXd>& nodes, double spacing);

/// Runs a scene with one joint goal by hybrid, thins its motion, and looks for a sphere's place on it: the centre of a
/// moving ball of the arm on its way, from the middle outwards, balls in an order by seed and scene name, so that start
/// and goal keep their clearance from it.
/// @throws Error as simulation::run
[[nodiscard]] PathWithSphere put_sphere_on_path(const std::filesystem::path& scene_file, const SphereOnPath& wanted,
                                                const std::vector<std::filesystem::path>& plugin_directories);

}  // namespace hamelin::sweep
