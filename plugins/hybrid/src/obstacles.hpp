#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::hybrid {

/// One near obstacle point as the law and the filter use it.
struct NearPoint {
  int sphere = 0, link = 0;
  double distance = 0.0;                 ///< [m]
  double margin = 0.0;                   ///< wanted here [m]
  double obstacle_speed = 0.0;           ///< n · v_obs: the obstacle comes this fast [m/s]
  Eigen::Vector3d arm_point, direction;  ///< world; direction from the obstacle to the arm
  Eigen::VectorXd row;  ///< a = Jᵀ n: a · v is the rate of the distance but for the obstacle's own motion
};

/// The contacts that count in a tick, bounded in number: of each link the nearest few with each obstacle.
class Obstacles {
 public:
  static constexpr int per_link = 6;
  static constexpr int max_points = 64;

  Obstacles(const planning::Setup& setup, double radius);
  /// Selects from a tick's contacts and computes the rows; poses at q must stand in ws.
  void update(const model::Model& model, const dynamics::Workspace& ws, std::span<const hamelin_contact> contacts);
  [[nodiscard]] std::span<NearPoint> points() noexcept { return {points_.data(), count_}; }

 private:
  double radius_;
  std::vector<int> sphere_link_;
  std::vector<NearPoint> points_;
  std::vector<std::size_t> chosen_;
  std::size_t count_ = 0;
};

}  // namespace hamelin::hybrid
