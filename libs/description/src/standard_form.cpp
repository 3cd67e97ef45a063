#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "detail.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"

namespace hamelin::description {

namespace {

using Eigen::Matrix3d;

// One pass of R → quaternion → R.
Matrix3d through_quaternion(const Matrix3d& R) {
  return geometry::rotation_from_wxyz(geometry::quaternion_wxyz(R));
}

Matrix3d rounded(Matrix3d R) {
  // The passes usually converge at once, because of rounding. A rotation that alternates between
  // neighbours is changed by a few roundings, which starts another sequence.
  constexpr int tries = 100, passes = 20;
  constexpr double roundings = 4e-16;
  Rng rng(0);
  for (int attempt = 0; attempt < tries; ++attempt) {
    for (int pass = 0; pass < passes; ++pass) {
      const Matrix3d next = through_quaternion(R);
      if (next == R) return R;
      R = next;
    }
    Eigen::Vector4d q = geometry::quaternion_wxyz(R);
    for (double& component : q) component += rng.uniform(-roundings, roundings);
    R = geometry::rotation_from_wxyz(q);
  }
  return R;
}

}  // namespace

void detail::check_triangle_inequality(Robot& robot, const std::string& link,
                                       const Matrix3d& inertia, bool strict,
                                       const std::string& where) {
  const std::string fault = model::triangle_fault(inertia);
  if (fault.empty()) return;
  if (strict)
    throw Error(ErrorCode::invalid, fmt::format("{}: link '{}': inertia {}", where, link, fault));
  const std::string warning =
      fmt::format("link '{}': inertia {}; it is used as given", link, fault);
  if (std::find(robot.warnings.begin(), robot.warnings.end(), warning) == robot.warnings.end())
    robot.warnings.push_back(warning);
}

void detail::round_to_quaternions(Robot& robot) {
  const auto round = [](const SE3& pose) { return SE3(rounded(pose.R()), pose.p()); };
  for (auto& link : robot.links) link.com = round(link.com);
  robot.tip.pose = round(robot.tip.pose);
  for (auto& frame : robot.frames) frame.pose = round(frame.pose);
}

std::string detail::normalise_screw(Joint& joint, const std::string& where) {
  constexpr double rounding = 1e-14;  // a vector that is a unit vector to within this is kept
  constexpr double worth_a_note = 1e-6;
  const double length = joint.type == JointType::revolute ? joint.screw.head<3>().norm()
                                                          : joint.screw.tail<3>().norm();
  if (!(length > 1e-9 && length < 1e9))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: the axis has length {}, expected a direction", where, length));
  if (std::abs(length - 1.0) > rounding) joint.screw /= length;
  if (std::abs(length - 1.0) <= worth_a_note) return {};
  return fmt::format("joint '{}': its axis had length {:.6g} and was normalised", joint.name,
                     length);
}

}  // namespace hamelin::description
