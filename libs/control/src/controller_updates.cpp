// What other threads change of a controller (goals, targets, parameters, loads), and how the tick
// takes it.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hamelin/control/controller.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "line_buffer.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// Beyond these bounds the surroundings are not known, or memory would be missing.
void check_size(std::span<const scene::Payload> payloads, const model::Model& loaded,
                const World& world) {
  for (const scene::Payload& payload : payloads)
    if (const double reach = scene::reach_beyond_tip(payload); reach > world.payload_reach_m())
      throw Error(ErrorCode::invalid,
                  fmt::format("payload '{}': extends {:.3g} m beyond the tip, expected at most "
                              "{:.3g} m (payload_reach_m)",
                              payload.name, reach, world.payload_reach_m()));
  if (loaded.shapes().size() > world.shapes_max())
    throw Error(
        ErrorCode::invalid,
        fmt::format("payload: the arm with it has {} spheres and capsules, expected at most "
                    "{} (payload_shapes_max)",
                    loaded.shapes().size(), world.shapes_max()));
}

}  // namespace

std::uint64_t Controller::set_goals(std::vector<scene::Goal> goals) {
  check_goals(goals, scene_, nominal_, path_points_max_, plugin());
  const std::lock_guard lock(goals_mutex_);
  newest_goals_ = goals;
  expect_target(goals);
  new_goals_.publish(std::make_unique<GoalList>(++goals_number_, std::move(goals)));
  return goals_number_;
}

void Controller::expect_target(const std::vector<scene::Goal>& goals) {
  const scene::Goal* const follow = follow_goal_of(goals);
  receives_ = follow != nullptr && !follow->motion;
  if (!receives_) return;
  receiver_.start(follow->stream);
  new_target_.publish(std::make_unique<StreamedTarget>());  // what belongs to an earlier goal
}

template <class Sample>
void Controller::receive_target(const Sample& sample) {
  const std::lock_guard lock(goals_mutex_);
  if (!receives_)
    throw Error(ErrorCode::invalid,
                "target: no goal follows a streamed target, expected a follow goal");
  new_target_.publish(std::make_unique<StreamedTarget>(receiver_.take(sample)));
}

void Controller::set_target(const TargetPose& pose) {
  receive_target(pose);
}

void Controller::set_target(const TargetTwist& twist) {
  receive_target(twist);
}

void Controller::set_planner_params(const Json& changes) {
  if (!changes.is_object())
    throw Error(ErrorCode::invalid,
                fmt::format("parameters of planner '{}': /: expected an object", plugin().name()));
  const std::lock_guard lock(load_mutex_);
  Json all = params_;
  all.update(changes);
  all = planning::check_params(plugin(), all);
  auto fresh = std::make_unique<NewParams>();
  fresh->params.emplace(newest_arm_->planner.prepare_params(all));
  fresh->number = ++params_number_;
  new_params_.publish(std::move(fresh));
  params_ = std::move(all);
}

Json Controller::planner_params() const {
  const std::lock_guard lock(load_mutex_);
  return params_;
}

std::uint64_t Controller::attach(const scene::Payload& payload, const VectorXd& q) {
  const std::string where = fmt::format("payload '{}'", payload.name);
  scene::check(payload, where);
  const std::lock_guard lock(load_mutex_);
  std::vector<scene::Payload> all = payloads();
  for (const auto& other : all)
    if (other.name == payload.name)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: is attached already, expected another name", where));
  all.push_back(payload);
  return publish_load(std::move(all), q);
}

std::uint64_t Controller::detach(std::string_view name, const VectorXd& q) {
  const std::lock_guard lock(load_mutex_);
  std::vector<scene::Payload> all = payloads();
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const auto& payload) { return payload.name == name; });
  if (found == all.end()) {
    std::vector<std::string> names;
    for (const auto& payload : all) names.push_back(payload.name);
    throw Error(ErrorCode::invalid,
                fmt::format("payload '{}': is not attached, expected one of the {} that are{}",
                            name, names.size(), did_you_mean(name, names)));
  }
  all.erase(found);
  return publish_load(std::move(all), q);
}

std::vector<std::string> Controller::attached() const {
  const std::lock_guard lock(load_mutex_);
  std::vector<std::string> names;
  for (const auto& payload : payloads()) names.push_back(payload.name);
  return names;
}

const std::vector<scene::Payload>& Controller::payloads() const {
  return load_number_ > 0 && refused_load_.load() == load_number_ ? accepted_ : attached_;
}

std::uint64_t Controller::publish_load(std::vector<scene::Payload> all, const VectorXd& q) {
  if (q.size() != nominal_.dof() || !q.allFinite())
    throw Error(
        ErrorCode::invalid,
        fmt::format("q: {} values given, expected {} finite numbers (one per joint of '{}')",
                    q.size(), nominal_.dof(), nominal_.robot().name));
  scene::Scene scene = scene_;
  scene.start_q = q;
  scene.start_v.resize(0);
  {
    const std::lock_guard goals_lock(goals_mutex_);
    scene.goals = newest_goals_;
  }
  model::Model model =
      carrying(nominal_, all, scene_.model.self_collision, scene_.safety.margin_m, q);
  check_size(all, model, world_);
  auto fresh = std::make_unique<NewLoad>();
  fresh->number = load_number_ + 1;
  fresh->params_number = params_number_;
  fresh->arm = std::make_unique<LoadedArm>(scene, std::move(model), params_, common());
  if (used_load_.load() == load_number_) accepted_ = attached_;
  attached_ = std::move(all);
  newest_arm_ = fresh->arm.get();
  new_load_.publish(std::move(fresh));
  return ++load_number_;
}

std::string_view Controller::load_defect(LoadedArm& fresh) {
  (void)fresh.view.take_newest();
  fresh.view.look(q_, time_s_);
  load_refusal_.clear();
  if (!fresh.shield) {
    if (fresh.view.touching()) fresh.view.describe_contact(load_refusal_);
    return load_refusal_.view();
  }
  const Shield::Surroundings world{fresh.view.environment(), fresh.view.snapshot(), time_s_.load()};
  const Shield::Node now =
      options_.position ? Shield::Node{point_q_, point_v_} : Shield::Node{q_, v_};
  if (!shielded_ || fresh.shield->start_in_place_of(*arm_->shield, world, now)) return {};
  fresh.shield->describe(world.environment, load_refusal_);
  return load_refusal_.view();
}

// Takes over what the arm is doing, so that its torque goes on from the last one.
void Controller::take_load() {
  NewLoad& newest = new_load_.take();
  if (newest.number == answer_.load || newest.number == answer_.refused_load) return;
  LoadedArm& fresh = *newest.arm;
  if (const std::string_view defect = load_defect(fresh); !defect.empty()) {
    answer_.refused_load = newest.number;
    answer_.load_refusal = defect;
    refused_load_.store(newest.number);
    return;
  }
  fresh.limits.start_from(answer_.torque);
  if (fresh.pipeline) fresh.pipeline->continue_from(*arm_->pipeline);
  std::swap(arm_, newest.arm);
  goals_.set_model(arm_->model);
  used_params_ = newest.params_number;  // newer ones are applied to this arm's planner, too
  answer_.load = newest.number;
  used_load_.store(newest.number);
  if (goal_.goal != nullptr) ++goal_.number;
  ++listed_number_;
}

void Controller::take_goals() {
  const GoalList& newest = new_goals_.take();
  if (&newest == goal_list_) return;
  goal_list_ = &newest;
  goals_.set_goals(newest.goals);
  goal_ = {nullptr, goal_.number + 1, 0};
  ++listed_number_;
  listed_ = nullptr;
  target_.stop();
  reference_.stop();
}

// A target starts where the tip is when its goal becomes the current one.
void Controller::update_target() {
  const scene::Goal* const goal = goals_.follows() ? &goals_.goal() : nullptr;
  answer_.target = nullptr;
  if (goal == nullptr) return;
  if (target_.goal() != goal) target_.start(*goal, tip());
  answer_.target = &target_.update(time_s_, new_target_.take(), tip());
}

// A trajectory begins when its goal becomes the current one.
void Controller::update_reference() {
  const scene::Goal& goal = goals_.goal();
  answer_.reference = nullptr;
  if (!goal.trajectory) return reference_.stop();
  if (reference_.goal() != &goal) reference_.start(goal);
  answer_.reference = &reference_.update(period_s_, q_, v_);
  // an arm that waits where its reference does has not stalled
  if (reference_.on_the_way() && answer_.reference->rate > 0.0) goals_.forget_rest();
}

const hamelin_goal* Controller::goal_for_planner() {
  if (guidance_ && guidance_->goal() != nullptr) return guidance_->goal();
  if (answer_.target == nullptr && answer_.reference == nullptr) return listed_;
  live_goal_ = *listed_;
  if (answer_.target != nullptr) control::set_target(*answer_.target, live_goal_);
  if (answer_.reference != nullptr) control::set_reference(*answer_.reference, live_goal_);
  return &live_goal_;
}

void Controller::update_guidance() {
  const Guidance::News news = guidance_->update(
      {time_s_, period_s_, q_, goals_.goal(), listed_number_ + 1, arm_->view.snapshot()},
      *arm_->guide);
  if (const std::uint64_t number = guidance_->number(); number != guidance_number_) {
    guidance_number_ = number;
    ++goal_.number;
  }
  if (news == Guidance::News::none || !options_.log) return;
  LineBuffer line;
  if (news == Guidance::News::path)
    append(line, "guide: a path of length {:.4g}", guidance_->figures().length);
  else
    append(line, "guide: {}", guidance_->cause());
  options_.log(HAMELIN_LOG_INFO, line.view());
}

void Controller::take_params() {
  const NewParams& newest = new_params_.take();
  if (newest.number == used_params_) return;
  used_params_ = newest.number;
  arm_->planner.apply_params(*newest.params);
}

}  // namespace hamelin::control
