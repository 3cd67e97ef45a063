#pragma once
#include <string>

#include "hamelin/geometry/se3.hpp"

namespace hamelin::model {

/// @param where,what for the message: "where: the rotation of what …"
/// @throws Error invalid for a rotation that is none by more than rounding, or a position that is
///         not finite or longer than any real one
void check_pose(const geometry::SE3& g, const std::string& where, const char* what);

}  // namespace hamelin::model
