#pragma once
#include <Eigen/Core>
#include <functional>
#include <optional>
#include <vector>

#include "hamelin/core/rng.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/sweep/judge.hpp"

namespace hamelin::bench {

/// Rounds to a multiple of 0.1 mm.
[[nodiscard]] Eigen::Vector3d rounded_m(const Eigen::Vector3d& p);
[[nodiscard]] double rounded_m(double x);
/// A random direction: the corners of a cube are not cut off, so they are more likely.
[[nodiscard]] Eigen::Vector3d random_direction(Rng& rng);

/// The arm at its start, at its goal, and on the straight joint motion between them.
class ArmWay {
 public:
  /// @param ends start and goal as columns [rad]
  ArmWay(const sweep::JudgedArm& arm, const Eigen::MatrixXd& ends);

  /// Distance of the arm at the start (goal) from an obstacle at a time [m].
  [[nodiscard]] double start_clearance_m(const scene::Obstacle& obstacle, double time_s) const;
  [[nodiscard]] double goal_clearance_m(const scene::Obstacle& obstacle, double time_s) const;
  /// Whether the obstacle keeps this clearance from start and goal until a time [m].
  [[nodiscard]] bool stays_clear(const scene::Obstacle& obstacle, double until_s,
                                 double clearance_m) const;
  /// A random point of the forearm or the hand, on the way between two shares of it.
  [[nodiscard]] Eigen::Vector3d point(Rng& rng, double first_share, double last_share) const;

 private:
  [[nodiscard]] double clearance_m(const std::vector<Eigen::Vector3d>& centers,
                                   const scene::Obstacle& obstacle, double time_s) const;

  const sweep::JudgedArm& arm_;
  Eigen::MatrixXd ends_;
  std::vector<Eigen::Vector3d> at_start_, at_goal_;
  std::vector<std::size_t> outer_balls_;  ///< of the last three links
};

/// What people and pendulums keep from the arm at start and goal, at all times [m].
inline constexpr double always_clear_m = 0.05;

/// What is drawn.
struct MoverRequest {
  std::size_t count = 0;
  double speed_max_m_s = 0.0;
  double duration_s = 0.0;
};
using MakeMovers = std::vector<scene::Obstacle>(Rng&, const ArmWay&, const MoverRequest&);
MakeMovers make_cubes, make_people, make_pendulums;

/// Draws until one of them is accepted. @throws Error invalid after `draws_max` of them
[[nodiscard]] std::vector<scene::Obstacle> draw_accepted(
    const char* what, const std::function<std::optional<std::vector<scene::Obstacle>>()>& draw);

}  // namespace hamelin::bench
