// When a run ends, and why.
#include "closed_loop.hpp"

#include <fmt/format.h>

#include <utility>

namespace hamelin::simulation {

namespace {

// An arm that is slower has come to rest [rad/s or m/s].
constexpr double resting_speed = 2e-3;
// A run whose target is lost ends at the latest after this time, if the arm does not rest before.
constexpr double longest_halt_s = 2.0;

}  // namespace

void ClosedLoop::check_outcome() {
  const Plant::Node& node = plant_->node();
  if (!node.v.allFinite() || !node.q.allFinite())
    return finish(log::Outcome::diverged,
                  fmt::format("step {}: the state is no longer finite", node.k));
  judge_->count_contacts(result_);
  if (judge_->in_contact() && node.k > 0) {
    result_.mover_contact = judge_->mover_contact();
    return finish(log::Outcome::collision, judge_->describe_contact());
  }
  if (judge_->in_contact()) return finish(log::Outcome::refused, judge_->describe_refusal());
  if (done_) return;
  const bool tick = actuation_->is_tick(node.k);
  if (tick) let_controller_observe();
  if (tick && next_event_ < scene_.events.size()) advance_events();
  if (done_) return;
  note_tracking();
  if (tick) note_reference();
  if (tick) check_target();
  if (done_) return;
  const control::ControlState now = controller_->answer().state;
  if (now == control::ControlState::reached && arrived())
    finish(log::Outcome::reached, "");
  else if (tick && now == control::ControlState::stalled)
    finish(log::Outcome::stalled,
           fmt::format("at rest for {} s away from the goal", scene_.stall->hold_s));
  else if (halting_ && (rests() || node.k == steps_))
    finish(result_.outcome, result_.cause);
  else if (node.k == steps_ && controller_->goals().follows())
    finish(log::Outcome::followed, "");
  else if (node.k == steps_)
    finish(log::Outcome::timeout, timeout_cause());
  else if (recorder_->stopped(node.k))
    finish(log::Outcome::interrupted, "stopped from outside");
}

std::string ClosedLoop::why_not_there() const {
  const control::GoalError error = goal_error();
  if (error.reached || error.size > 1.0) return "";
  const scene::Goal& goal = scene::options_of(controller_->goals().goal())[error.option];
  const double fastest = plant_->node().v.lpNorm<Eigen::Infinity>();
  if (!(fastest < goal.speed_max))
    return fmt::format(
        "; it is within the tolerances, but its fastest joint moves at {:.3g} rad/s or m/s, "
        "expected "
        "less than {:g} (speed_max)",
        fastest, goal.speed_max);
  return goal.tip_speed_max_m_s
             ? fmt::format(
                   "; it is within the tolerances, but its tip moves, expected less than {:g} m/s",
                   *goal.tip_speed_max_m_s)
             : "";
}

std::string ClosedLoop::timeout_cause() const {
  const std::string_view no_path = controller_->guide_cause();
  std::string cause = fmt::format("goal not reached within {} s{}{}{}", scene_.duration_s,
                                  no_path.empty() ? "" : ", no path: ", no_path, why_not_there());
  const auto shield = controller_->shield_report();
  if (!shield || !shield->stopping || !shield->at_rest) return cause;
  control::LineBuffer line;
  controller_->describe_refusal(line);
  return fmt::format("{}; the shield has held the arm since {:.3f} s: {}", cause, stopped_at_s_,
                     line.view());
}

bool ClosedLoop::rests() const {
  return controller_->shield_report()->at_rest &&
         plant_->node().v.lpNorm<Eigen::Infinity>() < resting_speed;
}

bool ClosedLoop::arrived() const {
  return scene_.actuation.type != scene::ActuationType::position || goal_error().reached;
}

control::GoalError ClosedLoop::goal_error() const {
  dynamics::Workspace ws(model_);
  dynamics::forward_kinematics(model_, ws, plant_->node().q);
  if (const control::TargetState* const target = controller_->answer().target)
    return control::target_error(controller_->goals().goal(), target->pose, model_, ws);
  return control::goal_error(controller_->goals().goal(), model_, ws, plant_->node().q,
                             plant_->node().v);
}

void ClosedLoop::check_target() {
  const control::TargetState* const target = controller_->answer().target;
  if (target == nullptr || !feed_ || done_ || halting_) return;
  if (ends_by_s_) {  // the planner brings the arm to rest at a target that rests
    if (plant_->node().v.lpNorm<Eigen::Infinity>() < resting_speed ||
        plant_->node().time_s > *ends_by_s_)
      finish(log::Outcome::target_lost, std::string(result_.cause));
    return;
  }
  const scene::TargetStream& stream = controller_->goals().goal().stream;
  if (feed_->ended() && !feed_->last_s())
    return finish(log::Outcome::target_lost,
                  "no line of the stream of targets is valid, expected poses or twists");
  if (feed_->ended() && plant_->node().time_s > feed_->last_s().value_or(0.0) + stream.gap_max_s)
    return finish(log::Outcome::followed, "the stream of targets has ended");
  const bool lost_before = std::exchange(target_lost_, target->lost);
  if (!target->lost || lost_before) return;
  const std::string what = fmt::format(
      "the target is lost: no line of its stream for {} s, "
      "expected at most {} s between two lines",
      stream.gap_max_s, stream.gap_max_s);
  report_event(true, what);
  if (stream.when_lost != scene::WhenLost::end) return;
  result_.cause = what;
  ends_by_s_ = plant_->node().time_s + longest_halt_s;
}

bool ClosedLoop::planner_answered() {
  const control::Answer& answer = controller_->answer();
  if (answer.channels != nullptr) return true;
  if (answer.reason == control::StopReason::tracking) {
    finish_at_rest(log::Outcome::stalled, std::string(answer.cause));
    return false;
  }
  finish_at_rest(log::Outcome::defect,
                 fmt::format("planner '{}' at step {}: {}", scene_.planner->name, plant_->node().k,
                             answer.cause));
  return false;
}

void ClosedLoop::finish_at_rest(log::Outcome outcome, std::string cause) {
  if (!controller_->shield_report()) return finish(outcome, std::move(cause));
  if (!halting_) {
    result_.outcome = outcome;
    result_.cause = std::move(cause);
  }
  halting_ = true;
}

void ClosedLoop::finish(log::Outcome outcome, std::string cause) {
  result_.outcome = outcome;
  result_.cause = std::move(cause);
  done_ = true;
}

void ClosedLoop::finish_if(std::string defect) {
  if (!defect.empty()) finish(log::Outcome::defect, std::move(defect));
}

}  // namespace hamelin::simulation
