#pragma once
#include <Eigen/Geometry>
#include <optional>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/scene/goal.hpp"
#include "rotation.hpp"

namespace hamelin::scene {

[[nodiscard]] inline Json array(const Eigen::Ref<const Eigen::VectorXd>& v) {
  return std::vector<double>(v.data(), v.data() + v.size());
}

[[nodiscard]] inline Json quaternion_json(const Eigen::Matrix3d& R, const Quaternion& written) {
  if (rotation_of(written) == R) return written;
  Eigen::Quaterniond q(R);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return {q.w(), q.x(), q.y(), q.z()};
}

template <typename T>
[[nodiscard]] Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

[[nodiscard]] inline Json pose_json(const geometry::SE3& pose, const Quaternion& written) {
  return {{"position_m", array(pose.p())}, {"quaternion_wxyz", quaternion_json(pose.R(), written)}};
}

/// In the format of a scene's goals.
[[nodiscard]] Json goal_json(const Goal& goal);

}  // namespace hamelin::scene
