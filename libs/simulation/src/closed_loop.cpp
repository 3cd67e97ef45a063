#include "closed_loop.hpp"

#include <fmt/format.h>
#include <spdlog/logger.h>

#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::simulation {

namespace {

// Stops that follow each other sooner are one event in the log [s].
constexpr double stop_again_s = 0.25;

/// CPU time of a tick: without the log, a judge of its own, a caller that watches, and a plant that
/// is not hamelin's own.
class TickTimer {
 public:
  void pause() { spent_ += thread_cpu_s() - since_; }
  void resume() { since_ = thread_cpu_s(); }
  [[nodiscard]] double spent_s() const { return spent_ + thread_cpu_s() - since_; }

 private:
  double since_ = thread_cpu_s(), spent_ = 0.0;
};

}  // namespace

void ClosedLoop::log_planner_message(std::int32_t level, std::string_view line) {
  const bool warning = level == HAMELIN_LOG_WARNING;
  // Such a message would be written nowhere.
  if (!warning && recorder_ && !recorder_->logging() && !has_diagnostics(spdlog::level::debug))
    return;
  std::string text = fmt::format("{}: {}", scene_.planner->name, line);
  if (warning) result_.warnings.push_back(text);
  if (!recorder_) return early_messages_.push_back({warning, std::move(text)});
  report_event(warning, text);
}

void ClosedLoop::report_event(bool warning, const std::string& text) {
  recorder_->event(plant_->node().time_s, text);
  if (watch_->diagnostics)
    watch_->diagnostics->log(warning ? spdlog::level::warn : spdlog::level::debug, text);
}

bool ClosedLoop::has_diagnostics(int level) const {
  return watch_ != nullptr && watch_->diagnostics &&
         watch_->diagnostics->should_log(static_cast<spdlog::level::level_enum>(level));
}

log::Result ClosedLoop::run(const Watch& watch) {
  start(watch);
  while (!done_) {
    TickTimer timer;
    if (judge_->has_own_view()) timer.pause();
    observe_node();
    if (judge_->has_own_view()) timer.resume();
    if (watch.at_node) {
      timer.pause();
      watch.at_node(plant_->node().time_s, plant_->node().q);
      timer.resume();
    }
    check_outcome();
    if (done_)
      book_last_node();
    else if (actuation_->is_tick(plant_->node().k))
      ask_planner();
    if (!done_) apply_answer();
    if (controller_->guide_figures() != nullptr) {
      timer.pause();
      controller_->run_guide();
      timer.resume();
    }
    if (recorder_->logging()) timer.pause();
    write_tick();
    if (recorder_->logging()) timer.resume();
    if (done_) break;
    if (scene_.plant != scene::PlantType::hamelin) timer.pause();
    step();
    if (scene_.plant != scene::PlantType::hamelin) timer.resume();
    if (!done_) recorder_->tick_time(timer.spent_s());
  }
  fill_result();
  recorder_->close(audit_->ledger());
  return result_;
}

void ClosedLoop::observe_node() {
  judge_->observe_node();
  if (!judge_->contact_on_the_way().empty())
    finish(log::Outcome::collision, judge_->contact_on_the_way());
  reveal_obstacles();
  change_map();
  if (sensors_)
    sensors_->advance(
        plant_->node().time_s, judge_->view(), *controller_,
        [this](const std::string& line) { report_event(true, line); },
        [this](const std::string& camera, const std::vector<scene::VoxelBox>& runs) {
          record_seen(camera, runs);
        });
  recorder_->observe(judge_->view().clearance_m(), judge_->certified(), plant_->node().v,
                     scene_.step_s);
}

void ClosedLoop::record_seen(const std::string& camera, const std::vector<scene::VoxelBox>& runs) {
  if (watch_->log == nullptr) return;
  Json seen = Json::array();
  for (const scene::VoxelBox& run : runs)
    seen.push_back({run.lo[0], run.lo[1], run.lo[2], run.hi[0] - run.lo[0]});
  recorder_->event(
      plant_->node().time_s,
      fmt::format("'{}' sees {} voxels for the first time", camera, scene::voxels_in(runs)),
      {{"seen", std::move(seen)}});
}

void ClosedLoop::reveal_obstacles() {
  for (const int found : judge_->view().revealed()) {
    scene::Obstacle obstacle =
        judge_->view().environment().obstacles()[static_cast<std::size_t>(found)];
    recorder_->event(plant_->node().time_s,
                     fmt::format("obstacle '{}' becomes visible", obstacle.name));
    obstacle.known = true;
    controller_->world().set_obstacle(std::move(obstacle));
  }
}

// The step that led here was checked against the old map; what follows is checked against the new
// one.
void ClosedLoop::change_map() {
  const std::string change = judge_->advance_map();
  if (change.empty()) return;
  report_event(false, change);
  for (const auto& changes = scene_.map->changes;
       next_map_change_ < changes.size() &&
       changes[next_map_change_].time_s <= plant_->node().time_s + 1e-9;
       ++next_map_change_)
    if (scene_.map->known) controller_->world().change_map(changes[next_map_change_]);
  if (sensors_) sensors_->change_map();
  judge_->look_again();
}

void ClosedLoop::let_controller_observe() {
  observed_k_ = plant_->node().k;
  if (feed_) feed_target();
  actuation_->observe(q_shown_, v_shown_);
  const double since_s = control::steady_clock_s();
  controller_->observe(plant_->node().time_s, q_shown_, v_shown_);
  observing_s_ = control::steady_clock_s() - since_s;
  const control::Answer& answer = controller_->answer();
  judge_->allow(answer.may_touch, std::min(answer.goal_index, scene_.goals.size() - 1));
  const control::GoalTracker& goals = controller_->goals();
  while (goals_reached_ < goals.index())
    recorder_->event(plant_->node().time_s,
                     fmt::format("goal {} of {} reached", ++goals_reached_, goals.size()));
}

void ClosedLoop::feed_target() {
  feed_->advance(plant_->node().time_s, *controller_, [this](const std::string& line) {
    // Only the first few become warnings of the result: a stream may be wrong line by line.
    constexpr long warned = 5;
    if (tracking_->count_refused_line() <= warned) result_.warnings.push_back(line);
    report_event(true, line);
  });
}

void ClosedLoop::note_reference() {
  const control::ReferenceState* const reference = controller_->answer().reference;
  if (reference != nullptr && controller_->goals().goal().trajectory)
    trajectory_.observe(controller_->goals().goal(), *reference, plant_->node().q,
                        controller_->period_s());
}

void ClosedLoop::note_tracking() {
  if (!tracking_ || controller_->answer().target == nullptr) return;
  tracking_->observe(controller_->goals().goal(), *controller_->answer().target, plant_->node().q,
                     judge_->view(), plant_->node().k > 0 ? scene_.step_s : 0.0);
}

void ClosedLoop::ask_planner() {
  const double since_s = control::steady_clock_s();
  try {
    controller_->decide();
  } catch (const Error& e) {
    if (e.code() != ErrorCode::invalid || plant_->node().k > 0) throw;
    return finish(log::Outcome::refused, e.what());
  }
  recorder_->controller_time(observing_s_ + control::steady_clock_s() - since_s);
  recorder_->planner_time(controller_->answer().planner_s);
  if (planner_answered() && controller_->answer().state == control::ControlState::gave_up)
    finish(log::Outcome::stalled, std::string(controller_->answer().cause));
  if (done_) book_answer();
}

void ClosedLoop::report_stop() {
  if (!controller_->answer().stopping || !controller_->shield_report()->began) return;
  const double last_s = std::exchange(stopped_at_s_, plant_->node().time_s);
  if (stopped_at_s_ - last_s < stop_again_s) return;
  control::LineBuffer line;
  controller_->describe_refusal(line);
  report_event(false, fmt::format("the shield stops the arm: {}", line.view()));
}

void ClosedLoop::let_answer_act() {
  const bool fresh = actuation_->is_tick(plant_->node().k);
  actuation_->take(controller_->answer(), fresh);
  actuation_->book(controller_->answer(), fresh, *audit_);
}

void ClosedLoop::apply_answer() {
  let_answer_act();
  report_stop();
  finish_if(audit_->fault(*plant_));
  const planning::CommandBuffers* const channels = controller_->answer().channels;
  if (channels == nullptr || controller_->answer().stopping) return;
  const std::string fault = audit_->fault_of_planner(channels->raw());
  if (!fault.empty())
    finish_if(
        fmt::format("planner '{}' at step {}: {}", scene_.planner->name, plant_->node().k, fault));
}

// Only the planner knows a control potential's value and its gradient for the closing half-kick.
void ClosedLoop::book_last_node() {
  if (plant_->node().k == 0 || result_.outcome == log::Outcome::diverged) return;
  if (actuation_->needs_answer_at_end()) {
    if (observed_k_ != plant_->node().k) let_controller_observe();
    controller_->decide();
    book_answer();
  } else {
    audit_->book_node(*plant_);
  }
  if (result_.outcome != log::Outcome::collision) finish_if(audit_->fault(*plant_));
}

void ClosedLoop::book_answer() {
  if (controller_->answer().channels != nullptr)
    let_answer_act();
  else
    audit_->book_node(*plant_);
}

void ClosedLoop::write_tick() {
  if (recorder_->wants_tick(plant_->node().k) || (done_ && recorder_->logging()))
    log_->tick(judge_->certified(), done_ ? nullptr : controller_->answer().channels);
}

void ClosedLoop::push_arm() {
  if (!wrenches_ || !wrenches_->advance(plant_->node().time_s)) return;
  plant_->push(wrenches_->active());
  report_event(false, wrenches_->describe());
}

void ClosedLoop::step() {
  push_arm();
  judge_->depart(actuation_->departure_velocity());
  if (actuation_->saturated()) ++saturated_steps_;
  const bool converged = actuation_->step(scene_.step_s);
  recorder_->step(plant_->report());
  if (!converged) {
    finish(log::Outcome::diverged, fmt::format("step {} of {} s {}", plant_->node().k + 1,
                                               scene_.step_s, plant_->description().failure));
    if (recorder_->logging()) log_->tick(judge_->certified(), nullptr);
    return;
  }
  audit_->book_step(plant_->report(), controller_->answer().stopping);
  recorder_->progress(plant_->node().k, plant_->node().time_s, scene_.duration_s);
}

}  // namespace hamelin::simulation
