#include "near_boxes.hpp"

#include <algorithm>
#include <cmath>
#include <utility>

#include "loading.hpp"

namespace hamelin::mujoco {

using Eigen::Vector3d;

void NearBoxes::set_arm(std::vector<int> arm_shapes) {
  arm_shapes_ = std::move(arm_shapes);
  reference_.resize(arm_shapes_.size());
}

int NearBoxes::choose(const scene::BoxField& field, const geometry::SE3& map_pose,
                      const mjModel& model, const mjData& data) {
  const geometry::SE3 to_map = map_pose.inverse();
  chosen_.clear();
  chosen_.reserve(field.boxes().size());
  for (std::size_t i = 0; i < arm_shapes_.size(); ++i)
    reference_[i] = Eigen::Map<const Vector3d>(vector_of(data.geom_xpos, arm_shapes_[i]));
  for (std::size_t k = 0; k < field.boxes().size(); ++k) {
    if (!field.alive(k)) continue;
    const scene::Box& box = field.boxes()[k];
    const Vector3d center = map_pose * Vector3d(0.5 * (box.lo + box.hi));
    const double half_diagonal = 0.5 * (box.hi - box.lo).norm();
    for (std::size_t i = 0; i < arm_shapes_.size(); ++i) {
      const double reach = model.geom_rbound[arm_shapes_[i]] + slack_m;
      const double outer = reach + half_diagonal;
      if ((reference_[i] - center).squaredNorm() > outer * outer) continue;
      const Vector3d p = to_map * reference_[i];
      if ((p - p.cwiseMax(box.lo).cwiseMin(box.hi)).squaredNorm() > reach * reach) continue;
      chosen_.push_back(static_cast<int>(k));
      break;
    }
  }
  return static_cast<int>(chosen_.size());
}

double NearBoxes::moved_m(const mjData& data) const {
  double square = 0.0;
  for (std::size_t i = 0; i < arm_shapes_.size(); ++i) {
    const Eigen::Map<const Vector3d> now(vector_of(data.geom_xpos, arm_shapes_[i]));
    square = std::max(square, (now - reference_[i]).squaredNorm());
  }
  return std::sqrt(square);
}

void NearBoxes::place(const scene::BoxField& field, mjModel& model, int map_body) const {
  int geom = model.body_geomadr[map_body];
  for (const int k : chosen_) {
    const scene::Box& box = field.boxes()[static_cast<std::size_t>(k)];
    const Vector3d center = 0.5 * (box.lo + box.hi), half = 0.5 * (box.hi - box.lo);
    std::copy_n(center.data(), 3, vector_of(model.geom_pos, geom));
    std::copy_n(half.data(), 3, vector_of(model.geom_size, geom));
    model.geom_rbound[geom] = half.norm();
    ++geom;
  }
  model.body_geomnum[map_body] = static_cast<int>(chosen_.size());
}

}  // namespace hamelin::mujoco
