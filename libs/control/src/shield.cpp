#include "hamelin/control/shield.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// ω of docs/theory.md (14.13) [1/s]; feedback that is faster than the steps would oscillate.
constexpr double feedback_rate = 50.0, feedback_per_step = 0.2;
// A stop lasts at least this long, so that the planner's answer does not alternate with it [s].
constexpr double dwell_s = 0.005;
// A stop takes at least so many steps, or as many without torque limits: a torque that stops the
// arm at once would not resolve the motion.
constexpr double stop_steps = 4.0, unlimited_stop_steps = 10.0;
// The deviation from a stop's motion grows with the square of the step from here on.
constexpr double usual_step_s = 0.001;
// Velocities may exceed their limit by rounding.
constexpr double velocity_rounding = 1e-9;

double smallest_rest_time(const scene::Scene& scene, double period_s) {
  return period_s * (scene.model.torque_limits ? stop_steps : unlimited_stop_steps);
}

VectorXd optional_limits(bool modelled, const model::Model& model,
                         std::optional<double> model::Joint::*limit, double unlimited) {
  return modelled ? joint_limits(model.robot(), limit, unlimited) : VectorXd();
}

StopCause cause_of(const LineCheck::Blocker& blocker) {
  if (blocker.pair >= 0) return StopCause::self;
  if (blocker.obstacle == scene::Contact::map) return StopCause::map;
  return blocker.obstacle == scene::Contact::unknown ? StopCause::unknown_space
                                                     : StopCause::obstacle;
}

}  // namespace

std::string_view to_string(StopCause cause) noexcept {
  switch (cause) {
    case StopCause::map: return "map";
    case StopCause::unknown_space: return "unknown_space";
    case StopCause::obstacle: return "obstacle";
    case StopCause::self: return "self";
    case StopCause::joint_limit: return "joint_limit";
    case StopCause::velocity_limit: return "velocity_limit";
    case StopCause::torque: return "torque";
    case StopCause::answer: break;
  }
  return "answer";
}

Shield::Shield(const scene::Scene& scene, const model::Model& model, const scene::SelfField* self,
               double period_s)
    : model_(model),
      self_(self),
      scene_name_(scene.name),
      period_s_(period_s),
      margin_m_(scene.safety.margin_m),
      dwell_(std::lround(dwell_s / period_s)),
      feedback_rate_(std::min(feedback_rate, feedback_per_step / period_s)),
      lower_(optional_limits(scene.model.joint_limits, model, &model::Joint::lower, -infinity)),
      upper_(optional_limits(scene.model.joint_limits, model, &model::Joint::upper, infinity)),
      velocity_max_(optional_limits(scene.model.velocity_limits, model, &model::Joint::velocity_max,
                                    infinity)),
      effort_max_(
          optional_limits(scene.model.torque_limits, model, &model::Joint::effort_max, infinity)),
      damping_(joint_numbers(scene, scene.model.joint_damping, "joint_damping", model.robot(),
                             &model::Joint::damping)),
      friction_(joint_numbers(scene, scene.model.friction, "friction", model.robot(),
                              &model::Joint::friction)),
      friction_speed_(scene.model.friction_speed),
      torque_share_(scene.safety.torque_share),
      levers_(model, self),
      step_line_(model, levers_, self),
      stop_line_(model, levers_, self),
      braking_(model, torque_share_ * effort_max_, VectorXd(),
               1.0 / smallest_rest_time(scene, period_s)),
      ws_(model),
      stop_(model.dof()),
      tried_(model.dof()),
      arm_from_(model),
      arm_to_(model),
      arm_end_(model) {
  const Index n = model.dof();
  const double coarse = std::max(1.0, period_s / usual_step_s);
  stray_ = VectorXd::Constant(n, scene.safety.tracking_rad * coarse * coarse);
  for (auto* x :
       {&step_stray_, &zero_, &reference_q_, &reference_v_, &q_, &v_, &rate_})
    x->setZero(n);
}

double Shield::largest_margin_m() const {
  double largest = 0.0;
  for (Index i = 0; i < levers_.shapes().rows(); ++i)
    largest = std::max(largest, levers_.shapes().row(i).dot(stray_));
  return largest + margin_m_;
}

LineCheck::End Shield::place(const VectorXd& q, scene::PlacedShapes& arm) {
  dynamics::forward_kinematics(model_, ws_, q);
  arm.place(model_, ws_);
  return {q, arm.view()};
}

void Shield::notice(const Surroundings& world) {
  std::size_t existing = 0;
  for (const auto& obstacle : world.environment.obstacles())
    if (scene::exists(obstacle, world.time_s)) ++existing;
  if (snapshot_ == world.snapshot && existing == existing_) return;
  changed_ = snapshot_.has_value();
  snapshot_ = world.snapshot;
  existing_ = existing;
  step_line_.forget();
  stop_line_.forget();
}

void Shield::start(const Surroundings& world, const Node& node) {
  counts_ = {};
  stopping_ = false;
  run_ = 0;
  notice(world);
  if (verify(world, {node, node.v, node})) {
    std::swap(stop_, tried_);
    stop_time_ = 0.0;
    changed_ = false;
    return;
  }
  std::string expected;
  const double missing = refusal_.blocker.missing_m;
  switch (refusal_.cause) {
    case StopCause::torque:
      expected = fmt::format("/safety/torque_share: {} of the torque limits is too little to stop "
                             "at the start and hold the arm there, expected at least {:.2g}",
                             torque_share_, torque_share_ * braking_.utilisation());
      break;
    case StopCause::joint_limit:
    case StopCause::velocity_limit:
      expected = fmt::format("/start: {}, expected a start from which the arm can stop",
                             describe(world.environment));
      break;
    default:
      expected = margin_m_ >= missing
                     ? fmt::format("/safety/margin_m: at the start, {} by {} m, expected at most "
                                   "{:.3g} m",
                                   describe(world.environment), margin_m_,
                                   std::max(0.0, margin_m_ - missing))
                     : fmt::format("/safety: at the start, {} by the margin of {:.3g} m that its "
                                   "bounds require, expected bounds that require {:.3g} m less",
                                   describe(world.environment), largest_margin_m(), missing);
  }
  throw Error(ErrorCode::invalid, fmt::format("{}: {}", scene_name_, expected));
}

bool Shield::accept(const Surroundings& world, const Step& step) {
  const Node& to = step.to;
  ++counts_.steps;
  notice(world);
  const bool dwells = stopping_ && run_ < dwell_ && !at_rest();
  if (!dwells && to.q.allFinite() && to.v.allFinite() && verify(world, step)) {
    std::swap(stop_, tried_);
    stop_time_ = 0.0;
    stopping_ = changed_ = false;
    run_ = 0;
    return true;
  }
  if (!to.q.allFinite() || !to.v.allFinite()) refusal_ = {};
  if (changed_) check_overtaken(world, step.from);
  count_refusal();
  return false;
}

void Shield::refuse() {
  ++counts_.steps;
  refusal_ = {};
  count_refusal();
}

void Shield::count_refusal() {
  ++counts_.refused;
  if (at_rest()) ++counts_.at_rest;
  if (!stopping_) {
    ++counts_.stops;
    ++counts_.causes[static_cast<std::size_t>(refusal_.cause)];
  }
  stopping_ = true;
  counts_.longest = std::max(counts_.longest, ++run_);
}

void Shield::check_overtaken(const Surroundings& world, const Node& node) {
  changed_ = false;
  const LineCheck::End from = place(node.q, arm_from_), end = place(stop_.end(), arm_end_);
  if (stop_line_.check(ws_, &world.environment, world.time_s, from, end, zero_, 0.0))
    ++counts_.overtaken;
}

bool Shield::within_velocity(const VectorXd& from, const VectorXd& to) {
  for (Index j = 0; j < velocity_max_.size(); ++j) {
    if (std::abs(to[j]) <= velocity_max_[j] * (1.0 + velocity_rounding) ||
        std::abs(to[j]) <= std::abs(from[j]))
      continue;
    refusal_ = {StopCause::velocity_limit, {}, static_cast<int>(j)};
    return false;
  }
  return true;
}

// An arm that is beyond a limit may come back.
bool Shield::within_joint_limits(const VectorXd& from, const VectorXd& to) {
  for (Index j = 0; j < lower_.size(); ++j) {
    const auto beyond = [&](const VectorXd& q) {
      return std::max({q[j] - (upper_[j] - stray_[j]), lower_[j] + stray_[j] - q[j], 0.0});
    };
    const double now = beyond(from);
    if (beyond(to) <= now && beyond(tried_.line_start()) <= now && beyond(tried_.end()) <= now)
      continue;
    refusal_ = {StopCause::joint_limit, {}, static_cast<int>(j)};
    return false;
  }
  return true;
}

bool Shield::is_clear(LineCheck& line, const Surroundings& world, const LineCheck::End& from,
                      const LineCheck::End& to, const VectorXd& stray) {
  const auto blocker = line.check(ws_, world.environment.has_obstacles() ? &world.environment : nullptr,
                                  world.time_s, from, to, stray, margin_m_);
  if (!blocker) return true;
  refusal_ = {cause_of(*blocker), *blocker, -1};
  return false;
}

// In the order of cost: docs/theory.md (14.14).
bool Shield::verify(const Surroundings& world, const Step& step) {
  const auto& [from, departure, to] = step;
  if (!within_velocity(from.v, to.v) || !within_velocity(from.v, departure)) return false;
  const std::optional<double> rate = braking_.find(to.q, to.v);
  if (!rate) {
    refusal_ = {StopCause::torque, {}, -1};
    return false;
  }
  tried_.set(to.q, to.v, zero_, {*rate, 0.0, 0.0});
  if (!within_joint_limits(from.q, to.q)) return false;
  if (!world.environment.has_obstacles() && self_ == nullptr) return true;
  levers_.extend_travel(to.q, stray_);
  levers_.extend_travel(tried_.end(), stray_);
  const LineCheck::End at_from = place(from.q, arm_from_), at_to = place(to.q, arm_to_),
                       at_end = place(tried_.end(), arm_end_);
  // each step of the stop bends by as much as any other, docs/theory.md (12.2)
  step_stray_ = stray_ + 0.25 * period_s_ * period_s_ * *rate * to.v.cwiseAbs();
  if (!is_clear(stop_line_, world, at_to, at_end, step_stray_)) return false;
  step_stray_ = stray_ + 0.25 * period_s_ * (to.v - departure).cwiseAbs();
  return is_clear(step_line_, world, at_from, at_to, step_stray_);
}

void Shield::stop_torque(const Node& node, VectorXd& torque) {
  const double middle = stop_time_ + 0.5 * period_s_, end = stop_time_ + period_s_;
  stop_.at(stop_time_, reference_q_, reference_v_);
  counts_.strayed = std::max(counts_.strayed, (node.q - reference_q_).cwiseAbs().maxCoeff());
  rate_ = feedback_rate_ * (feedback_rate_ * (reference_q_ - node.q) +
                            2.0 * (reference_v_ - node.v));
  stop_.at(end, q_, v_);
  rate_ += (v_ - reference_v_) / period_s_;
  stop_.at(middle, q_, v_);
  dynamics::inverse_dynamics(model_, ws_, q_, v_, rate_, torque);
  if (damping_.size() > 0) torque += damping_.cwiseProduct(v_);
  if (friction_.size() > 0)
    torque.array() += friction_.array() * (v_ / friction_speed_).array().tanh();
  if (effort_max_.size() > 0) torque = torque.cwiseMin(effort_max_).cwiseMax(-effort_max_);
  stop_time_ = end;
}

std::string Shield::describe(const scene::Environment& environment) const {
  const auto joint = [&] {
    return refusal_.joint < 0
               ? std::string()
               : model_.robot().links[static_cast<std::size_t>(refusal_.joint)].joint.name;
  };
  const LineCheck::Blocker& blocker = refusal_.blocker;
  switch (refusal_.cause) {
    case StopCause::joint_limit:
      return fmt::format("joint '{}' would pass its position limit", joint());
    case StopCause::velocity_limit:
      return fmt::format("joint '{}' would pass its velocity limit", joint());
    case StopCause::torque: return "no stop within the torque limits would remain";
    case StopCause::answer: return "there is no usable answer";
    case StopCause::self:
      return fmt::format("{} would come too near each other", self_->describe(blocker.pair));
    default: break;
  }
  return fmt::format("{} would come too near {}",
                     model_.describe(model_.shapes()[static_cast<std::size_t>(blocker.shape)]),
                     environment.describe(blocker.obstacle));
}

}  // namespace hamelin::control
