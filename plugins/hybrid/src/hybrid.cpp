#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <tuple>
#include <utility>

#include "evader.hpp"
#include "follower.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/planning/joint_path.hpp"
#include "hamelin/planning/plugin.hpp"
#include "params_schema.hpp"
#include "parts.hpp"
#include "stall.hpp"
#include "tuning.hpp"

namespace hamelin::hybrid {
namespace {

using Eigen::VectorXd;

// Distance of the carrot ahead of the arm on a path [rad or m].
constexpr double path_ahead = 0.25;
// The longest time for which an evasion keeps a stall from counting [s].
constexpr double longest_wait_s = 6.0;
// Largest |error| of a joint at the end of a path to a target [rad or m].
constexpr double path_end_reached = 0.1;
// An arm that is kept from its target, farther than so far [m and ½ rad], for so long and up to
// this share of the desired motion, asks for a way to it, and if there was none, asks again after
// the same time: the target moves on. To a target that rests it asks a few times.
constexpr double target_away = 0.06, target_blocked_s = 0.2, target_blocked_share = 0.3;
constexpr int target_searches = 3;
// An arm so near to the reference of a trajectory tracks it [rad or m], unless its clock hardly
// runs: then something holds the arm up, and the trajectory is a path.
constexpr double track_within = 0.1, track_rate_least = 0.1;
// It was planned to be clear, so it may come near to obstacles and joint limits fast: braking
// [m/s^2] and rate [1/s] as in (10.10).
constexpr double track_brake = 20.0;
double track_rate_within(double horizon_s) {
  return std::min(100.0, 0.5 / horizon_s);
}

class Hybrid final : public planning::Planner {
 public:
  static constexpr std::uint32_t properties =
      HAMELIN_FOLLOWS_TARGETS | HAMELIN_FOLLOWS_PATHS | HAMELIN_FOLLOWS_TRAJECTORIES |
      HAMELIN_ASKS_FOR_PATHS | HAMELIN_TRUSTS_CERTIFIED_PATHS;

  Hybrid(const planning::Host& host, const planning::Setup& setup, const Json& params)
      : host_(host),
        setup_(setup),
        model_(setup.model()),
        initial_params_(params),
        law_(setup, model_, Tuning(setup, params).law),
        drive_(setup, model_, params["contact_radius_m"], params["horizon_s"]),
        surroundings_(host, setup),
        margins_(setup, Tuning(setup, params).margins),
        evader_(host, setup_, model_, law_, margins_),
        follower_(setup, model_),
        stall_(params["stall_time_s"]),
        contact_radius_(params["contact_radius_m"]),
        asks_(params["escape"] == "search"),
        path_(setup.dof(), static_cast<Eigen::Index>(setup.path_points_max())) {
    if (params["steering"].get<bool>()) {
      steering_ = std::make_unique<Steering>(
          host, setup_, model_, Tuning(setup, params).law, margins_,
          SteeringParams{turn_kinds(params["turns"].get<std::string>())});
    }
    u_ = via_ = lower_ = upper_ = VectorXd::Zero(setup.dof());
    // Scenes in which nothing moves need no series.
    if (host.obstacles_ahead(0.0, HAMELIN_MOVING, {}) > 0) {
      evasion_series_ = host.declare_series("evasion", "");
      clearance_series_ = host.declare_series("clearance_ahead", "m");
    }
    if (steering_) turn_series_ = host.declare_series("turn", "s");
    apply_params(Tuning(setup, params));
  }

  [[nodiscard]] Tuning prepare_params(const Json& params) const {
    check_fixed_params(params, initial_params_);
    return {setup_, params};
  }
  void apply_params(const Tuning& tuning) {
    law_.set_params(tuning.law);
    if (steering_) steering_->set_params(tuning.law);
    margins_.set_params(tuning.margins);
    follower_.set_params(tuning.follow);
    target_velocity_gain_ = tuning.target_velocity_gain;
    tracking_gain_ = tuning.follow.gain;
    measure_margins_ = true;
    velocity_gain_ = tuning.velocity_gain;
    follow_gain_ = tuning.follow_gain;
    drive_acceleration_ = tuning.drive_acceleration;
    acceleration_max_ = tuning.acceleration_max;
    path_acceleration_ = tuning.path_acceleration;
    brake_ = tuning.brake_acceleration;
    rate_ = tuning.approach_rate;
    joint_damping_ = tuning.joint_damping;
    stall_.set_stall_time(tuning.stall_time_s);
    drive_.set_filter_passes(tuning.filter_passes);
    evader_.set_params(
        {velocity_gain_, follow_gain_, drive_acceleration_, acceleration_max_, rate_},
        tuning.look_budget, tuning.look_steps);
  }

  // A new start has a new goal_number, so set_goal() forgets what belongs to the goal.
  void reset(const planning::ConstVectorMap&, const planning::ConstVectorMap&) {
    evader_.reset();
    evades_since_s_ = 0.0;
  }

  static double influence_m(const Json& params) { return params["contact_radius_m"]; }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    drive_.update(tick);
    const auto& goal = tick.goal();
    if (goal_ == nullptr || goal_number_ != tick.goal_number()) set_goal(tick);
    if (measure_margins_) measure_margins();

    const Target target = choose_target();
    evader_.update(tick, arm(), course());
    tracks_ = tracks(tick);
    certified_ = tracks_ && tick.reference()->certified;
    if (tracks_)
      margins_.set_least(drive_.points());
    else
      margins_.set(drive_.points(), law_.margin_weight(model_, drive_.ws(), drive_.q(), goal));
    double closing_speed = 0.0;
    if (evader_.evades()) {
      evader_.velocity(drive_.q(), u_);
    } else if (mode_ == Mode::wait) {
      u_.setZero();
    } else if (follows() && mode_ == Mode::goal) {
      follow(tick);
      if (steers_to_target(tick.time_s())) turn_to_target(tick);
    } else if (tracks_) {
      track(tick);
    } else {
      closing_speed = law_.attract(model_, drive_.ws(), drive_.q(), target, u_);
      if (tick.speed_scale() < 1.0) u_ *= tick.speed_scale();
      const double distance = law_.distance(model_, drive_.ws(), drive_.q(), target);
      if (steering_ && mode_ == Mode::goal && path_.empty()) {
        look_for_turns(tick, distance);
        steering_->apply(drive_.M(), u_);
      }
      law_.repel(drive_.points(), std::min(1.0, distance), u_);
    }

    // The law's velocity after the horizon, with bounded acceleration: docs/theory.md (10.7).
    double gain = target.via != nullptr ? follow_gain_ : velocity_gain_,
           acceleration = drive_acceleration_;
    if ((follows() && mode_ == Mode::goal) || tracks_) gain = target_velocity_gain_;
    if (certified_) gain = certified_gain();
    if (tracks_) acceleration = pace().acceleration;
    if (evader_.evades()) gain = evasion_gain, acceleration = evasion_acceleration;
    // A reference accelerates as the motors can, so the velocity that counts is the present one.
    drive_.accelerate(u_, tracks_ ? drive_.v() : drive_.coasting_velocity(), gain, acceleration);
    drive(tick, command);
    if (joint_damping_ > 0.0) command.damping().setConstant(joint_damping_);
    if (follows())
      check_target(tick.time_s(), command);
    else if (tracks_)
      stall_.restart(tick.time_s());
    else
      check_stall(tick.time_s(), target, closing_speed, command);
    if (steering_) command.set_series(turn_series_, steering_->turn().left_s);
    if (!evader_.active()) return;
    command.set_series(evasion_series_, static_cast<double>(evader_.act()));
    if (const auto clearance = evader_.clearance_ahead())
      command.set_series(clearance_series_, *clearance);
  }

 private:
  // The arm heads for the goal, along its path if it has one; waits until it is shown where to wait
  // for a path; or follows a path to where its target was.
  enum class Mode { goal, wait, path_to_target };

  void enter(Mode mode, double time_s) {
    mode_ = mode;
    stall_.restart(time_s);
    least_left_ = std::numeric_limits<double>::infinity();
    progress_s_ = time_s;
  }

  void set_goal(const planning::Tick& tick) {
    const hamelin_goal& goal = tick.goal();
    goal_ = &goal;
    goal_number_ = tick.goal_number();
    if (steering_) steering_->restart();
    measure_margins_ = true;
    path_.clear();
    path_position_ = 0.0;
    searches_ = asks_;
    enter(Mode::goal, tick.time_s());
    if (!follows()) {
      take_path();
      if (path_.empty() && path_search() == HAMELIN_PATH_NOT_SOUGHT && tick.moving_count() == 0)
        (void)ask(tick.time_s());
      return;
    }
    anchor_.set(goal);
    follower_.start(drive_.q());
    awaits_path_ = false;
  }

  void take_path() {
    path_.clear();
    const auto path = setup_.path(*goal_);
    for (Eigen::Index i = 0; i < path.cols(); ++i) path_.add(path.col(i));
    path_position_ = 0.0;
  }
  [[nodiscard]] std::int32_t path_search() const {
    return HAMELIN_HAS_FIELD(goal_, hamelin_goal, path_search) ? goal_->path_search
                                                               : HAMELIN_PATH_NOT_SOUGHT;
  }
  // Another goal follows, at which the arm waits for the path. If there will be none, the planner
  // goes on as one that does not search.
  [[nodiscard]] bool ask(double now) {
    searches_ = searches_ && host_.request_path();
    if (searches_) enter(Mode::wait, now);
    return searches_;
  }

  [[nodiscard]] bool follows() const { return goal_->type == HAMELIN_GOAL_FOLLOW; }

  void follow(const planning::Tick& tick) {
    follower_.observe(drive_.ws(), drive_.v(), setup_.control_period_s());
    for (int k = 0; k < setup_.dof(); ++k)
      std::tie(lower_[k], upper_[k]) = drive_.joint_bounds(k, pace());
    follower_.velocity(drive_.ws(), drive_.q(), *goal_, drive_.points(),
                       1.0 / target_velocity_gain_, lower_, upper_, u_);
    if (tick.speed_scale() < 1.0) u_ *= tick.speed_scale();
    follower_.keep_clear(drive_.points(), brake_, rate_, lower_, upper_, u_);
  }

  // Without a search, an arm that is kept from its target turns where that leads to it.
  [[nodiscard]] bool steers_to_target(double now) const {
    return steering_ && !searches_ && was_held_from_target(now);
  }
  void turn_to_target(const planning::Tick& tick) {
    look_for_turns(tick, law_.distance(model_, drive_.ws(), drive_.q(), {goal_}));
    if (!steering_->turn().on()) return;
    law_.attract(model_, drive_.ws(), drive_.q(), {goal_}, u_);
    u_ *= tick.speed_scale();
    steering_->apply(drive_.M(), u_);
    law_.repel(drive_.points(), 1.0, u_);
  }
  [[nodiscard]] bool was_held_from_target(double now) const {
    return now - blocked_since_s_ > target_blocked_s;
  }

  // Whether the arm is near the reference of a trajectory; away from it, the trajectory is a path.
  [[nodiscard]] bool tracks(const planning::Tick& tick) const {
    const auto reference = tick.reference();
    return reference && (reference->certified || reference->rate > track_rate_least) &&
           mode_ == Mode::goal && !evader_.evades() &&
           (reference->q - drive_.q()).lpNorm<Eigen::Infinity>() < track_within;
  }

  // As the feedback of a stop, whose bounds are those of the tube: docs/theory.md (14.14).
  [[nodiscard]] double certified_gain() const {
    constexpr double feedback_rate = 50.0, per_step = 0.2;
    return 2.0 * std::min(feedback_rate, per_step / setup_.control_period_s());
  }

  // docs/theory.md (18.17)
  void track(const planning::Tick& tick) {
    const auto reference = *tick.reference();
    // Under ideal actuation v is that of the step before, on average half a period old.
    const double gain = certified_ ? certified_gain() : target_velocity_gain_;
    const double lead = 1.0 / gain - (setup_.sampled() ? 0.0 : 0.5 * setup_.control_period_s());
    u_ = reference.v + lead * reference.a +
         (certified_ ? 0.25 * gain : tracking_gain_) * (reference.q - drive_.q());
    if (tick.speed_scale() < 1.0) u_ *= tick.speed_scale();
  }

  // docs/theory.md (10.40)
  void look_for_turns(const planning::Tick& tick, double distance) {
    steering_->advance(tick.time_s(), drive_.q(), distance, *goal_, tick.moving_count() > 0);
  }

  void measure_margins() {
    margins_.set_goal(surroundings_, *goal_, contact_radius_);
    measure_margins_ = false;
  }

  Target choose_target() {
    if (path_.empty()) return {goal_};
    path_position_ = path_.carrot(path_position_, drive_.q(), path_ahead, via_);
    return {goal_, &via_, path_position_ < path_.length()};
  }

  // The way that the arm follows if nothing moves into it.
  [[nodiscard]] Course course() {
    Course course{goal_};
    course.goal_number = goal_number_;
    if (mode_ == Mode::wait) {
      course.waits = true;
    } else if (!path_.empty()) {
      course.path = &path_;
      course.position = path_position_;
      course.ahead = path_ahead;
    }
    return course;
  }

  [[nodiscard]] Evader::Arm arm() const {
    return {drive_.ws(), drive_.q(), drive_.v(), drive_.M(), drive_.M_inv()};
  }

  // The length that remains: the distance from the target, and the path behind it.
  [[nodiscard]] double remaining(const Target& target) {
    double length = law_.distance(model_, drive_.ws(), drive_.q(), target);
    if (!path_.empty()) length += path_.length() - path_position_;
    return length;
  }

  // How fast limits are approached: a trajectory was planned to be clear.
  [[nodiscard]] Pace pace() const {
    if (!tracks_) return {acceleration_max_, brake_, rate_, 0.5 * acceleration_max_};
    const double rate = track_rate_within(drive_.horizon_s()),
                 acceleration = certified_ ? path_acceleration_ : acceleration_max_;
    return {acceleration, track_brake, rate, acceleration, rate};
  }

  // A certified path keeps what the tip is to keep.
  [[nodiscard]] bool keeps_to_path(const planning::Tick& tick) const {
    constexpr double on_path = 0.005;
    return certified_ && (tick.reference()->q - drive_.q()).lpNorm<Eigen::Infinity>() < on_path;
  }

  void drive(const planning::Tick& tick, planning::Command& command) {
    drive_.begin_filter(pace(), [this](const NearPoint& point) {
      if (!evader_.moves(point.obstacle)) return certified_ ? -1.0 : 0.0;
      return evader_.has_rows() ? MoverRows::softness : -1.0;
    });
    if (!keeps_to_path(tick)) drive_.add_kept(tick.kept(), pace());
    if (evader_.active() && evader_.has_rows())
      evader_.add_rows(arm(), drive_.coasting_velocity(), drive_.filter());
    drive_.apply(command);
  }

  // An arm that is kept from its target asks for a path to where it is, and goes on following. A
  // target is never given up: it may come back.
  void check_target(double now, planning::Command& command) {
    command.disable_stall_rule();
    const double distance = law_.distance(model_, drive_.ws(), drive_.q(), {goal_});
    if (mode_ == Mode::path_to_target) {
      if (distance < target_away || path_has_ended(now)) resume_target(now);
      return;
    }
    if (awaits_path_) return take_path_to_target(now, distance);
    if (searches_) {
      if (!is_held_from_target(distance)) blocked_since_s_ = now;
      if (was_held_from_target(now)) search_target(now);
    } else if (steering_ && !steering_->turn().on() && !is_held_from_target(distance)) {
      if (was_held_from_target(now)) steering_->restart();
      blocked_since_s_ = now;
    }
  }

  [[nodiscard]] bool is_held_from_target(double distance) const {
    return follower_.progress() <= target_blocked_share && distance >= target_away;
  }

  void take_path_to_target(double now, double distance) {
    if (path_search() == HAMELIN_PATH_SOUGHT) return;
    awaits_path_ = false;
    blocked_since_s_ = now;
    if (path_search() != HAMELIN_PATH_FOUND || distance < target_away) return;
    take_path();
    enter(Mode::path_to_target, now);
  }

  // A path to a place of the target ends there, or where the arm is stuck.
  [[nodiscard]] bool path_has_ended(double now) {
    if (stall_.stalled(now, remaining({goal_, &via_}), drive_.v().norm(), 1.0, drive_.held_back()))
      return true;
    return path_position_ >= path_.length() &&
           (path_.end() - drive_.q()).lpNorm<Eigen::Infinity>() < path_end_reached;
  }

  void resume_target(double now) {
    path_.clear();
    follower_.restart();
    blocked_since_s_ = now;
    enter(Mode::goal, now);
  }

  void search_target(double now) {
    blocked_since_s_ = now;
    if (anchor_.searches > 0 && !anchor_.left_by(*goal_)) {
      if (anchor_.searches >= target_searches) return;
      ++anchor_.searches;
    } else {
      anchor_.set(*goal_);
      anchor_.searches = 1;
    }
    searches_ = awaits_path_ = host_.request_path();
    if (awaits_path_) host_.info("searches a way to the target");
  }

  void check_stall(double now, const Target& target, double closing_speed,
                   planning::Command& command) {
    if (asks_ || steering_) command.disable_stall_rule();
    if (mode_ == Mode::wait) return;
    if (!evader_.evades()) {
      evades_since_s_ = now;
    } else if (now - evades_since_s_ < longest_wait_s && !makes_no_progress(now, target)) {
      return stall_.restart(now);
    }
    if (stall_.stalled(now, remaining(target), drive_.v().norm(), closing_speed,
                       drive_.held_back()) ||
        makes_no_progress(now, target))
      leave_stall(now, command);
  }

  // Where something moves, the arm may be driven to and fro, which the rule of stalls takes for
  // motion: then only new bests of the remaining length count.
  [[nodiscard]] bool makes_no_progress(double now, const Target& target) {
    constexpr double patience_s = 3.0, progress = 0.05;
    const double left = remaining(target);
    if (left < least_left_ - progress || !evader_.active()) {
      least_left_ = left;
      progress_s_ = now;
    }
    return now - progress_s_ > patience_s;
  }

  // A stall is left to steering for a while, and if there is no search, until it has tried all it
  // knows many times.
  [[nodiscard]] bool steers_on(double now) const {
    constexpr double steered_s = 10.0;
    if (mode_ != Mode::goal || !path_.empty()) return false;
    if (!searches_) return steering_->looks_in_vain() < Steering::looks_enough;
    return (steering_->turn().on() || steering_->arrives()) &&
           now - steering_->in_vain_since_s() < steered_s;
  }

  // Something that the path does not know bars it: turns lead past it and on to the goal. Where
  // nothing moves, another path is better.
  [[nodiscard]] bool leaves_path() const {
    return steering_ && !path_.empty() && (!searches_ || evader_.active());
  }
  void leave_path(double now) {
    host_.info("stalled: turns lead on from the path");
    path_.clear();
    path_position_ = 0.0;
    steering_->restart();
    enter(Mode::goal, now);
  }

  void leave_stall(double now, planning::Command& command) {
    if (leaves_path()) return leave_path(now);
    if (steering_ && steers_on(now)) return stall_.restart(now);
    if (!searches_) return command.give_up(cause());
    if (ask(now)) return host_.info("stalled: asks for another path");
    stall_.restart(now);
  }

  // The cause of a stall, from the multipliers of the filter.
  [[nodiscard]] std::string cause() {
    const auto& links = model_.robot().links;
    const auto points = drive_.points();
    int worst = -1;
    for (int i = 0; i < std::min<int>(drive_.filter().row_count(), static_cast<int>(points.size()));
         ++i)
      if (drive_.filter().row_multiplier(i) > 0.0 &&
          (worst < 0 || drive_.filter().row_multiplier(i) > drive_.filter().row_multiplier(worst)))
        worst = i;
    if (worst >= 0) {
      const auto& point = points[static_cast<std::size_t>(worst)];
      const auto& name = links[static_cast<std::size_t>(point.link)].name;
      if (margins_.tight_at_goal(point) && point.margin < margins_.params().full_m)
        return "margin around the goal: link '" + name +
               "' keeps its margin from an obstacle that is near the goal";
      return "force balance: the obstacle next to link '" + name +
             "' balances the attraction to the goal";
    }
    for (int k = 0; k < setup_.dof(); ++k) {
      if (setup_.effort_max() && drive_.filter().momentum_multiplier(k) > 0.0)
        return "torque limit of joint '" + links[static_cast<std::size_t>(k)].joint.name + "'";
      const double at_limit = 0.02;
      if ((setup_.q_lower() && drive_.q()[k] - (*setup_.q_lower())[k] < at_limit) ||
          (setup_.q_upper() && (*setup_.q_upper())[k] - drive_.q()[k] < at_limit))
        return "joint limit: joint '" + links[static_cast<std::size_t>(k)].joint.name +
               "' is at its limit";
    }
    return "unreachable goal: no obstacle is in the way, but the distance from the goal does not "
           "decrease";
  }

  planning::Host host_;
  planning::Setup setup_;
  model::Model model_;
  Json initial_params_;
  Law law_;
  FilterDrive drive_;
  Surroundings surroundings_;
  Margins margins_;
  Evader evader_;
  Follower follower_;
  TargetAnchor anchor_;           ///< the last place of the target to which a way was searched
  bool awaits_path_ = false;      ///< to there
  double blocked_since_s_ = 0.0;  ///< since when the arm has been kept from the target
  double evades_since_s_ = 0.0;
  double least_left_ = 0.0, progress_s_ = 0.0;  ///< least remaining length, and since when
  std::int32_t evasion_series_ = -1, clearance_series_ = -1;
  StallDetector stall_;
  std::unique_ptr<Steering> steering_;
  std::int32_t turn_series_ = -1;
  double velocity_gain_ = 0.0, follow_gain_ = 0.0, target_velocity_gain_ = 1.0,
         tracking_gain_ = 0.0, drive_acceleration_ = 0.0, acceleration_max_ = 0.0,
         path_acceleration_ = 0.0, brake_ = 0.0, rate_ = 0.0, joint_damping_ = 0.0, contact_radius_;
  bool asks_, searches_ = false;  ///< for paths; and may still do so at this goal
  planning::JointPath path_;
  VectorXd u_, via_, lower_, upper_;
  const hamelin_goal* goal_ = nullptr;  ///< of goal_number_
  std::uint64_t goal_number_ = 0;
  Mode mode_ = Mode::goal;
  bool tracks_ = false;          ///< the reference of a trajectory
  bool certified_ = false;       ///< of a path that is proved to be clear
  bool measure_margins_ = true;  ///< whether goal or margins have changed
  double path_position_ = 0.0;
};

}  // namespace
}  // namespace hamelin::hybrid

HAMELIN_PLANNER_PLUGIN(hamelin::hybrid::Hybrid, "hybrid", "0.1.0",
                       "Attraction, steering without work and short repulsion under a safety "
                       "filter, along searched paths",
                       params_schema);
