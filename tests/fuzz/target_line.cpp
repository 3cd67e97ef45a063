#include "loop/target_line.hpp"

#include <cmath>

#include "targets.hpp"

namespace hamelin::fuzz {

namespace {

void require_finite(const control::TargetPose& pose) {
  require(std::isfinite(pose.time_s) && pose.pose.p().allFinite() && pose.pose.R().allFinite(),
          "a pose is finite");
  require((pose.pose.R() * pose.pose.R().transpose() - Eigen::Matrix3d::Identity()).norm() < 1e-9,
          "the orientation of a pose is a rotation");
  for (const auto& vector :
       {pose.velocity_m_s, pose.acceleration_m_s2, pose.angular_velocity_rad_s})
    require(!vector || vector->allFinite(), "the motion of a pose is finite");
}

void require_finite(const control::TargetTwist& twist) {
  require(std::isfinite(twist.time_s) && twist.velocity_m_s.allFinite() &&
              twist.angular_velocity_rad_s.allFinite(),
          "a twist is finite");
}

}  // namespace

// Streams pass one line at a time, so a line break is a character as any other here.
void target_line(std::string_view bytes) {
  for (const bool position_only : {false, true}) {
    control::TargetSample sample;
    if (accepts("line", [&] { sample = control::read_target_line(bytes, "line", position_only); }))
      std::visit([](const auto& one) { require_finite(one); }, sample);
  }
}

}  // namespace hamelin::fuzz
