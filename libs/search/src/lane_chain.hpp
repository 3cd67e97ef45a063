#pragma once
#include <vector>

#include "hamelin/geometry/se3.hpp"
#include "hamelin/model/model.hpp"
#include "kernel/chain.hpp"

namespace hamelin::search {

/// Rounds three numbers to single precision.
void to_floats(const Eigen::Vector3d& from, float* to);

/// The joints of an arm for the kernels.
[[nodiscard]] std::vector<kernel::Joint> lane_joints(const model::Model& model);

/// Sets the root of a chain. @param frame of what is computed, as its pose in the world
void place_chain(const model::Model& model, const geometry::SE3& frame, kernel::Chain& chain);

/// The angle of the frame of each joint at q is turn · q + offset.
[[nodiscard]] double joint_offset(const model::Model& model, std::size_t joint);

}  // namespace hamelin::search
