#include "hamelin/dynamics/regressor.hpp"

#include <Eigen/Geometry>
#include <array>
#include <utility>

#include "kinematics.hpp"

namespace hamelin::dynamics {

namespace {

using Eigen::Index;
using Eigen::Matrix3d;
using Eigen::Vector3d;
using geometry::SE3;

constexpr std::array<std::pair<int, int>, 6> entries{
    {{0, 0}, {1, 1}, {2, 2}, {0, 1}, {0, 2}, {1, 2}}};

// How a link moves, by the origin of its joint-aligned frame, in the axes of that frame, where the
// root accelerates against gravity: (2.10).
struct Flow {
  Vector3d omega, rate, acceleration;
};

// The wrench that each parameter of a link needs: moments, then forces, (2.44).
using Wrenches = Eigen::Matrix<double, 6, inertial_parameters_per_link>;

Wrenches wrenches_of(const Flow& flow) {
  Wrenches out = Wrenches::Zero();
  out.col(0).tail<3>() = flow.acceleration;
  for (int k = 0; k < 3; ++k) {
    const Vector3d e = Vector3d::Unit(k);
    out.col(1 + k).head<3>() = e.cross(flow.acceleration);
    out.col(1 + k).tail<3>() = flow.rate.cross(e) + flow.omega.cross(flow.omega.cross(e));
  }
  for (Index k = 0; k < 6; ++k) {
    const auto [row, column] = entries[static_cast<std::size_t>(k)];
    const auto times = [&, i = row, j = column](const Vector3d& x) {
      Vector3d y = Vector3d::Zero();
      y[i] = x[j];
      y[j] = x[i];
      return y;
    };
    out.col(4 + k).head<3>() = times(flow.rate) + flow.omega.cross(times(flow.omega));
  }
  return out;
}

}  // namespace

VectorXd inertial_parameters(const Model& model) {
  VectorXd out(inertial_parameters_per_link * model.dof());
  for (int i = 0; i < model.dof(); ++i) {
    const model::Link& link = model.robot().links[static_cast<std::size_t>(i)];
    const SE3& com = model.com_in_frame(i);
    const Matrix3d inertia =
        com.R() * link.inertia_kg_m2 * com.R().transpose() + point_inertia(link.mass_kg, com.p());
    auto part = out.segment<inertial_parameters_per_link>(inertial_parameters_per_link * i);
    part[0] = link.mass_kg;
    part.segment<3>(1) = link.mass_kg * com.p();
    for (Index k = 0; k < 6; ++k) {
      const auto [row, column] = entries[static_cast<std::size_t>(k)];
      part[4 + k] = inertia(row, column);
    }
  }
  return out;
}

void inverse_dynamics_regressor(const Model& model, Workspace& ws, const ConstVectorRef& q,
                                const ConstVectorRef& v, const ConstVectorRef& a, MatrixRef Y) {
  constexpr Index per_link = inertial_parameters_per_link;
  detail::Call("inverse_dynamics_regressor", model, ws.owner)
      .joints("q", q)
      .joints("v", v)
      .joints("a", a)
      .size("Y (rows)", Y.rows(), ws.owner.dof)
      .size("Y (columns)", Y.cols(), per_link * ws.owner.dof);
  detail::forward_kinematics(model, ws, q.data());
  BodyMotion motion;
  motion.acceleration = -model.gravity();  // the root accelerates in place of weights
  for (int i = 0; i < model.dof(); ++i) {
    motion.advance(model, ws, i, v[i], a[i]);
    const Workspace::Frame& at = ws.frames[static_cast<std::size_t>(i)];
    Wrenches wrenches =
        wrenches_of({at.R.transpose() * motion.omega, at.R.transpose() * motion.omega_rate,
                     at.R.transpose() * motion.acceleration});
    wrenches.topRows<3>() = at.R * wrenches.topRows<3>();
    wrenches.bottomRows<3>() = at.R * wrenches.bottomRows<3>();
    for (int j = 0; j < model.dof(); ++j) {
      auto part = Y.row(j).segment<per_link>(per_link * i);
      if (j > i) {
        part.setZero();
        continue;
      }
      const Vector3d axis = ws.frames[static_cast<std::size_t>(j)].axis;
      part = velocity_column(model, ws, j, at.p).transpose() * wrenches.bottomRows<3>();
      if (!is_prismatic(model, j)) part += axis.transpose() * wrenches.topRows<3>();
    }
  }
}

namespace {

// The rate of a joint's screw, by the velocity that a rate of the joint gives to the point of space
// where a link's frame is now: docs/theory.md (2.47).
struct ScrewRate {
  Vector3d angular = Vector3d::Zero(), linear = Vector3d::Zero();
};

ScrewRate screw_rate(const Model& model, const Workspace& ws, int joint, const Vector3d& point) {
  const auto at = static_cast<std::size_t>(joint);
  const Workspace::Frame& frame = ws.frames[at];
  const Vector3d turned = ws.motions[at].angular.cross(frame.axis);
  if (is_prismatic(model, joint)) return {Vector3d::Zero(), turned};
  return {turned, turned.cross(point - frame.p) - frame.axis.cross(ws.motions[at].linear)};
}

// Wrenches per parameter, from the axes of a link's frame to those of the world.
Wrenches in_world(const Workspace::Frame& at, const Flow& flow) {
  Wrenches out = wrenches_of(flow);
  out.topRows<3>() = at.R * out.topRows<3>();
  out.bottomRows<3>() = at.R * out.bottomRows<3>();
  return out;
}

}  // namespace

void momentum_regressor(const Model& model, Workspace& ws, const ConstVectorRef& q,
                        const ConstVectorRef& v, MatrixRef P, MatrixRef L) {
  constexpr Index per_link = inertial_parameters_per_link;
  detail::Call("momentum_regressor", model, ws.owner)
      .joints("q", q)
      .joints("v", v)
      .size("P (rows)", P.rows(), ws.owner.dof)
      .size("P (columns)", P.cols(), per_link * ws.owner.dof)
      .size("L (rows)", L.rows(), ws.owner.dof)
      .size("L (columns)", L.cols(), per_link * ws.owner.dof);
  detail::forward_kinematics(model, ws, q.data());
  P.setZero();
  L.setZero();
  const Vector3d zero = Vector3d::Zero();
  BodyMotion motion;
  for (int i = 0; i < model.dof(); ++i) {
    motion.advance(model, ws, i, v[i], 0.0);
    const auto link = static_cast<std::size_t>(i);
    ws.motions[link] = {motion.omega, motion.velocity};
    const Workspace::Frame& at = ws.frames[link];
    const auto Rt = at.R.transpose();
    // a momentum is to the velocity what a wrench is to the acceleration from rest
    const Wrenches momentum = in_world(at, {zero, Rt * motion.omega, Rt * motion.velocity});
    const Wrenches weight = in_world(at, {zero, zero, Rt * model.gravity()});
    for (int j = 0; j <= i; ++j) {
      auto p = P.row(j).segment<per_link>(per_link * i);
      auto l = L.row(j).segment<per_link>(per_link * i);
      const ScrewRate rate = screw_rate(model, ws, j, at.p);
      const Vector3d column = velocity_column(model, ws, j, at.p);
      p = column.transpose() * momentum.bottomRows<3>();
      l = column.transpose() * weight.bottomRows<3>() +
          rate.linear.transpose() * momentum.bottomRows<3>() +
          rate.angular.transpose() * momentum.topRows<3>();
      if (is_prismatic(model, j)) continue;
      const Vector3d axis = ws.frames[static_cast<std::size_t>(j)].axis;
      p += axis.transpose() * momentum.topRows<3>();
      l += axis.transpose() * weight.topRows<3>();
    }
  }
}

model::Robot with_inertial_parameters(const Model& model, const VectorXd& parameters) {
  if (parameters.size() != inertial_parameters_per_link * model.dof())
    throw Error(ErrorCode::usage,
                formatted("with_inertial_parameters: {} numbers given, expected {}",
                          parameters.size(), inertial_parameters_per_link * model.dof()));
  model::Robot robot = model.robot();
  for (int i = 0; i < model.dof(); ++i) {
    model::Link& link = robot.links[static_cast<std::size_t>(i)];
    const auto part =
        parameters.segment<inertial_parameters_per_link>(inertial_parameters_per_link * i);
    const SE3& before = model.com_in_frame(i);
    const double mass = part[0];
    const Vector3d center = mass > 0.0 ? Vector3d(part.segment<3>(1) / mass) : before.p();
    Matrix3d inertia;
    for (Index k = 0; k < 6; ++k) {
      const auto [row, column] = entries[static_cast<std::size_t>(k)];
      inertia(row, column) = inertia(column, row) = part[4 + k];
    }
    inertia -= point_inertia(mass, center);
    const SE3 to_new(Matrix3d::Identity(), before.R().transpose() * (center - before.p()));
    for (model::Sphere& sphere : link.spheres) sphere.center_m -= to_new.p();
    for (model::Segment& segment : link.segments) {
      segment.from_m -= to_new.p();
      segment.to_m -= to_new.p();
    }
    link.com = link.com * to_new;
    link.mass_kg = mass;
    link.inertia_kg_m2 = model::symmetric_part(before.R().transpose() * inertia * before.R());
  }
  model::check(robot, robot.name);
  return robot;
}

}  // namespace hamelin::dynamics
