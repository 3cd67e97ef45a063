#include "hamelin/dynamics/centroidal.hpp"

#include <Eigen/Geometry>

#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// Links as one rigid body: mass, centre of mass and inertia about it, world axes.
struct Body {
  double mass = 0.0;
  Vector3d center = Vector3d::Zero();
  Matrix3d inertia = Matrix3d::Zero();

  // docs/theory.md (2.40)
  void add(const Body& other) {
    if (!(mass + other.mass > 0.0)) {
      inertia += other.inertia;
      return;
    }
    const double share = other.mass / (mass + other.mass);
    const Vector3d apart = other.center - center;
    inertia += other.inertia + point_inertia(mass * share, apart);
    center += share * apart;
    mass += other.mass;
  }
};

Body body_of(const Model& model, const Workspace& ws, int link) {
  const model::Link& given = model.robot().links[static_cast<std::size_t>(link)];
  const geometry::SE3 com = link_pose(model, ws, link);
  return {given.mass_kg, com.p(), com.R() * given.inertia_kg_m2 * com.R().transpose()};
}

}  // namespace

double total_mass(const Model& model) {
  double mass = 0.0;
  for (const model::Link& link : model.robot().links) mass += link.mass_kg;
  return mass;
}

Vector3d center_of_mass(const Model& model, const Workspace& ws) {
  (void)detail::Call::with_poses("center_of_mass", model, ws.owner);
  const double mass = total_mass(model);
  if (!(mass > 0.0)) return ws.frames.front().p;
  Vector3d sum = Vector3d::Zero();
  for (int i = 0; i < model.dof(); ++i) {
    const double share = model.robot().links[static_cast<std::size_t>(i)].mass_kg / mass;
    const Workspace::Frame& at = ws.frames[static_cast<std::size_t>(i)];
    sum += share * (at.p + at.R * model.com_in_frame(i).p());
  }
  return sum;
}

// The twist of each link follows outwards; docs/theory.md (2.41).
Vector6d centroidal_momentum(const Model& model, const Workspace& ws, const ConstVectorRef& v) {
  detail::Call::with_poses("centroidal_momentum", model, ws.owner).joints("v", v);
  const Vector3d center = center_of_mass(model, ws);
  Vector3d angular = Vector3d::Zero(), linear = Vector3d::Zero();
  BodyMotion motion;
  for (int i = 0; i < model.dof(); ++i) {
    motion.advance(model, ws, i, v[i], 0.0);
    const Body body = body_of(model, ws, i);
    const Vector3d from_origin = body.center - ws.frames[static_cast<std::size_t>(i)].p;
    const Vector3d momentum = body.mass * (motion.velocity + motion.omega.cross(from_origin));
    linear += momentum;
    angular += body.inertia * motion.omega + (body.center - center).cross(momentum);
  }
  return (Vector6d() << angular, linear).finished();
}

// A joint moves the links outboard of it as one body; docs/theory.md (2.42).
void centroidal_matrix(const Model& model, const Workspace& ws, Eigen::Ref<Matrix6Xd> A) {
  detail::Call::with_poses("centroidal_matrix", model, ws.owner)
      .size("A (columns)", A.cols(), ws.owner.dof);
  const Vector3d center = center_of_mass(model, ws);
  Body outboard;
  for (int i = model.dof() - 1; i >= 0; --i) {
    outboard.add(body_of(model, ws, i));
    const Vector3d linear = outboard.mass * velocity_column(model, ws, i, outboard.center);
    Vector3d angular = (outboard.center - center).cross(linear);
    if (!is_prismatic(model, i))
      angular += outboard.inertia * ws.frames[static_cast<std::size_t>(i)].axis;
    A.col(i) << angular, linear;
  }
}

}  // namespace hamelin::dynamics
