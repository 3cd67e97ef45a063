#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <string>

#include "escape.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "law.hpp"
#include "obstacles.hpp"
#include "params_schema.hpp"
#include "safety_filter.hpp"

namespace hamelin::hybrid {
namespace {

using Eigen::VectorXd;

constexpr double joint_limit_rate = 8.0;  // towards a joint limit no faster than this times what is left [1/s]
constexpr double steering_fade = 0.5;     // joint distance below which steering towards a joint target fades
constexpr double far_from_goal = 1.0, near_goal = 0.25;  // joint distances between which margins shrink

LawParams law_params(const Json& params) {
  return {params["cruise_speed"],      params["tip_speed_m_s"],       params["tip_turn_rad_s"],
          params["repulsion_range_m"], params["repulsion_speed_m_s"], params["steering_gain"],
          params["steering_range_m"]};
}

/// How far each joint can move the arm, relative to the one that can most: joints that move little need not be
/// searched as widely.
VectorXd lever_weights(const model::Model& model) {
  const int n = model.dof();
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, VectorXd::Zero(n));
  VectorXd lever = VectorXd::Zero(n);
  for (int j = n - 1; j >= 0; --j) {
    double beyond =
        j + 1 < n ? lever[j + 1] +
                        (ws.frames[static_cast<std::size_t>(j) + 1].p - ws.frames[static_cast<std::size_t>(j)].p).norm()
                  : (dynamics::tip_pose(model, ws).p() - ws.frames[static_cast<std::size_t>(j)].p).norm();
    for (const auto& sphere : model.spheres())
      if (sphere.link == j) beyond = std::max(beyond, sphere.center.norm());
    lever[j] = beyond;
  }
  return (lever / (0.25 * std::max(1e-9, lever.maxCoeff()))).cwiseMin(1.0).cwiseMax(0.3);
}

class Hybrid final : public planning::Planner {
 public:
  Hybrid(const planning::Host& host, const planning::Setup& setup, const Json& params)
      : host_(host),
        setup_(setup),
        model_(setup.model()),
        ws_(model_),
        law_(setup, model_, law_params(params)),
        obstacles_(setup, params["contact_radius_m"]),
        filter_(setup.dof(), Obstacles::max_points),
        stall_(params["stall_time_s"], 1.5),
        escape_(setup, lever_weights(model_), params["max_escapes"]),
        velocity_gain_(params["velocity_gain"]),
        drive_acceleration_(params["drive_acceleration"]),
        acceleration_max_(params["acceleration_max"]),
        brake_(params["brake_acceleration"]),
        rate_(params["approach_rate"]),
        margin_(std::max(params["margin_m"].get<double>(), 0.5 * setup.map_resolution_m())),
        goal_margin_(std::min(params["goal_margin_m"].get<double>(), margin_)),
        passes_(params["filter_passes"]),
        max_escapes_(params["max_escapes"]),
        escapes_(params["escape"] == "memory"),
        contact_radius_(params["contact_radius_m"]),
        clearance_at_goal_(setup.spheres().size()),
        contacts_at_(setup.spheres().size() * 4 + 16) {
    const int n = setup.dof();
    for (auto* x : {&q_, &v_, &u_, &x_, &bias_, &momentum_, &lower_, &upper_, &scratch_}) *x = VectorXd::Zero(n);
    M_ = Minv_ = Eigen::MatrixXd::Identity(n, n);
    identity_ = Eigen::MatrixXd::Identity(n, n);
    llt_.compute(identity_);  // takes its memory now
  }

  static double influence_m(const Json& params) { return params["contact_radius_m"]; }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    q_ = tick.q();
    v_ = tick.v();
    const auto& goal = setup_.goals()[tick.goal_index()];
    if (goal_ != &goal) take_goal(goal, tick.time_s());
    prepare(tick);

    const Target target{&goal, escaping_ ? &escape_.via() : nullptr};
    const double distance = law_.distance(model_, ws_, q_, target);
    set_margins(law_.distance(model_, ws_, q_, {&goal, nullptr}));
    law_.attract(model_, ws_, q_, target, u_);
    if (tick.speed_scale() < 1.0) u_ *= tick.speed_scale();
    law_.repel(obstacles_.points(), std::min(1.0, distance), u_);
    // steering turns faster than the law follows: near a joint target it would make the arm circle
    const bool joint_target = target.via != nullptr || goal.type == HAMELIN_GOAL_JOINT;
    law_.steer(model_, ws_, obstacles_.points(), Minv_, v_,
               joint_target ? std::min(1.0, distance / steering_fade) : 1.0, command);

    // the law's velocity one period on, of bounded acceleration
    const double dt = setup_.control_period_s();
    x_ = v_ + dt * (velocity_gain_ * (u_ - v_)).cwiseMin(drive_acceleration_).cwiseMax(-drive_acceleration_);
    project(dt, command);
    command.node_velocity() = x_;
    // what keeps that velocity through the step: gravity, and the Coriolis force at it
    dynamics::bias_torque(model_, ws_, q_, x_, bias_);
    command.held_torque() = bias_;
    mind_stall(tick, target, distance, command);
  }

 private:
  void take_goal(const hamelin_goal& goal, double time_s) {
    goal_ = &goal;
    escape_.restart();
    escaping_ = false;
    stall_.restart(time_s);
    std::fill(clearance_at_goal_.begin(), clearance_at_goal_.end(), contact_radius_);
    if (goal.type != HAMELIN_GOAL_JOINT) return;
    const std::size_t found =
        host_.closest_points({goal.q, static_cast<std::size_t>(setup_.dof())}, contact_radius_, contacts_at_);
    for (std::size_t i = 0; i < std::min(found, contacts_at_.size()); ++i) {
      auto& clearance = clearance_at_goal_[static_cast<std::size_t>(contacts_at_[i].sphere)];
      clearance = std::min(clearance, contacts_at_[i].distance_m);
    }
  }

  void prepare(const planning::Tick& tick) {
    dynamics::mass_matrix(model_, ws_, q_, M_);
    llt_.compute(M_);
    Minv_ = identity_;
    llt_.solveInPlace(Minv_);
    dynamics::bias_torque(model_, ws_, q_, v_, bias_);
    dynamics::forward_kinematics(model_, ws_, q_);
    obstacles_.update(model_, ws_, tick.contacts());
  }

  // Away from the goal the whole margin; near it what the goal's own pose leaves, or the small one for a tip goal.
  void set_margins(double goal_distance) {
    const bool joint = goal_->type == HAMELIN_GOAL_JOINT;
    const double w = joint ? std::clamp((goal_distance - near_goal) / (far_from_goal - near_goal), 0.0, 1.0)
                           : std::clamp((0.5 * goal_distance - 0.02) / 0.10, 0.0, 1.0);
    for (auto& point : obstacles_.points()) {
      const double leaves = clearance_at_goal_[static_cast<std::size_t>(point.sphere)] - goal_margin_;
      const double there = joint ? std::min(margin_, std::max(0.001, leaves)) : goal_margin_;
      point.margin = (1.0 - w) * there + w * margin_;
    }
  }

  // The approach speed that leaves room to brake: γx near the margin, continued C¹ by √(2a(x − a/2γ²)).
  [[nodiscard]] double approach_limit(double x, double brake) const {
    if (x <= brake / (rate_ * rate_)) return rate_ * x;
    return std::sqrt(2.0 * brake * (x - 0.5 * brake / (rate_ * rate_)));
  }

  // The deceleration along a row that torques and joint accelerations can give.
  [[nodiscard]] double braking(const VectorXd& row) {
    scratch_.noalias() = Minv_ * row;
    const double mobility = row.dot(scratch_);
    double brake = brake_;
    const auto effort = setup_.effort_max();
    for (int k = 0; k < setup_.dof(); ++k) {
      if (effort)
        brake = std::min(brake, mobility * std::max(0.1 * (*effort)[k], (*effort)[k] - std::abs(bias_[k])) /
                                    (std::abs(row[k]) + 1e-9));
      brake = std::min(brake, acceleration_max_ * mobility / (std::abs(scratch_[k]) + 1e-9));
    }
    return std::max(brake, 0.1);
  }

  void project(double dt, planning::Command& command) {
    filter_.begin(M_, Minv_);
    for (const auto& point : obstacles_.points()) {
      const double x = point.distance - point.margin;
      const double b = point.obstacle_speed - (x > 0.0 ? approach_limit(x, braking(point.row)) : rate_ * x);
      const double floor = point.obstacle_speed == 0.0 ? -rate_ * std::max(1e-9, point.distance - 0.5 * point.margin)
                                                       : std::numeric_limits<double>::infinity();
      (void)filter_.add_row(point.row, b, floor);
    }
    const auto velocity_max = setup_.velocity_max();
    if (velocity_max) {
      double over = 1.0;
      for (int k = 0; k < setup_.dof(); ++k) over = std::max(over, std::abs(x_[k]) / (*velocity_max)[k]);
      x_ /= over;
    }
    const auto q_lower = setup_.q_lower(), q_upper = setup_.q_upper();
    for (int k = 0; k < setup_.dof(); ++k) {
      double low = -std::numeric_limits<double>::infinity(), high = -low;
      if (velocity_max) low = -(*velocity_max)[k], high = (*velocity_max)[k];
      if (q_lower) low = std::max(low, joint_approach((*q_lower)[k] - q_[k], -1.0));
      if (q_upper) high = std::min(high, joint_approach((*q_upper)[k] - q_[k], 1.0));
      // the acceleration box gives way to nothing: what it cannot brake now it brakes as hard as it may
      const double slowest = v_[k] - dt * acceleration_max_, fastest = v_[k] + dt * acceleration_max_;
      lower_[k] = std::clamp(low, slowest, fastest);
      upper_[k] = std::clamp(high, slowest, fastest);
      if (lower_[k] > upper_[k]) lower_[k] = upper_[k] = std::clamp(0.5 * (low + high), slowest, fastest);
    }
    filter_.set_box(lower_, upper_);
    if (const auto effort = setup_.effort_max()) {
      momentum_.noalias() = M_ * v_;
      lower_ = momentum_ - dt * (*effort + bias_);
      upper_ = momentum_ + dt * (*effort - bias_);
      filter_.set_momentum_box(lower_, upper_);
    }
    const auto report = filter_.project(x_, passes_);
    command.set_accounts(report.energy_after_J - report.energy_before_J - report.recovery_J, report.recovery_J);
  }

  // Towards a joint limit `room` away (signed as `side`): braked with half the acceleration that is allowed.
  [[nodiscard]] double joint_approach(double room, double side) const {
    const double x = side * room;
    if (!std::isfinite(x)) return side * std::numeric_limits<double>::infinity();
    if (x <= 0.0) return side * joint_limit_rate * x;
    const double brake = 0.5 * acceleration_max_, bend = brake / (joint_limit_rate * joint_limit_rate);
    return side * (x <= bend ? joint_limit_rate * x : std::sqrt(2.0 * brake * (x - 0.5 * bend)));
  }

  void mind_stall(const planning::Tick& tick, const Target& target, double distance, planning::Command& command) {
    const double now = tick.time_s();
    const bool stalled = stall_.stalled(now, distance, v_.norm());
    if (escaping_) {
      const bool there = (escape_.via() - q_).lpNorm<Eigen::Infinity>() < 0.1;
      if (!there && !stalled && now < escape_until_s_) return;
      escaping_ = false;
      stall_.restart(now);
      return;
    }
    if (!stalled) return;
    if (!escapes_ || escape_.count() >= max_escapes_) {
      command.give_up(cause());
      return;
    }
    const double* goal = target.goal->type == HAMELIN_GOAL_JOINT ? target.goal->q : nullptr;
    escape_.next(q_, goal, [&](const VectorXd& via) {
      const std::size_t found =
          host_.closest_points({via.data(), static_cast<std::size_t>(via.size())}, margin_, contacts_at_);
      return found == 0;
    });
    std::array<char, 64> line{};
    const int size = std::snprintf(line.data(), line.size(), "stalled: escape %d", escape_.count());
    host_.info({line.data(), static_cast<std::size_t>(size)});
    escaping_ = true;
    escape_until_s_ = now + 1.2 + 0.05 * escape_.count();
    stall_.restart(now);
  }

  // What holds the arm: the filter's multipliers know.
  [[nodiscard]] std::string cause() {
    const auto& links = model_.robot().links;
    const auto points = obstacles_.points();
    int worst = -1;
    for (int i = 0; i < std::min<int>(filter_.row_count(), static_cast<int>(points.size())); ++i)
      if (filter_.row_multiplier(i) > 0.0 && (worst < 0 || filter_.row_multiplier(i) > filter_.row_multiplier(worst)))
        worst = i;
    if (worst >= 0) {
      const auto& point = points[static_cast<std::size_t>(worst)];
      const auto& name = links[static_cast<std::size_t>(point.link)].name;
      if (clearance_at_goal_[static_cast<std::size_t>(point.sphere)] < margin_ && point.margin < margin_)
        return "margin around the goal: link '" + name + "' is held off an obstacle that the goal is as near to";
      return "force balance: the pull to the goal is held by the obstacle next to link '" + name + "'";
    }
    for (int k = 0; k < setup_.dof(); ++k) {
      if (setup_.effort_max() && filter_.momentum_multiplier(k) > 0.0)
        return "torque limit of joint '" + links[static_cast<std::size_t>(k)].joint.name + "'";
      const double near = 0.02;
      if ((setup_.q_lower() && q_[k] - (*setup_.q_lower())[k] < near) ||
          (setup_.q_upper() && (*setup_.q_upper())[k] - q_[k] < near))
        return "joint limit: joint '" + links[static_cast<std::size_t>(k)].joint.name + "' cannot go on";
    }
    return "unreachable goal: nothing is in the way, but the arm comes no nearer";
  }

  planning::Host host_;
  planning::Setup setup_;
  model::Model model_;
  dynamics::Workspace ws_;
  Law law_;
  Obstacles obstacles_;
  SafetyFilter filter_;
  StallWatch stall_;
  Escape escape_;
  double velocity_gain_, drive_acceleration_, acceleration_max_, brake_, rate_, margin_, goal_margin_;
  int passes_, max_escapes_;
  bool escapes_;
  double contact_radius_;
  std::vector<double> clearance_at_goal_;
  std::vector<hamelin_contact> contacts_at_;
  VectorXd q_, v_, u_, x_, bias_, momentum_, lower_, upper_, scratch_;
  Eigen::MatrixXd M_, Minv_, identity_;
  Eigen::LLT<Eigen::MatrixXd> llt_;
  const hamelin_goal* goal_ = nullptr;
  bool escaping_ = false;
  double escape_until_s_ = 0.0;
};

}  // namespace
}  // namespace hamelin::hybrid

HAMELIN_PLANNER_PLUGIN(
    hamelin::hybrid::Hybrid, "hybrid", "0.1.0",
    "attraction, energy-neutral steering and short repulsion under a safety filter, with escape from stalls",
    params_schema);
