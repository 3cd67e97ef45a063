#pragma once
#include <Eigen/Core>
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/levers.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "kernel/line_lanes.hpp"

namespace hamelin::search {

/// The constants of an arm for the kernels of LineCheck, and bounds of their rounding,
/// docs/theory.md (17.13)–(17.15).
class LineArm {
 public:
  static constexpr double unit_roundoff = 0x1p-24;
  static constexpr double step_max = 8.0;  ///< of a revolute joint on a line [rad]

  /// @param self null if self-collision is not modelled
  LineArm(const model::Model& model, const scene::SelfField* self);

  /// Sets the frame of the check, as its pose in the world.
  void place(const geometry::SE3& frame);

  /// Whether the kernels have room for it.
  [[nodiscard]] bool fits() const noexcept { return fits_; }
  [[nodiscard]] const kernel::Arm& view() const noexcept { return arm_; }
  /// Shape that a sphere stands for.
  [[nodiscard]] int shape_of(std::size_t sphere) const { return shape_of_[sphere]; }
  /// parts × dof: upper bounds of how far a joint moves any point of a part, (12.3).
  [[nodiscard]] const Eigen::MatrixXd& part_levers() const noexcept { return part_levers_; }
  [[nodiscard]] const scene::Levers& levers() const noexcept { return levers_; }
  /// Largest |q| of a prismatic joint for which the bounds hold; infinite for revolute joints.
  [[nodiscard]] double travel(Eigen::Index joint) const { return travel_[joint]; }

  /// No point of the arm is farther from the frame's origin [m].
  [[nodiscard]] double extent_m() const noexcept { return extent_; }
  /// Bound of the rounding of a position [m], and of a velocity per Σ |Δq| [m/rad].
  [[nodiscard]] double position_rounding_m() const noexcept { return position_rounding_; }
  [[nodiscard]] double velocity_rounding() const noexcept { return velocity_rounding_; }

 private:
  struct Ball {
    Eigen::Vector3d center;
    double radius, inner;
    int shape;
  };
  void add_parts(const scene::SelfField* self);
  void add_part(int link, const std::vector<int>& shapes);
  void add_shape(int shape, std::vector<Ball>& balls) const;
  void bound_rounding(const geometry::SE3& root);

  const model::Model& model_;
  scene::Levers levers_;
  bool fits_ = true;
  kernel::Arm arm_{};
  std::vector<kernel::Joint> joints_;
  std::vector<kernel::Part> parts_;
  std::vector<kernel::Sphere> spheres_;
  std::vector<kernel::Pair> pairs_;
  std::vector<int> shape_of_;
  std::vector<int> part_number_;  ///< of each SelfField::Part, in parts_
  /// Spheres and balls of fixed parts, in the world.
  std::vector<Eigen::Vector3d> fixed_centers_;
  Eigen::MatrixXd part_levers_;
  Eigen::VectorXd travel_;
  double extent_ = 0.0, position_rounding_ = 0.0, velocity_rounding_ = 0.0;
};

}  // namespace hamelin::search
