#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::hybrid {

/// One near point, of an obstacle or of another part of the arm, as the law and the filter use it.
struct NearPoint {
  static constexpr int self = -100;  ///< `obstacle`: another part of the arm
  int sphere = 0, link = 0;
  int obstacle = HAMELIN_OBSTACLE_MAP;
  double distance = 0.0;                 ///< [m]
  double margin = 0.0;                   ///< wanted here [m]
  double obstacle_speed = 0.0;           ///< n · v_obs: the obstacle comes this fast [m/s]
  Eigen::Vector3d arm_point, direction;  ///< world; direction from the obstacle to the arm
  Eigen::VectorXd row;  ///< a = Jᵀ n: a · v is the rate of the distance but for the obstacle's own motion
};

/// The points that count at a configuration, bounded in number: the nearest pairs of the arm's own parts, and of each
/// link the nearest points in each place and direction.
class Obstacles {
 public:
  static constexpr int max_points = 64;
  static constexpr double self_radius_m = 0.10;  ///< self contacts farther than this do not count

  Obstacles(const planning::Setup& setup, double radius);
  /// Selects from the contacts at a configuration and computes the rows; poses at q must stand in ws.
  void update(const model::Model& model, const dynamics::Workspace& ws, std::span<const hamelin_contact> contacts,
              std::span<const hamelin_self_contact> self_contacts);
  [[nodiscard]] std::span<NearPoint> points() noexcept { return {points_.data(), count_}; }
  /// The smallest distance to an obstacle or of the arm to itself, or the radius if all is farther [m].
  [[nodiscard]] double clearance() const noexcept { return clearance_; }

 private:
  void select(std::span<const hamelin_contact> contacts);
  void add_self(const model::Model& model, const dynamics::Workspace& ws, const hamelin_self_contact& contact);

  double radius_, clearance_ = 0.0;
  std::vector<int> sphere_link_;
  std::vector<NearPoint> points_;
  std::vector<std::size_t> near_, chosen_;
  std::size_t count_ = 0;
  Eigen::VectorXd row_;
};

}  // namespace hamelin::hybrid
