#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/dynamics/kernel/dispatch.hpp"
#include "hamelin/dynamics/kernel/planar.hpp"
#include "hamelin/dynamics/kernel/spatial.hpp"
#include "kernels.hpp"
#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;
using Frame = Workspace::Frame;

Frame child_frame(const model::SpatialLink& l, const kernel::Spatial<double>::Placement& x,
                  const Matrix3d& R, const Vector3d& p) {
  Frame out;
  const Vector3d e1 = R.col(1) * l.cos_alpha + R.col(2) * l.sin_alpha;
  out.R.col(0) = R.col(0) * x.c + e1 * x.s;
  out.R.col(1) = e1 * x.c - R.col(0) * x.s;
  out.R.col(2) = R.col(2) * l.cos_alpha - R.col(1) * l.sin_alpha;
  out.p = p + R * Vector3d{x.p.x, x.p.y, x.p.z};
  out.axis = out.R.col(2);
  return out;
}

Frame child_frame(const model::PlanarLink& l, const kernel::Planar<double>::Placement& x,
                  const Matrix3d& R, const Vector3d& p) {
  Frame out;
  out.R.col(0) = R.col(0) * x.c + R.col(1) * x.s;
  out.R.col(1) = R.col(1) * x.c - R.col(0) * x.s;
  out.R.col(2) = R.col(2);
  out.p = p + R.col(0) * x.px + R.col(1) * x.py;
  out.axis = l.prismatic ? Vector3d(out.R.col(0)) : Vector3d(out.R.col(2) * l.direction);
  return out;
}

const Frame& frame(const Workspace& ws, int link) {
  return ws.frames[static_cast<std::size_t>(link)];
}

// Checks a link index that a caller gave.
void check_link(const char* function, const Workspace& ws, int link) {
  if (link < 0 || link >= ws.owner.dof) [[unlikely]]
    detail::refuse_link(function, link, ws.owner.dof);
}

// Of a function that reads the pose of a link.
void check_posed_link(const char* function, const Model& model, const Workspace& ws, int link) {
  (void)detail::Call::with_poses(function, model, ws.owner);
  check_link(function, ws, link);
}

int parent(const Model& model, int link) {
  return model.robot().links[static_cast<std::size_t>(link)].parent;
}

void check_shapes(const char* function, const char* argument, const Model& model,
                  const Workspace& ws, std::span<const Vector3d> given) {
  (void)detail::Call::with_poses(function, model, ws.owner);
  if (given.size() != model.shapes().size())
    detail::refuse_count(function, argument, given.size(), model.shapes().size());
}

}  // namespace

void gather_forces(const Model& model, Workspace& ws, double* tau) {
  for (int i = model.dof() - 1; i >= 0; --i) {
    const Frame& f = frame(ws, i);
    const auto& total = ws.forces[static_cast<std::size_t>(i)];
    tau[i] = f.axis.dot(is_prismatic(model, i) ? total.linear : total.angular);
    if (const int up = parent(model, i); up >= 0) {
      auto& parent_total = ws.forces[static_cast<std::size_t>(up)];
      parent_total.linear += total.linear;
      parent_total.angular += total.angular + (f.p - frame(ws, up).p).cross(total.linear);
    }
  }
}

Vector3d point_position(const Model& model, const Workspace& ws, int link,
                        const Vector3d& point_link) {
  check_posed_link("point_position", model, ws, link);
  return frame(ws, link).p + frame(ws, link).R * (model.com_in_frame(link) * point_link);
}

geometry::SE3 link_pose(const Model& model, const Workspace& ws, int link) {
  check_posed_link("link_pose", model, ws, link);
  return geometry::SE3{frame(ws, link).R, frame(ws, link).p} * model.com_in_frame(link);
}

geometry::SE3 tip_pose(const Model& model, const Workspace& ws) {
  (void)detail::Call::with_poses("tip_pose", model, ws.owner);
  const Frame& f = frame(ws, model.robot().tip.link);
  return geometry::SE3{f.R, f.p} * model.tip_in_frame();
}

void shape_centers(const Model& model, const Workspace& ws, std::span<Vector3d> centers) {
  check_shapes("shape_centers", "centers", model, ws, centers);
  std::size_t i = 0;
  for (const auto& s : model.shapes()) {
    const Frame& f = frame(ws, s.link);
    centers[i++] = f.p + f.R * s.center;
  }
}

void shape_half_axes(const Model& model, const Workspace& ws, std::span<Vector3d> half_axes) {
  check_shapes("shape_half_axes", "half_axes", model, ws, half_axes);
  std::size_t i = 0;
  for (const auto& s : model.shapes()) half_axes[i++] = frame(ws, s.link).R * s.half_axis;
}

void point_jacobian(const Model& model, const Workspace& ws, int link, const Vector3d& point_world,
                    Eigen::Ref<Matrix3Xd> J) {
  check_posed_link("point_jacobian", model, ws, link);
  detail::Call("point_jacobian", model, ws.owner).size("J (columns)", J.cols(), ws.owner.dof);
  J.setZero();
  for (int j = link; j >= 0; j = parent(model, j))
    J.col(j) = velocity_column(model, ws, j, point_world);
}

void frame_jacobian(const Model& model, const Workspace& ws, int link, const Vector3d& point_world,
                    Eigen::Ref<Matrix6Xd> J) {
  check_posed_link("frame_jacobian", model, ws, link);
  detail::Call("frame_jacobian", model, ws.owner).size("J (columns)", J.cols(), ws.owner.dof);
  J.setZero();
  for (int j = link; j >= 0; j = parent(model, j)) {
    if (!is_prismatic(model, j)) J.col(j).head<3>() = frame(ws, j).axis;
    J.col(j).tail<3>() = velocity_column(model, ws, j, point_world);
  }
}

void point_jacobian_transpose(const Model& model, const Workspace& ws, int link,
                              const Vector3d& point_world, const Vector3d& direction_world,
                              VectorRef row) {
  check_posed_link("point_jacobian_transpose", model, ws, link);
  detail::Call("point_jacobian_transpose", model, ws.owner).joints("row", row);
  // row may be one of them. NOLINTNEXTLINE(performance-unnecessary-copy-initialization)
  const Vector3d point = point_world, direction = direction_world;
  row.setZero();
  for (int j = link; j >= 0; j = parent(model, j))
    row[j] = direction.dot(velocity_column(model, ws, j, point));
}

namespace detail {

void forward_kinematics(const Model& model, Workspace& ws, const double* q) {
  const auto place = [&]<class Space>(Space, const auto& chain) {
    for (std::size_t i = 0; i < chain.links.size(); ++i) {
      const auto& l = chain.links[i];
      const auto x = Space::place(l, q[i]);
      ws.frames[i] = l.parent < 0 ? child_frame(l, x, model.root().R(), model.root().p())
                                  : child_frame(l, x, frame(ws, l.parent).R, frame(ws, l.parent).p);
    }
  };
  if (const auto* planar = std::get_if<model::PlanarChain>(&model.chain()))
    place(kernel::Planar<double>{}, *planar);
  else
    place(kernel::Spatial<double>{}, std::get<model::SpatialChain>(model.chain()));
  ws.owner.posed_id = ws.owner.id;
}

Vector3d point_velocity(const Model& model, const Workspace& ws, int link,
                        const Vector3d& point_world, const double* v) {
  check_link("point_velocity", ws, link);
  Vector3d velocity = Vector3d::Zero();
  for (int j = link; j >= 0; j = parent(model, j))
    velocity += velocity_column(model, ws, j, point_world) * v[j];
  return velocity;
}

void gyroscopic_torque(const Model& model, Workspace& ws, const double* q, const double* v,
                       std::span<const GyroscopicTerm> terms, double* tau) {
  for (const auto& term : terms) check_link("gyroscopic_torque", ws, term.link);
  forward_kinematics(model, ws, q);
  const int n = model.dof();
  for (int i = 0; i < n; ++i) {
    const Frame& f = frame(ws, i);
    auto& motion = ws.motions[static_cast<std::size_t>(i)];
    motion = {Vector3d::Zero(), Vector3d::Zero()};
    if (const int up = parent(model, i); up >= 0) {
      const auto& parent_motion = ws.motions[static_cast<std::size_t>(up)];
      motion = {parent_motion.angular,
                parent_motion.linear + parent_motion.angular.cross(f.p - frame(ws, up).p)};
    }
    (is_prismatic(model, i) ? motion.linear : motion.angular) += f.axis * v[i];
    ws.forces[static_cast<std::size_t>(i)] = {Vector3d::Zero(), Vector3d::Zero()};
  }
  for (const auto& term : terms) {
    const Vector3d arm =
        point_position(model, ws, term.link, term.point_link) - frame(ws, term.link).p;
    const auto& motion = ws.motions[static_cast<std::size_t>(term.link)];
    const Vector3d force = term.w_world.cross(motion.linear + motion.angular.cross(arm));
    auto& total = ws.forces[static_cast<std::size_t>(term.link)];
    total.linear += force;
    total.angular += arm.cross(force);
  }
  gather_forces(model, ws, tau);
}

Matrix3d operational_inertia(const Model& model, Workspace& ws, const double* q,
                             const double* columns, Eigen::Index stride, double damping) {
  const Eigen::Map<const Matrix3Xd, 0, Eigen::OuterStride<>> J(columns, 3, ws.owner.dof,
                                                               Eigen::OuterStride<>(stride));
  Matrix3d inverse;
  kernel::with_group(model, *ws.kernels, [&](const auto& sweeps, const auto& chain) {
    sweeps.factor(chain, ws.sweep.get(), q);
    for (int c = 0; c < 3; ++c) {
      ws.column_in = J.row(c).transpose();
      sweeps.solve_factored(chain, ws.sweep.get(), ws.column_in.data(), ws.column_out.data());
      inverse.col(c).noalias() = J * ws.column_out;
    }
  });
  const Eigen::SelfAdjointEigenSolver<Matrix3d> eigen(0.5 * (inverse + inverse.transpose()));
  const Vector3d& d = eigen.eigenvalues();
  const Vector3d damped = d.array() / (d.array().square() + damping * damping);
  return eigen.eigenvectors() * damped.asDiagonal() * eigen.eigenvectors().transpose();
}

}  // namespace detail

}  // namespace hamelin::dynamics
