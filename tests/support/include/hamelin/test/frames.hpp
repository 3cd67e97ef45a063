#pragma once
#include <string>

#include "hamelin/dynamics/frames.hpp"
#include "hamelin/test/exact_derivatives.hpp"
#include "hamelin/test/robots.hpp"

/// Chains with named frames, and the twists of their frames by products of exponentials.
namespace hamelin::test {

struct FrameCase {
  std::uint64_t seed;
  int n, prismatic_every;
  bool planar;
};

inline geometry::SE3 random_pose(Rng& rng) {
  const Eigen::Matrix3d R = random_rotation(rng);
  return {R, random_vector(rng, 0.5)};
}

/// A random chain with two frames on the base and on each link: "own-1", "lumped-1", "own0", ...
inline model::Model model_with_frames(std::uint64_t seed, int n, int prismatic_every, bool planar) {
  model::Robot robot = random_robot(seed, n, prismatic_every, planar);
  Rng rng(seed + 50);
  for (int link = -1; link < n; ++link)
    for (const char* kind : {"own", "lumped"})
      robot.frames.push_back({kind + std::to_string(link), link, random_pose(rng)});
  return model::Model(std::move(robot), random_pose(rng));
}

/// A frame's pose in the base frame at q = 0.
inline const geometry::SE3& pose_at_zero(const model::Model& model, int frame) {
  return frame == model::Model::tip_frame
             ? model.robot().tip.pose
             : model.robot().frames[static_cast<std::size_t>(frame - 1)].pose;
}

template <class Number>
typename ReferenceDynamics<Number>::Vector6c twist_of(
    const typename ReferenceDynamics<Number>::Motion& motion, dynamics::Reference reference) {
  using Reference = dynamics::Reference;
  const typename ReferenceDynamics<Number>::Matrix3c R = motion.Ad.template topLeftCorner<3, 3>();
  typename ReferenceDynamics<Number>::Vector6c local, aligned;
  local.template head<3>() = R.transpose() * motion.spatial.template head<3>();
  local.template tail<3>() =
      R.transpose() * (motion.spatial.template tail<3>() -
                       motion.Ad.template bottomLeftCorner<3, 3>() * local.template head<3>());
  aligned << R * local.template head<3>(), R * local.template tail<3>();
  if (reference == Reference::world) return motion.spatial;
  return reference == Reference::local ? local : aligned;
}

}  // namespace hamelin::test
