#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/tip_constraint.hpp"

namespace hamelin::control {

/// What the tip keeps on the way to a goal, to first order, for planners: docs/theory.md (21.5). No
/// allocation after construction.
class KeptRows {
 public:
  explicit KeptRows(Eigen::Index dof);
  /// @param ws has the poses of a configuration @param constraints at most scene::constraints_max
  void update(const model::Model& model, const dynamics::Workspace& ws,
              const std::vector<scene::TipConstraint>& constraints);
  void clear() noexcept { count_ = 0; }
  [[nodiscard]] Eigen::Index size() const noexcept { return count_; }
  /// size() numbers [rad or m]: what is left of what plans use of each tolerance.
  [[nodiscard]] const double* slack() const noexcept { return slack_.data(); }
  /// size() times dof numbers: their derivatives by the joint positions.
  [[nodiscard]] const double* gradient() const noexcept { return gradient_.data(); }

 private:
  void add(const scene::AxisConstraint& axis, const geometry::SE3& tip);
  void add(const scene::BoxConstraint& box, const geometry::SE3& tip);
  void add(const scene::SpeedConstraint&, const geometry::SE3&) {}  // of motions, not of places

  dynamics::Matrix6Xd J_;
  Eigen::VectorXd slack_;
  Eigen::MatrixXd gradient_;  ///< one column each
  Eigen::Index count_ = 0;
};

}  // namespace hamelin::control
