// What other threads change of a controller (goals, targets, parameters, loads), and how the tick
// takes it.
#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "guide/guidance.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "loop/append_line.hpp"
#include "loop/goal_list.hpp"
#include "loop/loaded_arm.hpp"
#include "loop/mailbox.hpp"
#include "loop/path_reference.hpp"

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// After so long at rest on its path another one is asked for [s].
constexpr double longest_held_s = 0.1;
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
  for (std::size_t i = 0; i < goals.size(); ++i) {
    try {
      world_.require_obstacles(goals[i].may_touch);
    } catch (const Error& e) {
      throw Error(e.code(), fmt::format("goal {}: may_touch: {}", i + 1, e.what()));
    }
  }
  const std::lock_guard load_lock(load_mutex_);
  const std::vector<std::uint64_t> allowances = world_.allow(allowances_of(goals));
  GoalList::Motions motions = newest_arm_->certify(goals, allowances, arm_setup());
  const std::lock_guard lock(goals_mutex_);
  newest_goals_ = goals;
  expect_target(goals);
  keep_motions(++goals_number_, motions);
  mail_->goals.publish(std::make_unique<GoalList>(goals_number_, std::move(goals), allowances,
                                                  std::move(motions), load_number_));
  return goals_number_;
}

// A stop may go on along the path of goals that are gone.
void Controller::keep_motions(std::uint64_t number, const ProvedMotions& motions) {
  std::erase_if(kept_motions_, [oldest = oldest_goals_.load(std::memory_order_acquire)](
                                   const auto& kept) { return kept.first < oldest; });
  if (std::any_of(motions.begin(), motions.end(), [](const auto& path) { return path != nullptr; }))
    kept_motions_.emplace_back(number, motions);
}

void Controller::release_motions() {
  if (oldest_goals_.load(std::memory_order_relaxed) == goal_list_->number) return;
  const auto is_old = [&](const CertifiedPath* path) {
    const auto& given = goal_list_->motions;
    return path != nullptr && !(guidance_ && path == guidance_->motion()) &&
           std::none_of(given.begin(), given.end(),
                        [&](const auto& other) { return other.get() == path; });
  };
  const Shield* const shield = arm_->shield.get();
  if (is_old(path_in_force()) || (shield != nullptr && is_old(shield->path_proof().path()))) return;
  oldest_goals_.store(goal_list_->number, std::memory_order_release);
}

void Controller::expect_target(const std::vector<scene::Goal>& goals) {
  const scene::Goal* const follow = follow_goal_of(goals);
  receives_ = follow != nullptr && !follow->motion;
  if (!receives_) return;
  receiver_.start(follow->stream);
  mail_->target.publish(std::make_unique<StreamedTarget>());  // what belongs to an earlier goal
}

template <class Sample>
void Controller::receive_target(const Sample& sample) {
  const std::lock_guard lock(goals_mutex_);
  if (!receives_)
    throw Error(ErrorCode::invalid,
                "target: no goal follows a streamed target, expected a follow goal");
  mail_->target.publish(std::make_unique<StreamedTarget>(receiver_.take(sample)));
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
  mail_->params.publish(std::move(fresh));
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
  std::vector<scene::Payload> all = newest_load().payloads;
  for (const auto& other : all)
    if (other.name == payload.name)
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: is attached already, expected another name", where));
  all.push_back(payload);
  return publish_load(std::move(all), q);
}

std::uint64_t Controller::detach(std::string_view name, const VectorXd& q) {
  const std::lock_guard lock(load_mutex_);
  std::vector<scene::Payload> all = newest_load().payloads;
  const auto found = std::find_if(all.begin(), all.end(),
                                  [&](const auto& payload) { return payload.name == name; });
  if (found == all.end()) {
    const std::vector<std::string> names = names_of(all);
    throw Error(ErrorCode::invalid,
                fmt::format("payload '{}': is not attached, expected one of the {} that are{}",
                            name, names.size(), did_you_mean(name, names)));
  }
  all.erase(found);
  return publish_load(std::move(all), q);
}

std::vector<std::string> Controller::attached() const {
  const std::lock_guard lock(load_mutex_);
  return names_of(newest_load().payloads);
}

Controller::Carried Controller::newest_load() const {
  const bool refused = load_number_ > 0 && refused_load_.load() == load_number_;
  if (refused) return {used_load_.load(), accepted_};
  return {load_number_, attached_};
}

model::Model Controller::model_carrying(std::span<const scene::Payload> payloads,
                                        const VectorXd& q) const {
  return scene::carrying(nominal_, payloads, scene_.model.self_collision, scene_.safety.margin_m,
                         q);
}

std::uint64_t Controller::publish_load(std::vector<scene::Payload> all, const VectorXd& q) {
  if (q.size() != nominal_.dof() || !q.allFinite())
    throw Error(
        ErrorCode::invalid,
        fmt::format("q: {} values given, expected {} finite numbers (one per joint of '{}')",
                    q.size(), nominal_.dof(), nominal_.robot().name));
  model::Model model = model_carrying(all, q);
  check_size(all, model, world_);
  world_.note_load(load_number_ + 1, model);
  publish_arm(load_number_ + 1, 0, std::move(model), q);
  if (used_load_.load() == load_number_) accepted_ = attached_;
  attached_ = std::move(all);
  return ++load_number_;
}

void Controller::publish_arm(std::uint64_t number, std::uint64_t resumes, model::Model model,
                             const VectorXd& q) {
  scene::Scene scene = scene_;
  scene.start_q = q;
  scene.start_v.resize(0);
  {
    const std::lock_guard goals_lock(goals_mutex_);
    scene.goals = newest_goals_;
  }
  auto fresh = std::make_unique<NewLoad>();
  fresh->serial = serial_ + 1;
  fresh->number = number;
  fresh->params_number = params_number_;
  fresh->arm = std::make_unique<LoadedArm>(scene, std::move(model), params_, arm_setup());
  // one that was not taken yet may be asked to go on, too
  if (taken_serial_.load() == serial_) resumes_ = 0;
  fresh->resumes = resumes_ = std::max(resumes_, resumes);
  newest_arm_ = fresh->arm.get();
  mail_->load.publish(std::move(fresh));
  ++serial_;
}

void Controller::resume() {
  const std::lock_guard lock(load_mutex_);
  const std::uint64_t stop = stopped_.load();
  if (stop == 0) return;
  VectorXd q(nominal_.dof());
  for (Eigen::Index i = 0; i < q.size(); ++i) q[i] = measured_[static_cast<std::size_t>(i)].load();
  const Carried load = newest_load();
  publish_arm(load.number, stop, model_carrying(load.payloads, q), q);
}

void Controller::stop(std::string_view cause) {
  auto fresh = std::make_unique<StopRequest>();
  append(fresh->cause, "{}", one_line(cause));
  const std::lock_guard lock(stop_mutex_);
  fresh->number = ++stop_number_;
  mail_->stop.publish(std::move(fresh));
}

void Controller::take_stop() {
  const StopRequest& newest = mail_->stop.take();
  if (newest.number == taken_stop_) return;
  taken_stop_ = newest.number;
  if (answer_.state != ControlState::stopping)
    start_braking(StopReason::request, newest.cause.view());
  else
    withdrawn_serial_ = waiting_serial_;
}

void Controller::describe_defect(LoadedArm& fresh, LineBuffer& line) {
  const Stop::Node node = fresh.drive->node();
  (void)fresh.view.take_newest();
  fresh.view.look(node.q, time_s_);
  if (!fresh.shield) {
    if (fresh.view.touching()) fresh.view.describe_contact(line);
    return;
  }
  const Shield::Surroundings world{fresh.view.environment(), fresh.view.snapshot(), time_s_.load(),
                                   fresh.view.standing()};
  if (!shielded_ ||
      fresh.shield->start_in_place_of(*arm_->shield, world, node, fresh.drive->stop_start()))
    return;
  fresh.shield->describe(world.environment, line);
}

// Takes over what the arm is doing, so that its torque goes on from the last one.
void Controller::take_load() {
  NewLoad& newest = mail_->load.take();
  if (newest.serial == taken_serial_.load()) return;
  const bool asked = newest.resumes > 0 && newest.resumes == stopped_.load() &&
                     newest.serial != withdrawn_serial_,
             resumes = asked && usable_;
  if (asked && !usable_ && unusable_ <= options_.lost_measurements_max) {
    waiting_serial_ = newest.serial;
    return;
  }
  taken_serial_ = newest.serial;
  if (newest.number == answer_.load && !resumes) return;
  LoadedArm& fresh = *newest.arm;
  (void)fresh.view.allow(arm_->view.allowance());
  fresh.drive->continue_from(*arm_->drive);
  if (resumes) fresh.drive->resume();
  LineBuffer defect;
  describe_defect(fresh, defect);
  if (!defect.view().empty()) {
    if (resumes) refuse_to_go_on(defect);
    if (newest.number != answer_.load) refuse_load(newest.number, defect);
    return;
  }
  fresh.drive->take_over();
  begun_stop_ = 0;
  std::swap(arm_, newest.arm);
  goals_.set_model(arm_->model);
  used_params_ = newest.params_number;  // newer ones are applied to this arm's planner, too
  answer_.load = newest.number;
  used_load_.store(newest.number);
  if (goal_.goal != nullptr) ++goal_.number;
  ++listed_number_;
  if (resumes) go_on();
}

void Controller::refuse_load(std::uint64_t number, const LineBuffer& defect) {
  load_refusal_ = defect;
  answer_.refused_load = number;
  answer_.load_refusal = load_refusal_.view();
  refused_load_.store(number);
}

void Controller::refuse_to_go_on(const LineBuffer& defect) {
  cause_line_.clear();
  append(cause_line_, "cannot go on: {}", defect.view());
  answer_.cause = cause_line_.view();
}

void Controller::go_on() {
  answer_.state = ControlState::running;
  answer_.reason = StopReason::none;
  lost_ = {};
  stopped_ = 0;
  late_answers_ = 0;
  goals_.forget_rest();
}

void Controller::take_goals() {
  const GoalList& newest = mail_->goals.take();
  if (&newest == goal_list_) return;
  goal_list_ = &newest;
  goals_.set_goals(newest.goals);
  goal_ = {nullptr, goal_.number + 1, 0, nullptr};
  ++listed_number_;
  listed_ = nullptr;
  target_.stop();
  reference_.stop();
  if (!guidance_ || path_reference_->path() != guidance_->motion()) path_reference_->stop();
  forsaken_ = nullptr;
}

// Touching another thing is allowed in another world.
void Controller::allow_for_goal() {
  const std::size_t index = std::min(goals_.index(), goals_.size() - 1);
  const scene::Allowance& may_touch = goal_list_->goals[index].may_touch;
  answer_.may_touch = may_touch.empty() ? nullptr : &may_touch;
  if (!arm_->view.allow(goal_list_->allowances[index])) return;
  answer_.snapshot = arm_->view.snapshot();
  see();
}

// A target starts where the tip is when its goal becomes the current one.
void Controller::update_target() {
  const scene::Goal* const goal = goals_.follows() ? &goals_.goal() : nullptr;
  answer_.target = nullptr;
  if (goal == nullptr) return;
  if (target_.goal() != goal) target_.start(*goal, tip());
  answer_.target = &target_.update(time_s_, mail_->target.take(), tip());
}

// A trajectory begins when its goal becomes the current one.
void Controller::update_reference() {
  const scene::Goal& goal = goals_.goal();
  answer_.reference = nullptr;
  if (const CertifiedPath* const path = proved_trajectory()) {
    reference_.stop();
    return follow(path);
  }
  if (!goal.trajectory) return reference_.stop();
  if (reference_.goal() != &goal) reference_.start(goal);
  answer_.reference = &reference_.update(period_s_, q(), v());
  // an arm that waits where its reference does has not stalled
  if (reference_.on_the_way() && answer_.reference->rate > 0.0) goals_.forget_rest();
}

const CertifiedPath* Controller::proved_trajectory() const noexcept {
  if (goal_list_->load != answer_.load) return nullptr;
  const CertifiedPath* const path =
      goal_list_->motions[std::min(goals_.index(), goals_.size() - 1)].get();
  return path != forsaken_ ? path : nullptr;
}

bool Controller::on_the_way() const noexcept {
  const CertifiedPath* const path = proved_trajectory();
  if (path == nullptr) return reference_.on_the_way();
  return path != path_reference_->path() || !path_reference_->state().ended;
}

const hamelin_goal* Controller::goal_for_planner() {
  if (guidance_ && guidance_->goal() != nullptr) {
    if (path_reference_->path() == nullptr) return guidance_->goal();
    live_goal_ = *guidance_->goal();
    control::set_reference(path_reference_->state(), live_goal_);
    return &live_goal_;
  }
  if (answer_.target == nullptr && answer_.reference == nullptr && !guidance_) return listed_;
  live_goal_ = *listed_;
  if (guidance_) guidance_->tell(live_goal_);
  if (answer_.target != nullptr) control::set_target(*answer_.target, live_goal_);
  if (answer_.reference != nullptr) control::set_reference(*answer_.reference, live_goal_);
  return &live_goal_;
}

void Controller::update_guidance() {
  const Guidance::News news = guidance_->update(
      {time_s_, period_s_, q(), goal_list_->shared, std::min(goals_.index(), goals_.size() - 1),
       listed_number_ + 1, arm_->view.snapshot(), arm_->view.allowance(), answer_.target,
       path_in_force(), path_reference_->path(), path_reference_->state()},
      *arm_->guide);
  if (const std::uint64_t number = guidance_->number(); number != guidance_number_) {
    guidance_number_ = number;
    ++goal_.number;
  }
  if (news == Guidance::News::none || !options_.log) return;
  LineBuffer line;
  if (news == Guidance::News::path) {
    append(line, "guide: a path of length {:.4g}", guidance_->figures().length);
    if (const std::size_t options = goals_.goal().any_of.size(); options > 0)
      append(line, " to option {} of {}", guidance_->figures().option + 1, options);
    append(line, "{}{}",
           guidance_->cause().empty() ? "" : ", without a motion: ", guidance_->cause());
  } else
    append(line, "guide: {}", guidance_->cause());
  // in a world that changes all the time, so does the search
  if (line.view() == guide_line_.view()) return;
  guide_line_ = line;
  options_.log(HAMELIN_LOG_INFO, line.view());
}

const CertifiedPath* Controller::path_in_force() const noexcept {
  const FailSafe& motion = arm_->stop().motion();
  return motion.along_path() ? motion.path_stop().path() : nullptr;
}

void Controller::follow(const CertifiedPath* path) {
  if (path == nullptr)
    path_reference_->stop();
  else if (path != path_reference_->path())
    path_reference_->start(*path, guidance_ && path == guidance_->motion()
                                      ? guidance_->beginning()
                                      : timing::TimedPath::Place());
  on_path_ = false;
  if (path == nullptr) return;
  const ReferenceState& state =
      path_reference_->update({period_s_, q(), v(), answer_.stopping, arm_->view.speed_scale()});
  answer_.reference = &state;
  on_path_ = state.error < HAMELIN_ON_PATH;
  if (!state.ended && state.rate > 0.0) goals_.forget_rest();
}

// A given path was followed when the goal was looked at. An arm that may not go on from where it
// rests needs another path, and so does one whose given path is blocked.
void Controller::update_path() {
  const bool is_given = proved_trajectory() != nullptr;
  if (!is_given) follow(guidance_ ? guidance_->motion() : nullptr);
  const CertifiedPath* const path = path_reference_->path();
  Shield* const shield = arm_->shield.get();
  if (shield != nullptr && shield->path_proof().path() != path)
    shield->set_path(path, surroundings());
  if (path == nullptr) return;
  if (shield != nullptr)
    shield->note_path(
        path_reference_->next(static_cast<double>(drive_options_->delay_periods) * period_s_));
  const bool held = answer_.stopping && arm_->stop().at_rest(),
             blocked = is_given && shield != nullptr && shield->path_proof().blocked();
  held_s_ = held ? held_s_ + period_s_ : 0.0;
  if (held_s_ < longest_held_s && !blocked) return;
  held_s_ = 0.0;
  if (is_given)
    forsaken_ = path;
  else if (!guidance_->request())
    guidance_->give_up_path();
}

void Controller::take_params() {
  const NewParams& newest = mail_->params.take();
  if (newest.number == used_params_) return;
  used_params_ = newest.number;
  arm_->planner.apply_params(*newest.params);
}

}  // namespace hamelin::control
