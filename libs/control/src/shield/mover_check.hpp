#pragma once
#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <memory>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/shapes.hpp"
#include "shield/fail_safe.hpp"

namespace hamelin::control {

/// Proves that the arm stays clear of moving obstacles, as they are predicted, on a motion that
/// differs little from one call to the next: docs/theory.md (14.26)–(14.28). Distances are computed
/// at times of a coarse grid; each is remembered with the posture and the places of the obstacles,
/// and bounds the distances of later calls. One object per thread and kind of motion. No allocation
/// after construction.
class MoverCheck {
 public:
  static constexpr std::size_t movers_max = 64;
  static constexpr double horizon_s = 1.0;

  /// @param levers of the model, kept by reference
  MoverCheck(const model::Model& model, const scene::Levers& levers);

  /// The world as a check sees it.
  struct World {
    const scene::Environment& environment;
    double now_s;                 ///< when the obstacles are where they are
    double lead_s;                ///< from then to the time from which on a motion is checked
    std::span<const int> movers;  ///< at most movers_max indices of obstacles
  };
  /// Where the arm comes nearest to a moving obstacle.
  struct Threat {
    int obstacle = -1, shape = -1;
    double ahead_s = 0.0;
    Eigen::VectorXd q;                                    ///< the posture then
    Eigen::Vector3d point = Eigen::Vector3d::Zero();      ///< on the shape's axis, world
    Eigen::Vector3d direction = Eigen::Vector3d::Zero();  ///< unit, from obstacle to shape
  };
  /// What is proved of a motion.
  struct Proof {
    double least_m;  ///< lower bound of the distance in the time that was examined, at most far_m
    double clear_s;  ///< so long it stays clear by the margin
  };
  /// Checks a motion from a time on for a while, at most horizon_s. The examination ends where it
  /// is not clear.
  /// @param margin_m that must remain
  [[nodiscard]] Proof check(dynamics::Workspace& ws, const World& world, const FailSafe& motion,
                            double from_s, double for_s, double margin_m);
  static constexpr double far_m = 0.3;
  /// For obstacles of which only the speed is bounded: whether each shape is out of their reach, or
  /// does not come nearer to where they are now, docs/theory.md (14.28). The same arguments.
  [[nodiscard]] bool retreats(dynamics::Workspace& ws, const World& world, const FailSafe& motion,
                              double from_s, double for_s, double margin_m);
  /// Sets threat() to where the last check() that computed distances found the smallest.
  void find_threat(dynamics::Workspace& ws, const World& world);
  [[nodiscard]] const Threat& threat() const noexcept { return threat_; }
  /// Forgets what is remembered, because there are other obstacles.
  void forget() noexcept;

  /// Postures at which distances were computed since the start, for benchmarks and tests.
  [[nodiscard]] long evaluations() const noexcept { return evaluations_; }

 private:
  struct Place {
    Eigen::Matrix3d R;
    Eigen::Vector3d p, velocity;
    double nearer_m;
  };
  /// The arm and the obstacles at a time.
  struct Node {
    double ahead_s = 0.0;
    Eigen::VectorXd q, v;
    Place* places = nullptr;  ///< movers_max of them, one per obstacle
    double distance = 0.0;    ///< a lower bound, or exact
    bool exact = false;
    // what the distance was last computed for; negative: nothing
    double known = -1.0;
    Eigen::VectorXd known_q;
    Place* known_places = nullptr;
  };
  static constexpr int intervals = 20, depth_max = 3;

  void set(Node& node, const World& world, const FailSafe& motion, double from_s, double ahead_s);
  /// The bound that follows from what is known.
  [[nodiscard]] double bound(const Node& node, const World& world) const;
  /// Computes the distance at a node.
  void evaluate(Node& node, const World& world, dynamics::Workspace& ws);
  /// The lower bound of the distance between two nodes.
  [[nodiscard]] double between(const Node& a, const Node& b, const World& world) const;
  /// The same, with the interval divided where need be.
  double examine(const Node& a, const Node& b, int depth, dynamics::Workspace& ws,
                 const World& world, const FailSafe& motion, double from_s, double margin_m);

  const model::Model& model_;
  const scene::Levers& levers_;
  Eigen::VectorXd lever_, dq_;              ///< lever_: the largest of any shape, per joint
  std::array<double, movers_max> balls_{};  ///< bounding radii of the obstacles [m]
  std::vector<int> movers_;                 ///< of the last check
  std::vector<Node> nodes_, between_;
  /// Of all nodes. Unset at first, so that a scene without moving obstacles does not touch it.
  std::unique_ptr<Place[]> places_;
  scene::PlacedShapes arm_;
  std::vector<double> distances_;  ///< per shape and obstacle, of retreats()
  Threat threat_;
  double worst_ = 0.0;  ///< the smallest distance at a node of the last check
  long evaluations_ = 0;
};

}  // namespace hamelin::control
