#include "judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hamelin/scene/self_collision.hpp"

namespace hamelin::simulation {

namespace {

// Whether nothing is hidden from the controller, nothing changes, and it is shown the arm as it is:
// then one view of the world serves controller and judge.
bool controller_sees_all(const scene::Scene& scene) {
  const bool exact =
      scene.actuation.joint_noise_rad == 0.0 && scene.actuation.planner_mass_scale == 1.0 &&
      !scene.actuation.estimates_velocity && scene.actuation.type != scene::ActuationType::position;
  return exact && scene.events.empty() && scene.wrenches.empty() && scene.sensors.empty() &&
         !(scene.map && !scene.map->changes.empty()) &&
         std::all_of(scene.obstacles.begin(), scene.obstacles.end(),
                     [](const auto& o) { return o.known && !o.judge_only; }) &&
         std::all_of(scene.goals.begin(), scene.goals.end(),
                     [](const auto& goal) { return goal.may_touch.empty(); });
}

// What nobody has seen is no body that an arm could touch.
scene::Scene with_nothing_in_unknown_space(scene::Scene scene) {
  scene.map->unknown = scene::UnknownPolicy::free;
  return scene;
}

void raise(std::optional<double>& most, double value) {
  most = std::max(most.value_or(0.0), value);
}

}  // namespace

Judge::Judge(const scene::Scene& scene, const model::Model& model, Plant& plant,
             control::WorldView* controllers)
    : scene_(scene),
      model_(model),
      plant_(plant),
      limits_(control::modelled_limits(scene, model.robot())),
      certifies_(scene::safety_type(scene) != scene::SafetyType::none),
      view_(controllers),
      constraints_(scene, model) {
  if (controllers == nullptr)
    own_ = std::make_unique<control::WorldView>(scene, model, control::default_influence_m);
  else if (scene.map && !scene.map->known)
    own_ = std::make_unique<control::WorldView>(with_nothing_in_unknown_space(scene), model,
                                                controllers->influence_m());
  else if (!controller_sees_all(scene))
    own_ = std::make_unique<control::WorldView>(scene, model, *controllers);
  if (own_) view_ = own_.get();
  min_clearance_ = view_->influence_m();
  min_self_clearance_ = view_->self_influence_m();
  if (own_ && !scene.goals.empty() && !scene.goals.front().may_touch.empty())
    allow(&scene.goals.front().may_touch, 0);
}

// Motions that leave this node are judged by what is allowed from here on.
void Judge::allow(const scene::Allowance* may_touch, std::size_t goal) {
  constraints_.set_goal(goal);
  const scene::Allowance next = may_touch != nullptr ? *may_touch : scene::Allowance{};
  if (next == may_touch_ && (next.empty() || goal == goal_)) return;
  may_touch_ = next;
  goal_ = goal;
  if (!next.empty()) allowed_.push_back({goal + 1, scene::to_json(next), view_->influence_m()});
  own_->allow(next);
  plant_.allow(next);
  own_->look(plant_.node().q, plant_.node().time_s);
}

void Judge::observe_node() {
  view_->look(plant_.node().q, plant_.node().time_s);
  note_limits();
  note_clearance();
  constraints_.observe(plant_.node().q, plant_.node().time_s);
  touching_ = view_->touching();
  contacts_ = plant_.contacts();
  if (plant_.node().k > 0 && certifies_ && (view_->has_obstacles() || view_->has_self())) certify();
}

void Judge::note_limits() {
  const Plant::Node& node = plant_.node();
  if (limits_.q_lower.size() > 0)
    raise(position_excess_,
          std::max((node.q - limits_.q_upper).maxCoeff(), (limits_.q_lower - node.q).maxCoeff()));
  if (limits_.velocity_max.size() > 0)
    raise(speed_excess_, (node.v.cwiseAbs() - limits_.velocity_max).maxCoeff());
}

void Judge::note_clearance() {
  min_clearance_ = std::min(min_clearance_, view_->clearance_m());
  min_self_clearance_ = std::min(min_self_clearance_, view_->self_clearance_m());
  if (!may_touch_.empty())
    allowed_.back().clearance_m = std::min(allowed_.back().clearance_m, view_->whole_clearance_m());
}

void Judge::certify() {
  const auto verdict = view_->certify(plant_.node().q, plant_.node().v);
  certified_ = verdict.certified;
  ++checked_steps_;
  if (certified_) ++certified_steps_;
  tightest_step_m_ = std::min(tightest_step_m_.value_or(verdict.margin_m), verdict.margin_m);
  if (!verdict.contact || touching_) return;
  const std::string parts =
      verdict.self_pair < 0
          ? ""
          : fmt::format("of {} ", view_->self_field()->describe(verdict.self_pair));
  on_the_way_ = fmt::format("contact {}between the nodes {} and {}", parts, plant_.node().k - 1,
                            plant_.node().k);
}

void Judge::depart(const Eigen::VectorXd& v) {
  view_->depart(plant_.node().q, v);
}

std::string Judge::advance_map() {
  return own_ ? own_->advance_map() : "";
}

void Judge::take_load() {
  own_ = control::WorldView::for_other_load(scene_, model_, *own_);
  view_ = own_.get();
  constraints_.take_load();
}

void Judge::look_again() {
  view_->look(plant_.node().q, plant_.node().time_s);
  note_clearance();
  touching_ = touching_ || view_->touching();
}

void Judge::fill(log::Result& result) const {
  if (view_->has_obstacles()) result.min_clearance_m = min_clearance_;
  if (view_->has_self()) result.min_self_clearance_m = min_self_clearance_;
  result.position_excess = position_excess_;
  result.speed_excess = speed_excess_;
  result.tightest_step_m = tightest_step_m_;
  result.may_touch = allowed_;
  result.constraints = constraints_.figures();
  for (std::string& line : constraints_.violations()) result.warnings.push_back(std::move(line));
  if (checked_steps_ > 0)
    result.certified_share =
        static_cast<double>(certified_steps_) / static_cast<double>(checked_steps_);
  for (const auto& warning : view_->environment().summary().warnings)
    result.warnings.push_back(warning);
}

}  // namespace hamelin::simulation
