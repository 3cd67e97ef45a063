#include "shield/shield.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "hamelin/control/planner_setup.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "loop/append_line.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// A stop lasts at least this long, so that the planner's answer does not alternate with it [s].
constexpr double dwell_s = 0.005;
// What planners are kept from limits beyond the shield's own margins: most of them pass their
// bounds a little [rad or m]; and as shares of the speed limits, where velocities are exact, which
// change a little within a step, and where they are not.
constexpr double planner_reserve = 0.002, exact_speed_reserve = 0.001, planner_speed_reserve = 0.02;
// What the shield keeps from speed limits, as a share, because velocities are not exact; and the
// share that it leaves in any case.
constexpr double sampled_speed_reserve = 0.02, estimated_speed_reserve = 0.1,
                 least_speed_share = 0.5;
// Steps in which a margin is sought that would do [m].
constexpr double smallest_m = 1e-9;
// The share of the speed limits that the move of an evasion uses.
constexpr double move_speed_share = 0.8;
// So many checks of a path's proof are made per step after the world has changed.
constexpr long path_checks = 16;
// Chords of a stop along a path where it is examined whether something has come in its way.
constexpr int path_chords = 16;
// Velocities may exceed their limit by rounding.
constexpr double velocity_rounding = 1e-9;

MoveTime::Limits move_limits(const scene::Scene& scene, const ModelledLimits& limits,
                             const ChangeBounds& changes, double period_s) {
  MoveTime::Limits out{scene::safety_bounds(scene).torque_share * limits.effort_max,
                       limits.velocity_max,
                       changes.acceleration_max,
                       changes.jerk_max,
                       StopFinder::ramp_share * changes.torque_rate,
                       StopFinder::least_time_s(false, period_s)};
  if (out.velocity_max.size() > 0) out.velocity_max *= move_speed_share;
  return out;
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
    case StopCause::map:
      return "map";
    case StopCause::unknown_space:
      return "unknown_space";
    case StopCause::obstacle:
      return "obstacle";
    case StopCause::self:
      return "self";
    case StopCause::joint_limit:
      return "joint_limit";
    case StopCause::velocity_limit:
      return "velocity_limit";
    case StopCause::torque:
      return "torque";
    case StopCause::answer:
      break;
  }
  return "answer";
}

Shield::Shield(const scene::Scene& scene, const model::Model& model, const scene::SelfField* self,
               double period_s, const ChangeBounds& changes)
    : model_(model),
      self_(self),
      scene_name_(scene.name),
      sampled_(scene.actuation.type != scene::ActuationType::ideal),
      period_s_(period_s),
      margin_m_(scene.safety.margin_m),
      dwell_(std::lround(dwell_s / period_s)),
      limits_(modelled_limits(scene, model.robot())),
      torque_share_(scene::safety_bounds(scene).torque_share),
      levers_(model, self),
      finder_(scene, model, period_s, changes),
      straying_(scene, model, levers_, period_s, Stop::feedback_rate(period_s),
                changes.torque_rate),
      stop_(scene, model, period_s, changes, finder_, &straying_),
      step_line_(model, levers_, self),
      ramp_line_(model, levers_, self),
      stop_line_(model, levers_, self),
      ws_(model),
      tried_(model.dof()),
      arm_from_(model),
      arm_to_(model),
      arm_line_(model),
      arm_end_(model),
      path_proof_(model, levers_, self),
      lead_s_(sampled_ ? scene.actuation.delay_s : 0.0),
      move_time_(model, move_limits(scene, limits_, changes, period_s)),
      move_line_(model, levers_, self),
      other_line_(model, levers_, self),
      stop_check_(model, levers_),
      move_check_(model, levers_),
      other_check_(model, levers_),
      force_check_(model, levers_),
      bounded_check_(model, levers_) {
  const Index n = model.dof();
  set_reserve(scene, scene.start_q.size() > 0 ? scene.start_q : VectorXd::Zero(n));
  for (auto* x : {&line_stray_, &zero_, &way_, &hold_, &path_q_, &path_v_, &path_a_, &e_, &e_rate_,
                  &e_acceleration_})
    x->setZero(n);
  path_effort_ = torque_share_ * limits_.effort_max;
  aside_ = zero_;
  asides_.emplace(model, limits_, reserve_.position, scene.seed);
  for (const auto& shape : model.shapes()) shape_names_.push_back(model.describe(shape));
  for (std::size_t k = 0; self != nullptr && k < self->pairs().size(); ++k)
    pair_names_.push_back(self->describe(static_cast<int>(k)));
  predicted_.reserve(MoverCheck::movers_max);
  bounded_.reserve(MoverCheck::movers_max);
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
  if (standing_ != world.standing || existing != existing_)
    path_proof_.forget(world.environment, world.time_s, path_cursor_.node);
  else
    path_proof_.see(world.environment, world.time_s);
  standing_ = world.standing;
  changed_ = snapshot_.has_value();
  snapshot_ = world.snapshot;
  existing_ = existing;
  step_line_.forget();
  ramp_line_.forget();
  stop_line_.forget();
  move_line_.forget();
  other_line_.forget();
  for (MoverCheck* check :
       {&stop_check_, &move_check_, &other_check_, &force_check_, &bounded_check_})
    check->forget();
}

void Shield::start(const Surroundings& world, const Node& node) {
  counts_ = {};
  stop_.set_strayed({});
  largest_margin_ = 0.0;
  notice(world);
  dynamics::gravity_torque(model_, ws_, node.q, hold_);
  if (!verify(world, {node, node.v, node, zero_, hold_, zero_}))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {}", scene_name_, defect_at_start(world, node)));
  take_tried();
}

// The arm may move and accelerate, and torques may be on their way: the stop begins where the next
// command acts, and goes on from what acts there.
bool Shield::start_in_place_of(const Shield& other, const Surroundings& world, const Node& node,
                               const StopFinder::Start& stop) {
  notice(world);
  if (!verify(world,
              {node, node.v, {stop.q, stop.v}, stop.acceleration, stop.torque, stop.disturbance}))
    return false;
  take_tried();
  counts_ = other.counts_;
  stop_.set_strayed(other.stop_.strayed());
  largest_margin_ = std::max(largest_margin_, other.largest_margin_);
  return true;
}

std::string Shield::defect_at_start(const Surroundings& world, const Node& node) {
  const std::string what = describe(world.environment);
  switch (refusal_.cause) {
    case StopCause::torque:
      return fmt::format(
          "/safety/torque_share: {} of the torque limits is too little to stop at the start and "
          "hold the arm there, expected at least {}",
          torque_share_, std::ceil(1e3 * torque_share_ * finder_.utilisation()) / 1e3);
    case StopCause::joint_limit:
    case StopCause::velocity_limit:
      return fmt::format("/start: {}, expected a start from which the arm can stop", what);
    default:
      break;
  }
  // The first that is in the way need not be the nearest.
  const double stated = margin_m_;
  bool enough = false;
  while (!enough && margin_m_ > 0.0) {
    margin_m_ = std::max(0.0, margin_m_ - refusal_.blocker.missing_m - smallest_m);
    enough = verify(world, {node, node.v, node, zero_, hold_, zero_});
  }
  const double would_do = std::exchange(margin_m_, stated);
  if (enough)
    return fmt::format("/safety/margin_m: at the start, {} by {} m, expected at most {:.3g} m",
                       what, stated, would_do);
  return fmt::format(
      "/safety: at the start, {} by the margin of {:.3g} m that its bounds require, expected "
      "bounds that require {:.3g} m less",
      what, stop_line_.largest_stray_m(), refusal_.blocker.missing_m);
}

void Shield::take_tried() {
  stop_.begin(tried_, straying_.bounds());
  stopping_ = changed_ = false;
  run_ = 0;
  if (stop_.motion().along_path()) {
    ++counts_.along_path;
    return;
  }
  largest_margin_ = std::max(largest_margin_, stop_line_.largest_stray_m());
  if (stop_.motion().stop().braking().ramp_s > 0.0)
    largest_margin_ = std::max(largest_margin_, ramp_line_.largest_stray_m());
}

bool Shield::accept(const Surroundings& world, const Step& step) {
  const Node& to = step.to;
  ++counts_.steps;
  notice(world);
  path_proof_.advance(path_checks);
  const bool movers = list_movers(world, step.from);
  const bool dwells = stopping_ && run_ < dwell_ && !stop_.at_rest();
  if (!dwells && to.q.allFinite() && to.v.allFinite() && verify(world, step) &&
      (!movers || allow_for_movers(world, step))) {
    take_tried();
    if (movers) note_proof();
    return true;
  }
  if (!to.q.allFinite() || !to.v.allFinite()) refusal_ = {};
  if (changed_) check_overtaken(world, step.from);
  if (movers) {
    go_on_among_movers(world);
    note_proof();
  }
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
  if (stop_.at_rest()) ++counts_.at_rest;
  if (!stopping_) {
    ++counts_.stops;
    ++counts_.causes[static_cast<std::size_t>(refusal_.cause)];
    if (stop_.motion().moves()) ++counts_.evasions;
  }
  stopping_ = true;
  counts_.longest = std::max(counts_.longest, ++run_);
}

void Shield::check_overtaken(const Surroundings& world, const Node& node) {
  changed_ = false;
  const FailSafe& motion = stop_.motion();
  const int chords = motion.along_path() ? path_chords : 1;
  const double from_s = stop_.time_s(), left_s = std::max(0.0, motion.stop_s() - from_s);
  bool blocked = false;
  way_ = node.q;
  const auto go_to = [&](const VectorXd& q) {
    const LineCheck::End from = place(way_, arm_from_), to = place(q, arm_end_);
    blocked = blocked || stop_line_
                             .check(ws_, &world.environment, world.time_s, from, to,
                                    {zero_, no_addition_, no_addition_, 0.0})
                             .has_value();
    way_ = q;
  };
  for (int k = 1; k < chords; ++k) {
    motion.at(from_s + left_s * k / chords, path_q_, path_v_);
    go_to(path_q_);
  }
  if (!stop_.has_stopped()) go_to(motion.stop_end());
  go_to(motion.end());
  if (blocked) ++counts_.overtaken;
}

bool Shield::within_velocity(const VectorXd& from, const VectorXd& to) {
  for (Index j = 0; j < limits_.velocity_max.size(); ++j) {
    if (std::abs(to[j]) <= speed_max_[j] * (1.0 + velocity_rounding) ||
        std::abs(to[j]) <= std::abs(from[j]))
      continue;
    refusal_ = {StopCause::velocity_limit, {}, static_cast<int>(j)};
    return false;
  }
  return true;
}

// An arm that is beyond a limit may come back. Within 0.3 of what is kept from a limit it may
// move; beyond that it must come back by more than noise can pretend. The step itself strays from
// the line between its ends by as much as (12.2) says.
bool Shield::within_joint_limits(const Step& step) {
  for (Index j = 0; j < limits_.q_lower.size(); ++j) {
    const double reserve = straying_.tracking()[j] + straying_.errors()[j];
    const auto beyond = [&](double least, double largest) {
      return std::max(
          {largest - (limits_.q_upper[j] - reserve), limits_.q_lower[j] + reserve - least, 0.0});
    };
    const double bend = 0.25 * period_s_ * std::abs(step.to.v[j] - step.departure[j]);
    const double now = beyond(step.from.q[j], step.from.q[j]);
    const double allowed = now > 0.0 ? std::max(0.3 * reserve, now - 2.0 * straying_.noise()) : 0.0;
    const StopMotion::Range stop = tried_.stop().range(j);
    if (beyond(step.to.q[j] - bend, step.to.q[j] + bend) <= allowed + (now > 0.0 ? bend : 0.0) &&
        beyond(stop.least, stop.largest) <= allowed)
      continue;
    refusal_ = {StopCause::joint_limit, {}, static_cast<int>(j)};
    return false;
  }
  return true;
}

bool Shield::is_clear(LineCheck& line, const Surroundings& world, const LineCheck::End& from,
                      const LineCheck::End& to, const VectorXd& stray, double more_m) {
  const auto blocker = line.check(
      ws_, world.environment.has_obstacles() ? &world.environment : nullptr, world.time_s, from, to,
      {stray, straying_.shapes(), straying_.errors(), margin_m_ + more_m});
  if (!blocker) return true;
  refusal_ = {cause_of(*blocker), *blocker, -1};
  return false;
}

bool Shield::verify(const Surroundings& world, const Step& step) {
  if (!within_velocity(step.from.v, step.to.v) || !within_velocity(step.from.v, step.departure))
    return false;
  return (path_proof_.path() != nullptr && verify_path(step)) || verify_line(world, step);
}

// In the order of cost.
bool Shield::verify_line(const Surroundings& world, const Step& step) {
  const Node &from = step.from, &to = step.to;
  if (!find_stop(step, BrakingRate::usual_utilisation)) return false;
  if (!stop_is_safe(world, step)) {
    // the shortest stop may be safe where a longer one is not
    const double rate = tried_.stop().braking().rate;
    const Refusal refusal = refusal_;
    const bool shorter = find_stop(step, BrakingRate::full_utilisation) &&
                         tried_.stop().braking().rate > 1.01 * rate && stop_is_safe(world, step);
    if (!shorter) {
      refusal_ = refusal;
      return false;
    }
  }
  if (!world.environment.has_obstacles() && self_ == nullptr) return true;
  // stop_is_safe() has placed the arm at the step's end
  const LineCheck::End at_from = place(from.q, arm_from_), at_to{to.q, arm_to_.view()};
  line_stray_ = straying_.tracking() + 0.25 * period_s_ * (to.v - step.departure).cwiseAbs();
  return is_clear(step_line_, world, at_from, at_to, line_stray_);
}

bool Shield::stop_is_safe(const Surroundings& world, const Step& step) {
  if (!within_velocity(step.from.v, tried_.stop().line_velocity())) return false;
  if (!within_joint_limits(step)) return false;
  if (!world.environment.has_obstacles() && self_ == nullptr) return true;
  levers_.extend_travel(step.to.q, straying_.tracking());
  levers_.extend_travel(tried_.end(), straying_.tracking());
  return stop_is_clear(world, place(step.to.q, arm_to_));
}

bool Shield::stop_is_clear(const Surroundings& world, const LineCheck::End& at_to) {
  const auto [rate, ramp, fade] = tried_.stop().braking();
  const LineCheck::End at_end = place(tried_.end(), arm_end_);
  // each step of the stop bends by as much as any other, docs/theory.md (12.2)
  line_stray_ = straying_.tracking() +
                0.25 * period_s_ * period_s_ * rate * tried_.stop().line_velocity().cwiseAbs();
  if (ramp == 0.0) return is_clear(stop_line_, world, at_to, at_end, line_stray_);
  const LineCheck::End at_line = place(tried_.stop().line_start(), arm_line_);
  if (!is_clear(stop_line_, world, at_line, at_end, line_stray_)) return false;
  line_stray_ += 0.125 * ramp * ramp *
                 tried_.stop().acceleration().cwiseAbs().cwiseMax(
                     rate * tried_.stop().line_velocity().cwiseAbs());
  return is_clear(ramp_line_, world, at_to, at_line, line_stray_);
}

bool Shield::find_stop(const Step& step, double least_utilisation) {
  const Node& to = step.to;
  if (!finder_.find({to.q, to.v, step.acceleration, step.torque, step.disturbance},
                    least_utilisation, tried_)) {
    refusal_ = {StopCause::torque, {}, -1};
    return false;
  }
  straying_.bound(tried_.stop());
  return true;
}

// Set points are exact, and so are the velocities of ideal actuation.
void Shield::set_reserve(const scene::Scene& scene, const VectorXd& q) {
  Straying::AtRest error = straying_.at_rest(q);
  reserve_.position = std::move(error.position);
  reserve_.position.array() += planner_reserve;
  straying_.bound_at_rest(q);
  const VectorXd& tracking = straying_.tracking();
  for (Index s = 0; s < levers_.shapes().rows(); ++s)
    reserve_.obstacles_m = std::max(
        reserve_.obstacles_m, margin_m_ + levers_.shapes().row(s).dot(tracking) +
                                  (straying_.shapes().size() > 0 ? straying_.shapes()[s] : 0.0));
  if (self_ != nullptr)
    reserve_.self_m = stop_line_.largest_pair_stray(
        {tracking, straying_.shapes(), straying_.errors(), margin_m_});
  speed_max_ = limits_.velocity_max;
  if (speed_max_.size() == 0) return;
  // of joints that have a limit
  const auto reserve_of = [&](const VectorXd& kept) {
    reserve_.velocity = limits_.velocity_max.array().isFinite().select(kept, 0.0);
  };
  if (!sampled_) return reserve_of(exact_speed_reserve * limits_.velocity_max);
  const bool estimates = scene.actuation.estimates_velocity;
  speed_max_ *= 1.0 - (estimates ? estimated_speed_reserve : sampled_speed_reserve);
  if (scene.actuation.type == scene::ActuationType::sampled) speed_max_ -= error.velocity;
  speed_max_ = speed_max_.cwiseMax(least_speed_share * limits_.velocity_max);
  reserve_of(limits_.velocity_max - speed_max_ + planner_speed_reserve * limits_.velocity_max);
}

Shield::Counts Shield::counts() const noexcept {
  Counts out = counts_;
  out.strayed = stop_.strayed().most;
  out.strayed_share = stop_.strayed().share;
  out.strayed_joint = stop_.strayed().joint;
  return out;
}

void Shield::describe(const scene::Environment& environment, LineBuffer& line) const {
  const auto joint = [&] {
    return refusal_.joint < 0
               ? std::string_view()
               : model_.robot().links[static_cast<std::size_t>(refusal_.joint)].joint.name;
  };
  const LineCheck::Blocker& blocker = refusal_.blocker;
  switch (refusal_.cause) {
    case StopCause::joint_limit:
      return append(line, "joint '{}' would pass its position limit", joint());
    case StopCause::velocity_limit:
      return append(line, "joint '{}' would pass its velocity limit", joint());
    case StopCause::torque:
      return append(line, "no stop within the torque limits would remain");
    case StopCause::answer:
      return append(line, "there is no usable answer");
    case StopCause::self:
      return append(line, "{} would come too near each other",
                    pair_names_[static_cast<std::size_t>(blocker.pair)]);
    default:
      break;
  }
  append(line, "{} would come too near ", shape_names_[static_cast<std::size_t>(blocker.shape)]);
  append_obstacle(line, environment, blocker.obstacle);
}

std::string Shield::describe(const scene::Environment& environment) const {
  LineBuffer line;
  describe(environment, line);
  return std::string(line.view());
}

}  // namespace hamelin::control
