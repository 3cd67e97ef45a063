#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <Eigen/SVD>
#include <algorithm>
#include <cmath>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;
using namespace hamelin;
using Vector6d = Eigen::Matrix<double, 6, 1>;
using Matrix6d = Eigen::Matrix<double, 6, 6>;

// Condition numbers of the Jacobian [rad, m] between which the motion towards a singular posture is
// slowed down, and stopped.
constexpr double slow_from = 17.0, stop_from = 30.0;
// Distance from obstacles below which the arm slows down [m]; at half of it, it stops.
constexpr double near_m = 0.02;
constexpr double gain = 8.0, velocity_gain = 40.0;  // as the planner hybrid [1/s]
constexpr double damping = 0.01, acceleration_max = 15.0, speed_max_m_s = 0.5;

/// What is used today, to compare with: a servo by damped least squares that slows down and stops
/// near singular postures and near obstacles, and resumes only if it is led away from them.
class Servo final : public planning::Planner {
 public:
  static constexpr std::uint32_t properties = HAMELIN_FOLLOWS_TARGETS + HAMELIN_TICK_ALLOCATES;

  Servo(const planning::Host&, const planning::Setup& setup, const Json&)
      : setup_(setup),
        model_(setup.model()),
        ws_(model_),
        J_(6, setup.dof()),
        next_J_(6, setup.dof()),
        u_(VectorXd::Zero(setup.dof())),
        x_(u_),
        step_(u_),
        torque_(u_) {}

  void tick(const planning::Tick& tick, planning::Command& command) override {
    const VectorXd q = tick.q(), v = tick.v();
    command.disable_stall_rule();
    dynamics::forward_kinematics(model_, ws_, q);
    jacobian(ws_, J_);
    const Vector6d twist = desired(tick.goal());
    Matrix6d G = J_ * J_.transpose();
    G.diagonal().array() += damping * damping;
    u_ = J_.transpose() * G.llt().solve(twist);
    u_ *= singularity_scale(q, twist) * collision_scale(tick);
    if (const auto limit = setup_.velocity_max()) {
      double excess = 1.0;
      for (int k = 0; k < setup_.dof(); ++k)
        excess = std::max(excess, std::abs(u_[k]) / (*limit)[k]);
      u_ /= excess;
    }
    const double T = setup_.control_period_s();
    x_ = v + T * (velocity_gain * (u_ - v)).cwiseMin(acceleration_max).cwiseMax(-acceleration_max);
    hold_joint_limits(q);
    if (setup_.sampled()) {
      step_ = (x_ - v) / T;
      dynamics::inverse_dynamics(model_, ws_, q, v, step_, torque_);
      command.held_torque() = torque_;
      return;
    }
    command.node_velocity() = x_;
    dynamics::bias_torque(model_, ws_, q, x_, torque_);
    command.held_torque() = torque_;
  }

 private:
  void jacobian(const dynamics::Workspace& ws, dynamics::Matrix6Xd& J) const {
    dynamics::frame_jacobian(model_, ws, model_.robot().tip.link,
                             dynamics::tip_pose(model_, ws).p(), J);
  }

  [[nodiscard]] Vector6d desired(const hamelin_goal& goal) const {
    using planning::vec3;
    const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
    const auto& c = goal.quaternion_wxyz;
    const Eigen::AngleAxisd turn(Eigen::Quaterniond(c[0], c[1], c[2], c[3]).toRotationMatrix() *
                                 tip.R().transpose());
    const Vector3d error = vec3(goal.position_world_m) - tip.p();
    Vector6d twist;
    twist << vec3(goal.angular_velocity_world_rad_s) + gain * turn.angle() * turn.axis(),
        vec3(goal.velocity_world_m_s) +
            error * std::min(gain, speed_max_m_s / std::max(1e-9, error.norm()));
    return twist;
  }

  [[nodiscard]] static double condition(const Eigen::JacobiSVD<Eigen::MatrixXd>& svd) {
    return svd.singularValues()[0] / std::max(1e-12, svd.singularValues()[5]);
  }

  [[nodiscard]] double singularity_scale(const VectorXd& q, const Vector6d& twist) {
    const Eigen::JacobiSVD<Eigen::MatrixXd> svd(J_, Eigen::ComputeThinU | Eigen::ComputeThinV);
    const double now = condition(svd);
    if (now < slow_from) return 1.0;
    // The direction of the tip in which the condition gets worse.
    dynamics::Workspace next(model_);
    step_ = q + 0.01 * svd.matrixV().col(5);
    dynamics::forward_kinematics(model_, next, step_);
    jacobian(next, next_J_);
    const double then = condition(Eigen::JacobiSVD<Eigen::MatrixXd>(next_J_));
    const double towards = svd.matrixU().col(5).dot(twist) * (then > now ? 1.0 : -1.0);
    if (towards <= 0.0) return 1.0;
    return std::clamp((stop_from - now) / (stop_from - slow_from), 0.0, 1.0);
  }

  [[nodiscard]] static double collision_scale(const planning::Tick& tick) {
    double nearest = near_m;
    for (const auto& contact : tick.contacts()) nearest = std::min(nearest, contact.distance_m);
    return std::clamp(2.0 * nearest / near_m - 1.0, 0.0, 1.0);
  }

  void hold_joint_limits(const VectorXd& q) {
    const auto lower = setup_.q_lower(), upper = setup_.q_upper();
    if (!lower || !upper) return;
    x_ = x_.cwiseMin(8.0 * (*upper - q)).cwiseMax(8.0 * (*lower - q));
  }

  planning::Setup setup_;
  model::Model model_;
  dynamics::Workspace ws_;
  dynamics::Matrix6Xd J_, next_J_;
  VectorXd u_, x_, step_, torque_;
};

}  // namespace

HAMELIN_PLANNER_PLUGIN(Servo, "servo", "0.1.0",
                       "Damped least squares that stop near singular postures and obstacles",
                       R"({"type": "object", "additionalProperties": false, "properties": {}})");
