// The tick of a controller.
#include "hamelin/control/controller.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "guide/guidance.hpp"
#include "hamelin/core/error.hpp"
#include "loop/append_line.hpp"
#include "loop/goal_list.hpp"
#include "loop/loaded_arm.hpp"
#include "loop/mailbox.hpp"
#include "loop/path_reference.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// Larger numbers are neither positions nor velocities of a joint [rad or m, rad/s or m/s]: what
// follows from them may overflow.
constexpr double measured_max = 1e6;

// Also false for numbers that are not finite.
bool within(const VectorXd& x, double bound) {
  return (x.array().abs() <= bound).all();
}

}  // namespace

const Answer& Controller::tick(double time_s, const VectorXd& q, const VectorXd& v) {
  observe(time_s, q, v);
  decide();
  return answer_;
}

const Answer& Controller::tick_unseen() {
  if (k_ == 0) throw Error(ErrorCode::usage, "tick_unseen: the first tick needs a measurement");
  usable_ = false;
  ++unusable_;
  if (lost_.empty()) {
    lost_line_.clear();
    append(lost_line_, "no measurement came, expected one in each period of {} s", period_s_);
    lost_ = lost_line_.view();
  }
  time_s_ = time_s_ + period_s_;
  arm_->drive->measure(q(), v(), false);
  look(false);
  decide();
  return answer_;
}

void Controller::observe(double time_s, const VectorXd& q, const VectorXd& v) {
  const bool first = k_ == 0;
  measure(time_s, q, v);
  look(first);
}

void Controller::look(bool first) {
  verdict_.reset();
  if (options_.certify && !first) {  // against the world in which the arm moved
    arm_->view.look(this->q(), time_s_);
    verdict_ = arm_->view.certify(this->q(), this->v());
    if (arm_->view.take_newest()) arm_->view.look(this->q(), time_s_);
  } else {
    (void)arm_->view.take_newest();
    see();
  }
  take_load();
  take_stop();
  answer_.snapshot = arm_->view.snapshot();
  take_goals();
  answer_.goals_number = goal_list_->number;
  if (answer_.state == ControlState::stopping) return allow_for_goal();
  answer_.state = ControlState::running;
  answer_.cause = {};
  update_reference();
  while (!on_the_way() && goals_.advance(arm_->view.poses(), this->q(), this->v()))
    update_reference();
  answer_.goal_index = goals_.index();
  allow_for_goal();
  update_target();
  if (goals_.all_reached())
    answer_.state = ControlState::reached;
  else if (!(guidance_ && guidance_->waits()) && !arm_->planner.detects_stalls() &&
           goals_.stalled(arm_->view.poses(), this->v(), period_s_)) {
    if (guidance_ && guidance_->stalled())
      goals_.forget_rest();
    else
      answer_.state = ControlState::stalled;
  }
}

// What a planner that trusts its path does not ask for, and nobody else needs, is not searched.
void Controller::see() {
  if (on_path_ && !options_.certify && plugin().trusts_certified_paths())
    arm_->view.glance(q(), time_s_);
  else
    arm_->view.look(q(), time_s_);
}

void Controller::measure(double time_s, const VectorXd& q, const VectorXd& v) {
  const Eigen::Index dof = nominal_.dof();
  const bool uses_v = !scene_.actuation.estimates_velocity;
  if (q.size() != dof || (uses_v && v.size() != dof))
    throw Error(ErrorCode::invalid,
                fmt::format("the measured q and v: {} and {} values given, expected {} each (one "
                            "per joint of '{}')",
                            q.size(), v.size(), dof, nominal_.robot().name));
  const bool in_order = std::isfinite(time_s) && (k_ == 0 || time_s >= given_s_),
             finite = within(q, measured_max) && (!uses_v || within(v, measured_max));
  usable_ = in_order && finite;
  unusable_ = usable_ ? 0 : unusable_ + 1;
  if (!usable_)
    lose_measurement(time_s, in_order);
  else if (answer_.state != ControlState::stopping)
    lost_ = {};
  // what moves goes on as predicted while the clock cannot be used
  if (!in_order)
    time_s_ = time_s_ + period_s_;
  else
    time_s_ = k_ == 0 ? time_s : std::max(time_s, time_s_.load());
  if (in_order) given_s_ = time_s;
  if (finite)
    for (Eigen::Index i = 0; i < dof; ++i)
      measured_[static_cast<std::size_t>(i)].store(q[i], std::memory_order_relaxed);
  // where the clock is broken for good, the arm is brought to rest by what is measured
  if (usable_) world_.note_posture(time_s_, q, answer_.load);
  arm_->drive->measure(q, v, finite && (in_order || unusable_ > options_.lost_measurements_max));
}

// The first line stays: it says why the arm stops.
void Controller::lose_measurement(double time_s, bool in_order) {
  if (!lost_.empty()) return;
  LineBuffer& line = lost_line_;
  line.clear();
  if (in_order)
    append(line,
           "the measured q or v is not finite, or beyond {} rad or m, expected what the joints "
           "have measured",
           measured_max);
  else if (std::isfinite(time_s))
    append(line, "time_s: {} is before that of the last tick, {}, expected times that do not fall",
           time_s, time_s_.load());
  else
    append(line, "time_s: is not finite, expected the time of the measurement");
  if (k_ == 0) throw Error(ErrorCode::invalid, std::string(line.view()));
  lost_ = line.view();
}

void Controller::decide() {
  Drive& drive = *arm_->drive;
  if (k_ == 0) drive.start();
  if (arm_->shield && !shielded_) {
    arm_->shield->start(surroundings(), drive.node());
    shielded_ = true;
  }
  if (answer_.state != ControlState::stopping) check_arm();
  if (answer_.state != ControlState::stopping) ask_planner();
  answer_.series = arm_->planner.command().series();
  propose();
  act();
  release_motions();
  const Setpoint& sent = drive.send();
  answer_.torque = sent.torque;
  answer_.saturated = sent.saturated;
  answer_.q_next = sent.q;
  answer_.v_next = sent.v;
  if (options_.certify) arm_->view.depart(q(), v());
  ++k_;
}

void Controller::check_arm() {
  if (unusable_ > options_.lost_measurements_max)
    return start_braking(StopReason::measurement, lost_);
  LineBuffer defect;
  arm_->drive->describe_defect(defect);
  if (!defect.view().empty()) start_braking(StopReason::tracking, defect.view());
}

void Controller::ask_planner() {
  take_params();
  if (reset_) arm_->planner.reset(q(), v());
  const std::size_t index = std::min(goals_.index(), goals_.size() - 1);
  const hamelin_goal* const listed = &goal_list_->for_planner[index];
  if (reset_ || (listed_ != nullptr && listed_ != listed)) {
    ++goal_.number;
    ++listed_number_;
  }
  listed_ = listed;
  if (guidance_) update_guidance();
  update_path();
  see();
  goal_ = {goal_for_planner(), goal_.number, index, &goals_.goal().constraints};
  reset_ = false;
  const double since_s = options_.clock_s != nullptr ? options_.clock_s() : 0.0;
  if (!arm_->planner.tick(k_, time_s_, q(), v(), goal_, arm_->drive->torques(), guidance_.get()))
    return start_braking(StopReason::planner, arm_->planner.error());
  if (options_.clock_s != nullptr) note_time(options_.clock_s() - since_s);
  if (answer_.state == ControlState::stopping || !arm_->planner.gave_up() ||
      (guidance_ && guidance_->stalled()))
    return;
  answer_.state = ControlState::gave_up;
  answer_.cause = arm_->planner.command().raw().cause;
}

void Controller::note_time(double planner_s) {
  answer_.planner_s = planner_s;
  late_answers_ = planner_s > deadline_s_ ? late_answers_ + 1 : 0;
  if (late_answers_ > 0 && ++answer_.overruns == 1) log_first_overrun();
  if (options_.late_answers_max == 0 || late_answers_ < options_.late_answers_max) return;
  LineBuffer line;
  append(line,
         "the last {} answers were late, expected answers within {} s; the last one took {:.3g} s",
         late_answers_, deadline_s_, planner_s);
  start_braking(StopReason::late, line.view());
}

// Later ones are counted only: an arm that is always late would fill a log.
void Controller::log_first_overrun() {
  if (!options_.log || !options_.log_overrun) return;
  LineBuffer line;
  append(line,
         "planner '{}' took {:.3g} s in the tick at {} s, expected at most its deadline of {} s; "
         "later overruns are only counted",
         plugin().name(), answer_.planner_s, time_s_.load(), deadline_s_);
  options_.log(HAMELIN_LOG_WARNING, line.view());
}

// The cause is copied: its planner may be gone while the arm is still held.
void Controller::start_braking(StopReason reason, std::string_view cause) {
  LineBuffer line;
  append(line, "{}", cause);
  cause_line_ = line;
  answer_.state = ControlState::stopping;
  answer_.reason = reason;
  answer_.cause = cause_line_.view();
  stopped_ = ++stops_;
}

void Controller::propose() {
  answer_.channels = answer_.state == ControlState::stopping ? nullptr : &arm_->planner.command();
  if (answer_.channels == nullptr || arm_->drive->propose(*answer_.channels)) return;
  start_braking(
      StopReason::planner,
      "the sum of the planner's channels is no torque or acceleration of an arm, expected finite "
      "numbers below 1e12");
  answer_.channels = nullptr;
}

void Controller::act() {
  answer_.stopping = false;
  Drive& drive = *arm_->drive;
  if (Shield* const shield = arm_->shield.get()) {
    const auto step = answer_.channels != nullptr ? drive.step() : std::nullopt;
    if (!step)
      shield->refuse();
    else if (shield->accept(surroundings(), *step))
      return;
    answer_.stopping = true;
  } else {
    if (answer_.channels != nullptr) return;
    if (begun_stop_ != stopped_) drive.begin(arm_->stop());
    begun_stop_ = stopped_;
  }
  drive.follow(arm_->stop());
}

}  // namespace hamelin::control
