#include "judge.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "hamelin/core/numbers.hpp"
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

std::string Judge::describe_contact() const {
  const Plant::Description& plant = plant_.description();
  if (!plant.detects_contacts) return view_->describe_contact();
  std::string judged =
      fmt::format("counts none at a clearance of {:.2g} mm",
                  1e3 * std::min(view_->clearance_m(),
                                 view_->has_self() ? view_->self_clearance_m() : infinity));
  if (touching_)
    judged = view_->describe_contact();
  else if (!on_the_way_.empty())
    judged = on_the_way_;
  return fmt::format("{} {}; the judge: {}", plant.name,
                     contacts_.count > 0 ? plant_.describe_contact() : "counts no contact", judged);
}

std::string Judge::describe_refusal() const {
  std::string cause = describe_contact();
  if (touching_ && view_->clearance_m() > 0.0)
    cause += fmt::format("; {}", scene::self_contact_remedy(scene_.robot));
  return cause;
}

std::optional<log::Result::MoverContact> Judge::mover_contact() const {
  const scene::Contact* const touch = view_->nearest();
  // Between two nodes, contact is found where both of them are still apart.
  constexpr double at_node_m = 1e-3;
  if (touch == nullptr || touch->distance > at_node_m || touch->obstacle < 0) return std::nullopt;
  const auto index = static_cast<std::size_t>(touch->obstacle);
  const scene::Environment& environment = view_->environment();
  const scene::Obstacle& obstacle = environment.obstacles()[index];
  if (!environment.moves(index) && obstacle.appears_s <= 0.0) return std::nullopt;
  const int link = model_.shapes()[static_cast<std::size_t>(touch->sphere)].link;
  const double now = plant_.node().time_s;
  const Eigen::Vector3d arm =
      dynamics::point_velocity(model_, view_->poses(), link, touch->arm_point, plant_.node().v);
  log::Result::MoverContact out;
  out.obstacle = obstacle.name;
  out.link = model_.robot().links[static_cast<std::size_t>(link)].name;
  out.prediction = scene::to_string(obstacle.prediction);
  out.time_s = now;
  out.arm_speed_m_s = arm.norm();
  out.obstacle_speed_m_s = touch->obstacle_velocity.norm();
  out.closing_speed_m_s = touch->direction.dot(touch->obstacle_velocity - arm);
  const Eigen::Vector3d at = scene::motion_at(obstacle, now).pose.p();
  for (const double ahead : {0.1, 0.3, 1.0}) {
    if (ahead > now || !scene::exists(obstacle, now - ahead)) continue;
    const scene::Placed predicted = scene::placed_at(obstacle, {now - ahead, ahead});
    out.prediction_errors.push_back(
        {ahead, std::max(0.0, (predicted.pose.p() - at).norm() - predicted.nearer_m)});
  }
  return out;
}

std::vector<std::string> Judge::describe_goals_in_contact() {
  std::vector<std::string> out;
  if (!view_->has_obstacles() && !view_->has_self()) return out;
  const std::array<double, 1> point{0.0};
  const auto& environment = view_->environment();
  for (std::size_t i = 0; i < scene_.goals.size(); ++i) {
    const auto& goal = scene_.goals[i];
    if (goal.type == scene::GoalType::follow) break;  // it moves
    if (goal.type == scene::GoalType::any_of || scene::is_region(goal)) continue;
    const bool of_joints = goal.type == scene::GoalType::joint;
    if (own_) own_->allow(goal.may_touch);
    const scene::Shapes placed =
        of_joints ? view_->place(goal.q) : scene::Shapes{{&goal.pose.p(), 1}, point};
    scene::Contact deepest;
    if (view_->deepest_at_start(placed, deepest))
      out.push_back(fmt::format(
          "goal {}: {}; the exit direction is {}", i + 1,
          of_joints ? environment.describe(deepest, model_)
                    : fmt::format("its tip is {:.2g} mm inside {}", -1e3 * deepest.distance,
                                  environment.describe(deepest.obstacle)),
          scene::describe_exit_direction(deepest)));
    scene::SelfContact worst;
    if (of_joints && view_->deepest_self(placed, worst))
      out.push_back(
          fmt::format("goal {}: the arm touches itself: {} are {:.2g} mm inside each other", i + 1,
                      view_->self_field()->describe(worst.pair), -1e3 * worst.distance));
  }
  if (own_) own_->allow(may_touch_);
  return out;
}

void Judge::count_contacts(log::Result& result) const {
  const Plant::Description& plant = plant_.description();
  if (!plant.detects_contacts) return;
  if (!result.plant) result.plant = {plant.type, plant.version, 0, 0, {}};
  if (touching_ || !on_the_way_.empty()) ++result.plant->judge_contacts;
  if (contacts_.count == 0) return;
  ++result.plant->contacts;
  result.plant->deepest_m =
      std::min(result.plant->deepest_m.value_or(contacts_.deepest_m), contacts_.deepest_m);
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
