#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <span>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/model.hpp"

namespace hamelin::scene {

/// The collision shapes of an arm at one configuration, in the world [m]: spheres, and capsules
/// about the axis from centre − half axis to centre + half axis. A view that does not own its data.
struct Shapes {
  std::span<const Eigen::Vector3d> centers;
  std::span<const double> radii = {};
  std::span<const Eigen::Vector3d> half_axes = {};  ///< empty if all are spheres; zero for spheres

  [[nodiscard]] std::size_t size() const noexcept { return centers.size(); }
  [[nodiscard]] bool is_capsule(std::size_t i) const {
    return !half_axes.empty() && !half_axes[i].isZero(0.0);
  }
  /// The ends of a capsule's axis.
  [[nodiscard]] Eigen::Vector3d from(std::size_t i) const { return centers[i] - half_axes[i]; }
  [[nodiscard]] Eigen::Vector3d to(std::size_t i) const { return centers[i] + half_axes[i]; }
  /// A view of one shape.
  [[nodiscard]] Shapes single(std::size_t i) const {
    return {centers.subspan(i, 1), radii.subspan(i, 1),
            half_axes.empty() ? half_axes : half_axes.subspan(i, 1)};
  }
};

/// Model::shapes() in the world; one object per thread, to be reused.
class PlacedShapes {
 public:
  PlacedShapes() = default;
  explicit PlacedShapes(const model::Model& model)
      : centers_(model.shapes().size()),
        half_axes_(model.has_capsules() ? model.shapes().size() : 0) {
    for (const auto& shape : model.shapes()) radii_.push_back(shape.radius);
  }

  /// Updates them to the poses in `ws`, after dynamics::forward_kinematics of the same model. No
  /// allocation.
  void place(const model::Model& model, const dynamics::Workspace& ws) {
    dynamics::shape_centers(model, ws, centers_);
    if (!half_axes_.empty()) dynamics::shape_half_axes(model, ws, half_axes_);
  }

  [[nodiscard]] Shapes view() const noexcept { return {centers_, radii_, half_axes_}; }

 private:
  std::vector<Eigen::Vector3d> centers_, half_axes_;
  std::vector<double> radii_;
};

/// The collision shapes of a robot's fixed base, in the world.
class BaseShapes {
 public:
  explicit BaseShapes(const model::Model& model);

  [[nodiscard]] Shapes view() const noexcept { return {centers_, radii_, half_axes_}; }

 private:
  std::vector<Eigen::Vector3d> centers_, half_axes_;
  std::vector<double> radii_;
};

}  // namespace hamelin::scene
