// What a scene's events do to a run: objects that are attached and detached, with the map.
#include <fmt/format.h>

#include <algorithm>
#include <limits>

#include "closed_loop.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/payload.hpp"
#include "loop/loaded_arm.hpp"
#include "scene_places.hpp"

namespace hamelin::simulation {

bool ClosedLoop::is_due(const scene::Event& event) const {
  return event.time_s ? *event.time_s <= plant_->node().time_s + time_rounding_s
                      : controller_->goals().index() >= *event.goals_reached;
}

// An event takes two ticks: the controller is told in the first, and has accepted or refused in the
// second.
void ClosedLoop::advance_events() {
  const std::vector<scene::Event>& events = scene_.events;
  if (expected_load_ != 0) {
    const bool refused = controller_->answer().refused_load == expected_load_;
    expected_load_ = 0;
    const scene::Event& event = events[next_event_];
    if (refused) note_refused_load(event);
    complete(event, !refused);
    ++next_event_;
  }
  while (!done_ && next_event_ < events.size() && is_due(events[next_event_])) {
    begin(events[next_event_]);
    if (expected_load_ != 0) return;
    complete(events[next_event_], false);
    ++next_event_;
  }
}

void ClosedLoop::begin(const scene::Event& event) {
  if (event.map) controller_->world().change_map(*event.map);
  if (const auto obstacle = carried_obstacle()) begin_obstacle(*obstacle, event.attach.has_value());
  if (event.attach) {
    scene::Payload told = *event.attach;
    if (!told.shapes_known) {
      told.spheres.clear();
      told.capsules.clear();
    }
    expected_load_ = controller_->attach(told, q_shown_);
  }
  const bool carried =
      event.detach && std::any_of(carried_.begin(), carried_.end(),
                                  [&](const auto& one) { return one.name == *event.detach; });
  if (carried) expected_load_ = controller_->detach(*event.detach, q_shown_);
}

std::optional<std::size_t> ClosedLoop::carried_obstacle() const {
  const scene::Event* event = &scene_.events[next_event_];
  if (event->detach) {
    const std::string& name = *event->detach;
    while (event != scene_.events.data() && !(event->attach && event->attach->name == name))
      --event;
  }
  if (!event->attach || event->obstacle.empty()) return std::nullopt;
  for (std::size_t k = 0; k < scene_.obstacles.size(); ++k)
    if (scene_.obstacles[k].name == event->obstacle) return k;
  return std::nullopt;
}

geometry::SE3 ClosedLoop::obstacle_pose(std::size_t index) const {
  return judge_->view().environment().obstacles()[index].pose;
}

scene::Obstacle ClosedLoop::obstacle_at(std::size_t index, const geometry::SE3& pose) const {
  scene::Obstacle out = scene_.obstacles[index];
  out.pose = pose;
  Eigen::Vector4d::Map(out.quaternion_wxyz.data()) = geometry::quaternion_wxyz(pose.R());
  return out;
}

geometry::SE3 ClosedLoop::tip() const {
  return dynamics::tip_pose(model_, judge_->view().poses());
}

void ClosedLoop::begin_obstacle(std::size_t index, bool is_attached) {
  if (is_attached) {
    in_tip_[index] = tip().inverse() * obstacle_pose(index);
    controller_->world().remove_obstacle(scene_.obstacles[index].name);
  } else if (in_tip_.contains(index)) {
    controller_->world().set_obstacle(obstacle_at(index, tip() * in_tip_[index]));
  }
}

void ClosedLoop::complete_obstacle(std::size_t index, bool is_attached, bool accepted) {
  if (!in_tip_.contains(index)) return;  // it was not attached
  if (!accepted && !is_attached) controller_->world().remove_obstacle(scene_.obstacles[index].name);
  if (!accepted && is_attached)
    controller_->world().set_obstacle(obstacle_at(index, obstacle_pose(index)));
  if (accepted) {
    scene::Obstacle changed = obstacle_at(index, tip() * in_tip_[index]);
    if (is_attached) changed.appears_s = std::numeric_limits<double>::infinity();
    judge_->change_obstacle(index, changed);
    plant_->change_obstacle(index, changed);
  }
  if (accepted != is_attached) in_tip_.erase(index);
}

void ClosedLoop::note_refused_load(const scene::Event& event) {
  const std::string& name = event.attach ? event.attach->name : *event.detach;
  std::string cause =
      fmt::format("'{}' cannot be {}: {}", name, event.attach ? "attached" : "detached",
                  controller_->answer().load_refusal);
  report_event(true, cause);
  if (event.required) {
    controller_->stop("the load is refused");
    return finish_at_rest(log::Outcome::refused, std::move(cause));
  }
  result_.warnings.push_back(std::move(cause));
}

void ClosedLoop::complete(const scene::Event& event, bool accepted) {
  if (event.map) {
    judge_->change_map(*event.map);
    plant_->change_map(*event.map);
    if (sensors_) sensors_->change_map();
    report_event(false, "the map changes");
  }
  if (const auto obstacle = carried_obstacle())
    complete_obstacle(*obstacle, event.attach.has_value(), accepted);
  if (accepted && event.attach) {
    carried_.push_back(*event.attach);
    record_load(event.attach->name, "attached");
  } else if (accepted) {
    std::erase_if(carried_, [&](const auto& one) { return one.name == *event.detach; });
    record_load(*event.detach, "detached");
  }
  if (accepted) take_load();
  judge_->look_again();
  if (judge_->touching() && !done_) finish(log::Outcome::collision, judge_->describe_contact());
}

void ClosedLoop::record_load(const std::string& name, const char* what) {
  recorder_->event(plant_->node().time_s, fmt::format("'{}' is {}", name, what),
                   {{what, name}, {"q", to_json(plant_->node().q)}});
}

void ClosedLoop::take_load() {
  const integration::Energy before = plant_->energy();
  // in place: plant and actuation refer to it
  model_ = scene::carrying(bare_, carried_, scene_.model.self_collision, scene_.safety.margin_m,
                           plant_->node().q);
  plant_->take_load();
  actuation_->take_load();
  if (tracking_) tracking_->take_load();
  const integration::Energy after = plant_->energy();
  audit_->book_load(after.kinetic_J + after.potential_J - before.kinetic_J - before.potential_J);
  judge_->take_load();
  log_->set_world(judge_->view());
}

}  // namespace hamelin::simulation
