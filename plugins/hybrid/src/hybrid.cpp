#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/plugin.hpp"
#include "law.hpp"
#include "margins.hpp"
#include "memory.hpp"
#include "observer.hpp"
#include "obstacles.hpp"
#include "params_schema.hpp"
#include "rollout.hpp"
#include "roots.hpp"
#include "safety_filter.hpp"
#include "stall.hpp"
#include "surroundings.hpp"
#include "tree.hpp"
#include "vias.hpp"
#include "way.hpp"

namespace hamelin::hybrid {
namespace {

using Eigen::VectorXd;

constexpr double voxel_at_goal = 0.4;     // of a voxel is kept near a tip goal
constexpr double joint_limit_rate = 8.0;  // towards a joint limit no faster than this times what is left [1/s]
constexpr double brake_share = 0.6;       // of the braking that the limits allow a row alone: others want some too
constexpr double least_brake = 0.3;       // braking along a row that is counted on in any case [m/s²]
constexpr double steering_share = 0.1;    // of the torque limits, at most, goes into steering
constexpr double torque_share = 0.98;     // of the torque limits is planned with
constexpr double steering_fade = 0.5;     // distance below which steering fades
constexpr double path_ahead = 0.25, way_ahead = 0.15;  // how far before the arm the carrot runs on a path, on a way out
constexpr double path_beyond = 1.0, path_regained = 2.0;  // of a path, at an escape by memory and after it
constexpr double via_reached = 0.1, way_reached = 0.08;   // largest |error| of a joint

double or_else(const Json& value, double otherwise) {
  return value.is_null() ? otherwise : value.get<double>();
}

// k_p and k_v of a law e'' = k_p e − k_v e' give the gain k_p/k_v of a velocity that is followed with k_v.
LawParams law_params(const Json& params, bool own_gains) {
  const double gain =
      !own_gains || params["k_p"].is_null() ? 0.0 : params["k_p"].get<double>() / or_else(params["k_v"], 1.0);
  return {gain > 0.0 ? gain : 4.0,       gain > 0.0 ? gain : 3.0,  params["cruise_speed"],
          params["tip_speed_m_s"],       params["tip_turn_rad_s"], params["repulsion_range_m"],
          params["repulsion_speed_m_s"], params["steering_gain"],  params["steering_range_m"]};
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
    for (const auto& shape : model.shapes())
      if (shape.link == j)
        beyond = std::max({beyond, (shape.center - shape.half_axis).norm(), (shape.center + shape.half_axis).norm()});
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
        law_(setup, model_, law_params(params, true)),
        obstacles_(setup, params["contact_radius_m"]),
        surroundings_(host, setup),
        margins_(setup, margin_params(setup, params)),
        box_(setup, lever_weights(model_)),
        filter_(setup.dof(), Obstacles::max_points),
        stall_(params["stall_time_s"]),
        memory_(setup, box_, params["max_escapes"]),
        velocity_gain_(or_else(params["k_v"], params["velocity_gain"])),
        follow_gain_(params["velocity_gain"]),
        drive_acceleration_(params["drive_acceleration"]),
        acceleration_max_(params["acceleration_max"]),
        brake_(params["brake_acceleration"]),
        rate_(params["approach_rate"]),
        joint_damping_(params["joint_damping"]),
        contact_radius_(params["contact_radius_m"]),
        passes_(params["filter_passes"]),
        max_escapes_(params["max_escapes"]),
        search_steps_(params["search_steps"]),
        horizon_s_(setup.control_period_s()),
        path_(setup.dof(), path_room(setup)) {
    if (setup.sampled()) {
      const double period = setup.control_period_s();
      horizon_s_ = std::max(period, params["horizon_s"].get<double>());
      observer_.emplace(setup.dof(), period, static_cast<int>(std::lround(setup.delay_s() / period)));
    }
    const std::string escape = params["escape"];
    remembers_ = escape == "memory";
    if (escape == "rollouts" || escape == "tree") {
      rollout_ = std::make_unique<Rollout>(setup_, model_, law_params(params, false), margins_, surroundings_);
      roots_ = std::make_unique<Roots>(setup_, model_, law_params(params, false), box_, surroundings_);
      if (escape == "tree")
        search_ = std::make_unique<Tree>(setup_, *rollout_, *roots_, box_, margins_, surroundings_,
                                         params["search_budget"].get<int>());
      else
        search_ = std::make_unique<Vias>(setup_, *rollout_, *roots_, box_);
    }
    const int n = setup.dof();
    for (auto* x : {&q_, &v_, &u_, &x_, &via_, &bias_, &momentum_, &lower_, &upper_, &scratch_, &steering_})
      *x = VectorXd::Zero(n);
    M_ = M_inv_ = identity_ = Eigen::MatrixXd::Identity(n, n);
    terms_.reserve(Obstacles::max_points);
    llt_.compute(identity_);  // takes its memory now
  }

  static double influence_m(const Json& params) { return params["contact_radius_m"]; }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    q_ = tick.q();
    v_ = tick.v();
    const auto& goal = setup_.goals()[tick.goal_index()];
    if (goal_ != &goal) take_goal(goal, tick.time_s());
    prepare(tick);

    const Target target = choose_target();
    margins_.set(obstacles_.points(), law_.away(model_, ws_, q_, goal));
    double wanted = 0.0;
    if (mode_ == Mode::think) {
      u_.setZero();
    } else {
      wanted = law_.attract(model_, ws_, q_, target, u_);
      if (tick.speed_scale() < 1.0) u_ *= tick.speed_scale();
      const double distance = law_.distance(model_, ws_, q_, target);
      law_.repel(obstacles_.points(), std::min(1.0, distance), u_);
      // steering turns faster than the law follows: near a target it would make the arm circle
      if (!observer_)
        law_.steer(model_, ws_, obstacles_.points(), M_inv_, v_, std::min(1.0, distance / steering_fade), command);
    }
    bound_steering(command);

    // the law's velocity one horizon on, of bounded acceleration
    const double gain = target.via != nullptr ? follow_gain_ : velocity_gain_;
    x_ = v_ + horizon_s_ * (gain * (u_ - v_)).cwiseMin(drive_acceleration_).cwiseMax(-drive_acceleration_);
    project(command);
    if (observer_)
      answer_by_torque(command);
    else
      answer_by_velocity(command);
    if (joint_damping_ > 0.0) command.damping().setConstant(joint_damping_);
    mind_stall(tick.time_s(), target, wanted, command);
  }

 private:
  // What the arm goes for: the goal, an escape's way-point, or the way that a search found; or it stands while one is
  // under way.
  enum class Mode { goal, via, think, way };

  static MarginParams margin_params(const planning::Setup& setup, const Json& params) {
    MarginParams margins{};
    // a map may lack what fills less than half of a voxel
    const double voxel = setup.map_resolution_m();
    margins.away_m = std::max(params["margin_m"].get<double>(), voxel);
    margins.goal_m = std::min(std::max(params["goal_margin_m"].get<double>(), voxel_at_goal * voxel), margins.away_m);
    margins.slack_m = std::min(params["goal_margin_m"].get<double>(), margins.away_m);
    margins.self_m = params["self_margin_m"];
    return margins;
  }

  static Eigen::Index path_room(const planning::Setup& setup) {
    std::size_t most = 0;
    for (const auto& goal : setup.goals()) most = std::max(most, goal.path_points);
    return static_cast<Eigen::Index>(most);
  }

  void enter(Mode mode, double time_s) {
    mode_ = mode;
    stall_.restart(time_s);
  }

  void take_goal(const hamelin_goal& goal, double time_s) {
    goal_ = &goal;
    memory_.restart();
    escapes_ = 0;
    margins_.take_goal(surroundings_, goal, contact_radius_);
    path_.clear();
    const auto path = setup_.path(goal);
    for (Eigen::Index i = 0; i < path.cols(); ++i) path_.add(path.col(i));
    path_at_ = 0.0;
    enter(Mode::goal, time_s);
  }

  void prepare(const planning::Tick& tick) {
    dynamics::mass_matrix(model_, ws_, q_, M_);
    llt_.compute(M_);
    M_inv_ = identity_;
    llt_.solveInPlace(M_inv_);
    dynamics::bias_torque(model_, ws_, q_, v_, bias_);
    if (observer_) observer_->update(v_);
    dynamics::forward_kinematics(model_, ws_, q_);
    obstacles_.update(model_, ws_, tick.contacts(), tick.self_contacts());
  }

  Target choose_target() {
    if (mode_ == Mode::via) return {goal_, &memory_.via()};
    if (mode_ == Mode::way) {
      way_at_ = search_->way().carrot(way_at_, q_, way_ahead, via_);
      return {goal_, &via_, way_at_ < search_->way().length()};
    }
    if (path_.empty()) return {goal_};
    path_at_ = path_.carrot(path_at_, q_, path_ahead, via_);
    return {goal_, &via_, path_at_ < path_.length()};
  }

  // What is to shrink: the distance to the target, and what lies behind it.
  [[nodiscard]] double remaining(const Target& target) {
    double left = law_.distance(model_, ws_, q_, target);
    if (mode_ == Mode::way) left += search_->way().length() - way_at_;
    if (mode_ == Mode::goal && !path_.empty()) left += path_.length() - path_at_;
    return left;
  }

  // The node's velocity, and the torque that keeps it through the step: gravity, and the Coriolis force at it.
  void answer_by_velocity(planning::Command& command) {
    command.node_velocity() = x_;
    dynamics::bias_torque(model_, ws_, q_, x_, bias_);
    command.held_torque() = bias_;
  }

  // The torque that brings the velocity about over the horizon, as far as the nominal model and its observer know.
  void answer_by_torque(planning::Command& command) {
    scratch_ = (x_ - v_) / horizon_s_ - observer_->disturbance();
    torque_.noalias() = M_ * scratch_;
    torque_ += bias_;
    if (const auto effort = setup_.effort_max()) torque_ = torque_.cwiseMin(*effort).cwiseMax(-*effort);
    observer_->issue(torque_, v_, M_inv_, bias_);
    command.held_torque() = torque_;
  }

  // Steering may take a small share of the torques only: the rest is for braking.
  void bound_steering(planning::Command& command) {
    steering_.setZero();
    const auto effort = setup_.effort_max();
    if (!effort || command.gyroscopic().empty()) return;
    terms_.clear();
    for (const auto& term : command.gyroscopic())
      terms_.push_back({term.link, planning::vec3(term.point_link_m), planning::vec3(term.w_world)});
    dynamics::gyroscopic_torque(model_, ws_, q_, v_, terms_, steering_);
    double scale = 1.0;
    for (int k = 0; k < setup_.dof(); ++k)
      scale = std::min(scale, steering_share * (*effort)[k] / std::max(1e-12, std::abs(steering_[k])));
    for (auto& term : command.gyroscopic())
      for (auto& w : term.w_world) w *= scale;
    steering_ *= scale;
  }

  // The approach speed that leaves room to brake: γx near the margin and inside it, continued C¹ by √(2a(x − a/2γ²)).
  [[nodiscard]] double approach_limit(double x, double brake) const {
    if (x <= brake / (rate_ * rate_)) return rate_ * x;
    return std::sqrt(2.0 * brake * (x - 0.5 * brake / (rate_ * rate_)));
  }

  void project(planning::Command& command) {
    const double dt = horizon_s_;
    filter_.begin(M_, M_inv_);
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
      // the bias that is held is that of x, not of v; a little room covers the difference
      lower_ = -torque_share * *effort;
      upper_ = torque_share * *effort;
      const auto rate = setup_.effort_rate_max();
      if (rate && observer_ && observer_->ready()) {
        scratch_ = setup_.control_period_s() * *rate;
        lower_ = lower_.cwiseMax(observer_->last() - scratch_).cwiseMin(upper_);
        upper_ = upper_.cwiseMin(observer_->last() + scratch_).cwiseMax(lower_);
      }
      scratch_ = bias_ + steering_;
      if (observer_) scratch_.noalias() -= M_ * observer_->disturbance();
      lower_ = momentum_ + dt * (lower_ - scratch_);
      upper_ = momentum_ + dt * (upper_ - scratch_);
      filter_.set_momentum_box(lower_, upper_);
    }
    for (const auto& point : obstacles_.points()) {
      const double x = point.distance - point.margin;
      double wanted = point.obstacle_speed - approach_limit(x, brake_);
      const double now = point.row.dot(v_);
      // near its limit a row counts on, and asks for, no more braking than the boxes are sure to allow
      if (now - least_brake * dt < point.obstacle_speed - approach_limit(x, least_brake)) {
        const double room = filter_.room(point.row, v_);
        const double brake = std::clamp(brake_share * room / dt, least_brake, brake_);
        wanted = std::min(point.obstacle_speed - approach_limit(x, brake), now + room);
      }
      const double floor = point.obstacle_speed - rate_ * std::max(1e-9, point.distance - 0.5 * point.margin);
      (void)filter_.add_row(point.row, wanted, floor);
    }
    scratch_ = x_;
    const auto report = filter_.project(x_, passes_);
    held_ = (x_ - scratch_).norm() > 1e-3 * dt || obstacles_.clearance() < contact_radius_;
    const double share = setup_.control_period_s() / dt;
    command.set_accounts(share * (report.energy_after_J - report.energy_before_J - report.recovery_J),
                         share * report.recovery_J);
  }

  // Towards a joint limit `room` away (signed as `side`): braked with half the acceleration that is allowed.
  [[nodiscard]] double joint_approach(double room, double side) const {
    const double x = side * room;
    if (!std::isfinite(x)) return side * std::numeric_limits<double>::infinity();
    if (x <= 0.0) return side * joint_limit_rate * x;
    const double brake = 0.5 * acceleration_max_, bend = brake / (joint_limit_rate * joint_limit_rate);
    return side * (x <= bend ? joint_limit_rate * x : std::sqrt(2.0 * brake * (x - 0.5 * bend)));
  }

  void mind_stall(double now, const Target& target, double wanted, planning::Command& command) {
    if (remembers_ || search_) command.mind_own_stalls();
    if (mode_ == Mode::think) return think(now);
    const bool stalled = stall_.stalled(now, remaining(target), v_.norm(), wanted, held_);
    if (mode_ == Mode::via) {
      const bool there = (memory_.via() - q_).lpNorm<Eigen::Infinity>() < via_reached;
      if (!there && !stalled && now < via_until_s_) return;
      // the way-point may have led past what is blocked
      if (!path_.empty()) path_at_ = path_.nearest(path_at_, path_regained, q_, scratch_);
      return enter(Mode::goal, now);
    }
    if (mode_ == Mode::way && way_at_ >= search_->way().length()) {
      const bool there = (search_->way().end() - q_).lpNorm<Eigen::Infinity>() < way_reached;
      // the way to a tip goal ends at a pose that is as good as the goal: it is gone to the very end
      const bool stay = search_->arrives() && goal_->type != HAMELIN_GOAL_JOINT;
      if (there && (stalled || !stay)) {
        if (search_->arrives()) path_at_ = std::max(path_at_, search_->along());
        return enter(Mode::goal, now);
      }
    }
    if (stalled) escape(now, target, command);
  }

  void escape(double now, const Target& target, planning::Command& command) {
    if ((!remembers_ && !search_) || escapes_ >= max_escapes_) return command.give_up(cause());
    ++escapes_;
    std::array<char, 64> line{};
    const int size = std::snprintf(line.data(), line.size(), "stalled: escape %d", escapes_);
    host_.info({line.data(), static_cast<std::size_t>(size)});
    if (search_) {
      search_->begin(*goal_, q_, path_.empty() ? nullptr : &path_, path_at_);
      return enter(Mode::think, now);
    }
    // on a path what lies behind the block counts
    if (!path_.empty()) path_.at(path_at_ + path_beyond, via_);
    const auto distance = [&](const VectorXd& via) {
      if (target.via == nullptr) dynamics::forward_kinematics(model_, ws_, via);
      return law_.distance(model_, ws_, via, target);
    };
    const auto clear = [&](const VectorXd& via) {
      return surroundings_.clear(via, margins_.params().away_m, margins_.params().self_m);
    };
    memory_.next(q_, distance, clear);
    via_until_s_ = now + 1.2 + 0.05 * escapes_;
    enter(Mode::via, now);
  }

  // The arm stands while the search goes on.
  void think(double now) {
    if (!search_->advance(search_steps_)) return;
    if (search_->way().empty()) return enter(Mode::goal, now);
    way_at_ = 0.0;
    enter(Mode::way, now);
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
      if (margins_.tight_at_goal(point) && point.margin < margins_.params().away_m)
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
  Surroundings surroundings_;
  Margins margins_;
  JointBox box_;
  SafetyFilter filter_;
  StallWatch stall_;
  Memory memory_;
  std::unique_ptr<Rollout> rollout_;
  std::unique_ptr<Roots> roots_;
  std::unique_ptr<Search> search_;
  double velocity_gain_, follow_gain_, drive_acceleration_, acceleration_max_, brake_, rate_, joint_damping_,
      contact_radius_;
  int passes_, max_escapes_, search_steps_;
  double horizon_s_;                  ///< x is the velocity this much later
  std::optional<Observer> observer_;  ///< under sampled actuation
  bool remembers_ = false;
  Way path_;
  VectorXd q_, v_, u_, x_, via_, bias_, momentum_, lower_, upper_, scratch_, steering_, torque_;
  std::vector<dynamics::GyroscopicTerm> terms_;
  Eigen::MatrixXd M_, M_inv_, identity_;
  Eigen::LLT<Eigen::MatrixXd> llt_;
  const hamelin_goal* goal_ = nullptr;
  Mode mode_ = Mode::goal;
  bool held_ = false;  ///< the filter took something of the law's velocity
  int escapes_ = 0;
  double path_at_ = 0.0, way_at_ = 0.0, via_until_s_ = 0.0;
};

}  // namespace
}  // namespace hamelin::hybrid

HAMELIN_PLANNER_PLUGIN(
    hamelin::hybrid::Hybrid, "hybrid", "0.1.0",
    "attraction, energy-neutral steering and short repulsion under a safety filter, with escape from stalls",
    params_schema);
