#pragma once
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace hamelin::reactive {

/// A point of the arm that is near an obstacle or another part of the arm, with its row a for the
/// law and the safety filter: docs/theory.md (10.1).
struct NearPoint {
  static constexpr int self = -100;  ///< value of `obstacle`: another part of the arm
  int shape = 0, link = 0;
  int obstacle = HAMELIN_OBSTACLE_MAP;
  double distance = 0.0;                 ///< [m]
  double margin = 0.0;                   ///< distance to keep [m]
  double obstacle_speed = 0.0;           ///< n·v_obs: speed at which the obstacle approaches [m/s]
  Eigen::Vector3d arm_point, direction;  ///< world; direction n from the obstacle to the arm
  Eigen::VectorXd row;                   ///< a = Jᵀ n: the distance's rate is a·v − n·v_obs
};

/// The near points at a configuration, at most max_points: the nearest pairs of the arm's own
/// parts, and for each link the nearest points at different places and in different directions.
class Obstacles {
 public:
  static constexpr int max_points = 64;
  static constexpr double self_radius_m = 0.10;  ///< self contacts beyond this distance are ignored

  Obstacles(const planning::Setup& setup, double radius);
  /// Selects near points from the contacts at a configuration q and computes their rows. ws must
  /// contain the forward kinematics at q.
  void update(const model::Model& model, const dynamics::Workspace& ws,
              const planning::Contacts& contacts, const planning::SelfContacts& self_contacts);
  [[nodiscard]] std::span<NearPoint> points() noexcept { return {points_.data(), count_}; }
  /// The smallest distance [m] to an obstacle or between parts of the arm, or the radius if all
  /// distances exceed it.
  [[nodiscard]] double clearance() const noexcept { return clearance_; }

 private:
  void select(const planning::Contacts& contacts);
  void add_self(const model::Model& model, const dynamics::Workspace& ws,
                const hamelin_self_contact& contact);

  struct Near {
    double distance;
    std::size_t contact;
  };
  struct Chosen {
    std::size_t contact;
    int before;  ///< the last one of the same link before it; −1: none
  };

  double radius_, clearance_ = 0.0;
  std::vector<int> shape_link_;
  std::vector<NearPoint> points_;
  std::vector<Near> near_;
  std::vector<Chosen> chosen_;
  std::vector<int> last_of_link_;  ///< into chosen_; −1: none
  std::size_t count_ = 0;
  Eigen::VectorXd row_;
};

}  // namespace hamelin::reactive
