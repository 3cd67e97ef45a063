#include "hamelin/control/controller.hpp"

#include <algorithm>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// Obstacles are searched within this distance if the planner gives no other.
constexpr double default_influence_m = 0.2;
// Time in which an arm whose planner failed loses most of its speed, as far as accelerations allow.
constexpr double brake_time_s = 0.05;

double period_of(const scene::Scene& scene) {
  return scene.actuation.type == scene::ActuationType::ideal ? scene.step_s
                                                             : scene.actuation.control_period_s;
}

TorqueLimits limits_of(const scene::Scene& scene, const model::Model& model) {
  return {model,
          scene.model.torque_limits
              ? joint_limits(model.robot(), &model::Joint::effort_max, infinity)
              : VectorXd(),
          scene.actuation.torque_rate_max_Nm_s};
}

model::Model nominal_of(const scene::Scene& scene, const model::Model& arm) {
  check_numbers(scene, arm);
  return scaled_masses(arm, scene.actuation.planner_mass_scale);
}

}  // namespace

Controller::Controller(const std::filesystem::path& scene_file,
                       const std::vector<std::filesystem::path>& plugin_directories,
                       Options options)
    : Controller(scene::read_scene(scene_file), plugin_directories, std::move(options)) {}

Controller::Controller(const scene::Scene& scene,
                       const std::vector<std::filesystem::path>& plugin_directories,
                       Options options)
    : Controller(scene, load_model(scene), find_planner(scene, plugin_directories),
                 std::move(options)) {}

Controller::Controller(const scene::Scene& scene, const model::Model& arm,
                       const planning::Plugin& plugin, Options options)
    : Controller(scene, arm, plugin, planner_params(scene, plugin), std::move(options)) {}

Controller::Controller(const scene::Scene& given, const model::Model& arm,
                       const planning::Plugin& plugin, const Json& params, Options options)
    : scene_(given),
      options_(std::move(options)),
      period_s_(options_.period_s.value_or(period_of(scene_))),
      nominal_(nominal_of(scene_, arm)),
      world_(scene_, nominal_,
             {plugin.influence_m(params).value_or(default_influence_m), options_.obstacles_max,
              options_.prepare_maps}),
      view_(scene_, nominal_, world_),
      planner_(plugin, planner_setup(scene_, nominal_, view_, period_s_), params, view_,
               options_.log),
      goals_(scene_.goals, scene_.stall, nominal_),
      limits_(limits_of(scene_, nominal_)),
      sum_(nominal_, view_.contacts_max()),
      ws_(nominal_) {
  const VectorXd zero = VectorXd::Zero(nominal_.dof());
  answer_.torque = answer_.q_next = answer_.v_next = zero;
  q_ = v_ = rate_ = command_rate_ = zero;
}

void Controller::reset() {
  k_ = 0;
  goals_.restart();
  verdict_.reset();
  answer_.state = ControlState::running;
  answer_.cause = {};
}

const Answer& Controller::tick(double time_s, const VectorXd& q, const VectorXd& v) {
  observe(time_s, q, v);
  decide();
  return answer_;
}

void Controller::observe(double time_s, const VectorXd& q, const VectorXd& v) {
  const bool first = k_ == 0;
  q_ = q;
  v_ = v;
  time_s_ = time_s;
  verdict_.reset();
  if (options_.certify && !first) {  // against the world in which the arm moved
    view_.look(q, time_s);
    verdict_ = view_.certify(q, v);
    if (view_.take_newest()) view_.look(q, time_s);
  } else {
    (void)view_.take_newest();
    view_.look(q, time_s);
  }
  answer_.snapshot = view_.snapshot();
  if (answer_.state == ControlState::stopping) return;
  answer_.state = ControlState::running;
  answer_.cause = {};
  while (goals_.advance(view_.poses(), q, v)) continue;
  answer_.goal_index = goals_.index();
  if (goals_.all_reached())
    answer_.state = ControlState::reached;
  else if (!planner_.has_own_stall_rule() && goals_.stalled(view_.poses(), v, period_s_))
    answer_.state = ControlState::stalled;
}

void Controller::decide() {
  if (k_ == 0 && options_.torque) {
    dynamics::gravity_torque(nominal_, ws_, q_, answer_.torque);
    limits_.start_from(answer_.torque);
  }
  if (k_ == 0) {
    answer_.q_next = q_;
    answer_.v_next = v_;
    command_rate_.setZero();
  }
  const std::size_t goal = std::min(goals_.index(), goals_.size() - 1);
  if (answer_.state != ControlState::stopping) {
    if (!planner_.tick(k_, time_s_, q_, v_, goal)) {
      answer_.state = ControlState::stopping;
      answer_.cause = planner_.error();
    } else if (planner_.gave_up()) {
      answer_.state = ControlState::gave_up;
      answer_.cause = planner_.command().raw().cause;
    }
  }
  answer_.channels = answer_.state == ControlState::stopping ? nullptr : &planner_.command();
  if (options_.torque) form_torque();
  if (options_.position) form_position();
  if (options_.certify) view_.depart(q_, v_);
  ++k_;
}

void Controller::form_torque() {
  if (answer_.channels == nullptr)
    brake();
  else
    sum_.sum(ws_, *answer_.channels, q_, v_, q_, period_s_, 1.0, answer_.torque);
  answer_.saturated = limits_.limit(answer_.torque, period_s_);
}

// Accelerates against the velocity, with gravity and Coriolis torques compensated.
void Controller::brake() {
  rate_ =
      (-v_ / brake_time_s).cwiseMin(options_.acceleration_max).cwiseMax(-options_.acceleration_max);
  dynamics::inverse_dynamics(nominal_, ws_, q_, v_, rate_, answer_.torque);
}

// The velocity follows the planner's, or the one that the torque causes, within bounds of
// acceleration and jerk; the position integrates it.
void Controller::form_position() {
  const double T = period_s_;
  if (answer_.channels != nullptr && answer_.channels->raw().has_node_velocity != 0) {
    rate_ = (answer_.channels->node_velocity() - answer_.v_next) / T;
  } else {
    dynamics::forward_dynamics(nominal_, ws_, q_, v_, answer_.torque, rate_);
  }
  const double a = options_.acceleration_max, step = options_.jerk_max * T;
  for (Eigen::Index i = 0; i < rate_.size(); ++i) {
    const double bounded = std::clamp(rate_[i], -a, a);
    command_rate_[i] = std::clamp(bounded, command_rate_[i] - step, command_rate_[i] + step);
  }
  answer_.v_next += T * command_rate_;
  answer_.q_next += T * answer_.v_next;
}

}  // namespace hamelin::control
