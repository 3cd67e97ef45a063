#pragma once
#include <Eigen/Geometry>

#include "hamelin/core/rng.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/model/robot.hpp"

/// Random chains and joint vectors for tests, determined by a seed.
namespace hamelin::test {

inline Eigen::Vector3d random_vector(Rng& rng, double size = 1.0) {
  const double x = rng.uniform(-size, size), y = rng.uniform(-size, size);
  return {x, y, rng.uniform(-size, size)};
}

/// By at most 3 rad.
inline Eigen::Matrix3d random_rotation(Rng& rng) {
  const Eigen::Vector3d axis = random_vector(rng).normalized();
  return Eigen::AngleAxisd(rng.uniform(0.0, 3.0), axis).toRotationMatrix();
}

inline Eigen::VectorXd random_joints(Rng& rng, int n, double size = 1.0) {
  Eigen::VectorXd x(n);
  for (int i = 0; i < n; ++i) x[i] = rng.uniform(-size, size);
  return x;
}

/// Joint positions within the limits of a model, or within ±3 where it has none.
inline Eigen::VectorXd random_within_limits(const model::Model& model, Rng& rng) {
  Eigen::VectorXd q(model.dof());
  for (int i = 0; i < model.dof(); ++i) {
    const auto& joint = model.robot().links[static_cast<std::size_t>(i)].joint;
    q[i] = rng.uniform(joint.lower.value_or(-3.0), joint.upper.value_or(3.0));
  }
  return q;
}

inline Eigen::Matrix3d random_inertia(Rng& rng) {
  // A rotated random box, whose inertia is positive and satisfies the triangle inequality.
  const Eigen::Vector3d d = (random_vector(rng).cwiseAbs().array() + 0.1).square();
  const Eigen::Matrix3d R = random_rotation(rng);
  const Eigen::Matrix3d inertia =
      (d.sum() * Eigen::Matrix3d::Identity() - Eigen::Matrix3d(d.asDiagonal())) * 0.1;
  const Eigen::Matrix3d turned = R * inertia * R.transpose();
  return 0.5 * (turned + turned.transpose());
}

/// n links with random screws, poses and inertias. Every `prismatic_every`-th joint is prismatic
/// (0: none). Planar chains lie in a random plane, with joint axes along and against its normal.
inline model::Robot random_robot(std::uint64_t seed, int n, int prismatic_every = 0,
                                 bool planar = false) {
  Rng rng(seed);
  model::Robot robot;
  robot.name = "random";
  const Eigen::Vector3d normal = random_vector(rng).normalized();
  Eigen::Vector3d at = random_vector(rng, 0.2);
  for (int i = 0; i < n; ++i) {
    model::Link link;
    link.name = "link" + std::to_string(i);
    link.parent = i - 1;
    link.joint.name = "joint" + std::to_string(i);
    const bool slides = prismatic_every > 0 && i % prismatic_every == prismatic_every - 1;
    Eigen::Vector3d axis = random_vector(rng).normalized();
    if (planar && slides) axis = (axis - normal * normal.dot(axis)).normalized();
    if (planar && !slides) axis = i % 3 == 1 ? Eigen::Vector3d(-normal) : normal;
    if (slides) {
      link.joint.type = model::JointType::prismatic;
      link.joint.screw << Eigen::Vector3d::Zero(), axis;
    } else {
      link.joint.screw << axis, -axis.cross(at);
    }
    const Eigen::Vector3d com = at + random_vector(rng, 0.3);
    link.com = geometry::SE3{random_rotation(rng), com};
    link.mass_kg = rng.uniform(0.2, 3.0);
    link.inertia_kg_m2 = random_inertia(rng);
    link.spheres.push_back({random_vector(rng, 0.1), 0.05});
    robot.links.push_back(link);
    at += random_vector(rng, 0.4);
  }
  robot.tip = {"tip", n - 1, geometry::SE3{Eigen::Matrix3d::Identity(), at}};
  return robot;
}

}  // namespace hamelin::test
