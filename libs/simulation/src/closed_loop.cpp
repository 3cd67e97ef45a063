#include "closed_loop.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "hamelin/core/error.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/simulation/integrator_options.hpp"
#include "plant.hpp"

namespace hamelin::simulation {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

// The arm is looked at this far from itself, at most.
constexpr double self_influence_max_m = 0.10;
// Obstacles are looked for this far where neither planner nor anything else says more.
constexpr double default_influence_m = 0.2;
// Figures that must be zero are so up to this share of the kinetic energy and 1 J: far above rounding, far below what
// matters.
constexpr double rounding_share = 1e-9;
// What the energy account is off by is the scheme's own: a second-order step that resolves the motion at all (h times
// its frequency below 0.5) errs by (0.5)²/12 = 2 % of the energy in motion or exchanged.
constexpr double account_share = 0.02;
// Motion in unknown space that is to be crossed slowly is asked for at this share of the speed.
constexpr double slow_speed_scale = 0.25;

Eigen::VectorXd limits_of(const model::Robot& robot, std::optional<double> model::Joint::*member, double unlimited) {
  VectorXd limits(robot.dof());
  for (int i = 0; i < robot.dof(); ++i)
    limits[i] = (robot.links[static_cast<std::size_t>(i)].joint.*member).value_or(unlimited);
  return limits;
}

model::Model scaled_masses(const model::Model& plant, double scale) {
  model::Robot robot = plant.robot();
  for (auto& link : robot.links) {
    link.mass_kg *= scale;
    link.inertia_kg_m2 *= scale;
    link.joint.armature *= scale;
  }
  return model::Model(std::move(robot), plant.base(), plant.gravity());
}

planning::Plugin plugin_of(const scene::Scene& scene, const std::vector<std::filesystem::path>& directories) {
  if (!scene.planner)
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /planner: is missing, expected the name of a planner", scene.name));
  return planning::find_plugin(scene.planner->name, directories);
}

long whole_multiple(double value, double unit, const std::string& where, const char* what) {
  const double count = std::round(value / unit);
  if (std::abs(value / unit - count) > 1e-9 * std::max(1.0, count))
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /actuation/{}: {} s is no whole number of {} s", where, what, value, unit));
  return static_cast<long>(count);
}

// What another library refuses, with the scene's name in front.
template <class F>
auto in_scene(const scene::Scene& scene, const char* place, F&& f) {
  try {
    return f();
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}: {}", scene.name, place, e.what()));
  }
}

double angle_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return Eigen::AngleAxisd(a.transpose() * b).angle();
}

}  // namespace

ClosedLoop::ClosedLoop(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories)
    : scene_(scene),
      plant_(load_model(scene)),
      ws_(plant_),
      options_(integrator_options(scene.integrator.params, scene.name + ": /integrator/params")),
      integrator_(integration::make_integrator(scene.integrator.name, plant_, options_)),
      noise_(scene.seed),
      planner_([&] {
        check_scene();
        result_.warnings = model::warnings(plant_.robot());
        const planning::Plugin plugin = plugin_of(scene, plugin_directories);
        planner_params_ =
            in_scene(scene, "/planner/params", [&] { return planning::check_params(plugin, scene.planner->params); });
        influence_ = plugin.influence_m(planner_params_).value_or(default_influence_m);
        steps_ = in_scene(scene, "/duration_s", [&] { return step_count(scene.duration_s, scene.step_s); });

        const auto n = plant_.dof();
        const auto shapes = plant_.shapes().size();
        environment_ = std::make_unique<scene::Environment>(scene::make_environment(scene, plant_, influence_));
        if (environment_->has_obstacles() && shapes == 0)
          throw Error(ErrorCode::invalid, fmt::format("{}: /robot: '{}' has no collision spheres or capsules, expected "
                                                      "some where there are obstacles",
                                                      scene.name, plant_.robot().name));
        scratch_ = std::make_unique<scene::Environment::Scratch>(*environment_, shapes);
        if (scene.model.self_collision) {
          if (shapes == 0)
            throw Error(ErrorCode::invalid, fmt::format("{}: /model/self_collision: '{}' has no collision spheres or "
                                                        "capsules, expected some or false",
                                                        scene.name, plant_.robot().name));
          self_ = std::make_unique<scene::SelfField>(plant_);
          self_influence_ = std::min(influence_, self_influence_max_m);
          if (!self_->note().empty()) result_.warnings.push_back(self_->note());
          self_contacts_.resize(self_->pairs().size());
          self_shown_.resize(self_->pairs().size());
          self_clearance_.assign(self_->pairs().size(), self_influence_);
          self_clearance_before_ = self_clearance_;
        }
        certificate_ = std::make_unique<Certificate>(plant_, *environment_, influence_, self_.get(), self_influence_);
        seen_.assign(environment_->obstacles().size(), 0);
        for (const auto& obstacle : environment_->obstacles())
          hidden_obstacles_ = hidden_obstacles_ || obstacle.judge_only || !obstacle.known;

        contacts_.resize(environment_->contacts_max(shapes) + 1);
        shown_.resize(contacts_.size());
        arm_ = arm_before_ = asked_ = scene::PlacedShapes(plant_);
        clearance_.assign(shapes, influence_);
        clearance_before_ = clearance_;
        command_ = std::make_unique<planning::CommandBuffers>(static_cast<std::size_t>(n), shown_.size());
        for (auto* x : {&v_, &q_before_, &v_before_, &gradient_, &gradient_before_, &impulse_, &q_shown_, &v_shown_,
                        &q_asked_, &node_velocity_, &turning_, &tau_})
          *x = VectorXd::Zero(n);
        if (scene.model.torque_limits)
          limits_ = limits_of(plant_.robot(), &model::Joint::effort_max, std::numeric_limits<double>::infinity());
        plant_damping_ = plant_damping(scene, plant_.robot());
        channels_.coulomb = plant_friction(scene, plant_.robot());
        channels_.coulomb_speed = scene.model.friction_speed;
        if (scene.actuation.coulomb_friction_share > 0.0) {
          if (channels_.coulomb.size() == 0) channels_.coulomb = VectorXd::Zero(n);
          channels_.coulomb +=
              scene.actuation.coulomb_friction_share * limits_of(plant_.robot(), &model::Joint::effort_max, 0.0);
        }
        proves_energy_ =
            scene.actuation.type == scene::ActuationType::ideal && integrator_->name() == "hamel-variational";
        channels_.held_torque = VectorXd::Zero(n);
        channels_.damping = plant_damping_.size() > 0 ? plant_damping_ : VectorXd::Zero(n);
        channels_.gyroscopic.reserve(shown_.size());
        if (scene.actuation.type == scene::ActuationType::sampled) {
          control_steps_ = std::max(
              1L, whole_multiple(scene.actuation.control_period_s, scene.step_s, scene.name, "control_period_s"));
          delay_periods_ =
              whole_multiple(scene.actuation.delay_s, scene.actuation.control_period_s, scene.name, "delay_s");
          // until the first torque arrives the arm is held against gravity
          q_asked_ = scene.start_q.size() > 0 ? scene.start_q : VectorXd::Zero(n);
          torque_before_ = VectorXd::Zero(n);
          dynamics::gravity_torque(plant_, ws_, q_asked_, torque_before_);
          delayed_.assign(static_cast<std::size_t>(delay_periods_) + 1, torque_before_);
        }
        const double mass_scale = scene.actuation.planner_mass_scale;
        return mass_scale == 1.0
                   ? plugin.create(setup_data(plant_, influence_), *this, planner_params_)
                   : plugin.create(setup_data(scaled_masses(plant_, mass_scale), influence_), *this, planner_params_);
      }()) {
  inputs_ = inputs_of(scene);
  if (scene.map) {
    inputs_.push_back({"map", scene.map->file});
    for (std::size_t i = 0; i < scene.map->changes.size(); ++i)
      if (const auto& file = scene.map->changes[i].file) inputs_.push_back({fmt::format("map_change_{}", i), *file});
  }
  inputs_.push_back({"plugin", planner_.plugin().file()});
}

void ClosedLoop::check_scene() const {
  const auto sized = [&](const VectorXd& x, const std::string& place) {
    if (x.size() != plant_.dof())
      throw Error(ErrorCode::invalid, fmt::format("{}: {}: {} numbers given, expected {}, one a joint of '{}'",
                                                  scene_.name, place, x.size(), plant_.dof(), plant_.robot().name));
  };
  if (scene_.start_q.size() > 0) sized(scene_.start_q, "/start/q");
  if (scene_.start_v.size() > 0) sized(scene_.start_v, "/start/v");
  for (std::size_t i = 0; i < scene_.goals.size(); ++i)
    if (scene_.goals[i].type == scene::GoalType::joint)
      sized(scene_.goals[i].q, fmt::format("/goals/{}/q{}", i, scene_.goals[i].path.size() > 0 ? "/0" : ""));
  if (scene_.actuation.coulomb_friction_share > 0.0)
    for (const auto& link : plant_.robot().links)
      if (!link.joint.effort_max)
        throw Error(ErrorCode::invalid,
                    fmt::format("{}: /actuation/coulomb_friction_share: is a share of effort limits, but joint '{}' of "
                                "'{}' has none",
                                scene_.name, link.joint.name, plant_.robot().name));
  if (scene_.goals.empty())
    throw Error(ErrorCode::invalid, fmt::format("{}: /goals: is empty, expected at least one goal", scene_.name));
}

planning::SetupData ClosedLoop::setup_data(const model::Model& nominal, double influence) const {
  planning::SetupData data(nominal);
  for (const auto& goal : scene_.goals) {
    hamelin_goal out{};
    out.type = goal.type == scene::GoalType::joint      ? HAMELIN_GOAL_JOINT
               : goal.type == scene::GoalType::position ? HAMELIN_GOAL_POSITION
                                                        : HAMELIN_GOAL_POSE;
    const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(goal.pose.R());
    for (int i = 0; i < 3; ++i) out.position_world_m[i] = goal.pose.p()[i];
    for (int i = 0; i < 4; ++i) out.quaternion_wxyz[i] = wxyz[i];
    out.tolerance_m = goal.tolerance_m;
    out.tolerance_rad = goal.tolerance_rad;
    out.speed_max = goal.speed_max;
    data.add_goal(out, goal.type == scene::GoalType::joint ? goal.q : VectorXd(), goal.path);
  }
  constexpr double none = std::numeric_limits<double>::infinity();
  const auto& robot = nominal.robot();
  if (scene_.model.joint_limits) {
    data.q_lower = limits_of(robot, &model::Joint::lower, -none);
    data.q_upper = limits_of(robot, &model::Joint::upper, none);
  }
  if (scene_.model.velocity_limits) data.velocity_max = limits_of(robot, &model::Joint::velocity_max, none);
  if (scene_.model.torque_limits) data.effort_max = limits_of(robot, &model::Joint::effort_max, none);
  if (scene_.actuation.torque_rate_max_Nm_s)
    data.effort_rate_max = VectorXd::Constant(nominal.dof(), *scene_.actuation.torque_rate_max_Nm_s);
  data.sampled = scene_.actuation.type == scene::ActuationType::sampled;
  data.delay_s = scene_.actuation.delay_s;
  data.control_period_s = static_cast<double>(control_steps_) * scene_.step_s;
  data.self_collision = scene_.model.self_collision;
  data.influence_m = influence;
  data.map_resolution_m = environment_->summary().resolution_m;
  data.seed = scene_.seed;
  return data;
}

void ClosedLoop::log(std::int32_t level, std::string_view line) {
  if (level == HAMELIN_LOG_INFO && recorder_ != nullptr && !recorder_->logging()) return;  // nobody reads it
  std::string text = fmt::format("{}: {}", scene_.planner->name, line);
  if (level == HAMELIN_LOG_WARNING) result_.warnings.push_back(text);
  if (recorder_ != nullptr)
    recorder_->event(state_.time_s, text);
  else
    early_events_.push_back(std::move(text));
}

std::size_t ClosedLoop::closest_points(std::span<const double> q, double influence_m, std::span<hamelin_contact> out) {
  if (!environment_->has_obstacles()) return 0;
  q_asked_ = Eigen::Map<const VectorXd>(q.data(), plant_.dof());
  dynamics::forward_kinematics(plant_, ws_, q_asked_);
  asked_.place(plant_, ws_);
  const std::size_t found = environment_->closest(
      asked_.view(), std::min(influence_m, influence_), state_.time_s, *scratch_,
      std::span(contacts_).first(std::min(contacts_.size(), out.size())), scene::View::planner, seen_);
  const std::size_t written = std::min({found, contacts_.size(), out.size()});
  for (std::size_t i = 0; i < written; ++i) out[i] = to_c(contacts_[i]);
  return found;
}

std::size_t ClosedLoop::closest_self(std::span<const double> q, double influence_m,
                                     std::span<hamelin_self_contact> out) {
  if (!self_) return 0;
  q_asked_ = Eigen::Map<const VectorXd>(q.data(), plant_.dof());
  dynamics::forward_kinematics(plant_, ws_, q_asked_);
  asked_.place(plant_, ws_);
  const auto room = std::span(self_contacts_).first(std::min(self_contacts_.size(), out.size()));
  const std::size_t found = self_->closest(asked_.view(), std::min(influence_m, self_influence_), room);
  const std::size_t written = std::min(found, room.size());
  for (std::size_t i = 0; i < written; ++i) out[i] = to_c(room[i]);
  return found;
}

void ClosedLoop::look(const VectorXd& q) {
  dynamics::forward_kinematics(plant_, ws_, q);
  clearance_now_ = influence_;
  self_clearance_now_ = self_influence_;
  nearest_.sphere = -1;
  contact_count_ = 0;
  speed_scale_ = 1.0;
  const bool obstacles = environment_->has_obstacles();
  if (obstacles || self_) arm_.place(plant_, ws_);
  if (obstacles) look_at_obstacles();
  if (self_) look_at_itself();
}

void ClosedLoop::look_at_obstacles() {
  std::fill(clearance_.begin(), clearance_.end(), influence_);
  const auto judge = [&](std::size_t count) {
    for (std::size_t i = 0; i < count; ++i) {
      const auto& contact = contacts_[i];
      auto& clearance = clearance_[static_cast<std::size_t>(contact.sphere)];
      clearance = std::min(clearance, contact.distance);
      if (contact.distance < clearance_now_) {
        clearance_now_ = contact.distance;
        nearest_ = contact;
      }
    }
  };
  const auto contacts = [&](scene::View view) {
    return std::min(contacts_.size(),
                    environment_->closest(arm_.view(), influence_, state_.time_s, *scratch_, contacts_, view, seen_));
  };
  if (hidden_obstacles_)
    for (int found = environment_->see(arm_.view(), state_.time_s, seen_); found >= 0;
         found = environment_->see(arm_.view(), state_.time_s, seen_))
      recorder_->event(state_.time_s, fmt::format("obstacle '{}' comes into sight",
                                                  environment_->obstacles()[static_cast<std::size_t>(found)].name));
  contact_count_ = contacts(scene::View::planner);
  for (std::size_t i = 0; i < contact_count_; ++i) shown_[i] = to_c(contacts_[i]);
  judge(contact_count_);
  if (hidden_obstacles_) judge(contacts(scene::View::hidden));
  if (scene_.map && scene_.map->unknown == scene::UnknownPolicy::slow && environment_->in_slow_space(arm_.view()))
    speed_scale_ = slow_speed_scale;
}

void ClosedLoop::look_at_itself() {
  self_contact_count_ = self_->closest(arm_.view(), self_influence_, self_contacts_);
  std::fill(self_clearance_.begin(), self_clearance_.end(), self_influence_);
  for (std::size_t i = 0; i < self_contact_count_; ++i) {
    const auto& contact = self_contacts_[i];
    self_shown_[i] = to_c(contact);
    self_clearance_[static_cast<std::size_t>(contact.pair)] = contact.distance;
    if (contact.distance < self_clearance_now_) {
      self_clearance_now_ = contact.distance;
      nearest_pair_ = contact.pair;
    }
  }
}

hamelin_contact ClosedLoop::to_c(const scene::Contact& contact) {
  hamelin_contact out{};
  out.sphere = contact.sphere;
  out.obstacle = contact.obstacle;
  out.distance_m = contact.distance;
  for (int i = 0; i < 3; ++i) {
    out.arm_point_world_m[i] = contact.arm_point[i];
    out.obstacle_point_world_m[i] = contact.obstacle_point[i];
    out.direction_world[i] = contact.direction[i];
    out.obstacle_velocity_world_m_s[i] = contact.obstacle_velocity[i];
  }
  return out;
}

hamelin_self_contact ClosedLoop::to_c(const scene::SelfContact& contact) {
  hamelin_self_contact out{};
  out.sphere_a = contact.sphere_a;
  out.sphere_b = contact.sphere_b;
  out.distance_m = contact.distance;
  for (int i = 0; i < 3; ++i) {
    out.point_a_world_m[i] = contact.point_a[i];
    out.point_b_world_m[i] = contact.point_b[i];
    out.direction_world[i] = contact.direction[i];
  }
  return out;
}

double ClosedLoop::tip_speed() const {
  const Vector3d tip = dynamics::tip_pose(plant_, ws_).p();
  return dynamics::point_velocity(plant_, ws_, plant_.robot().tip.link, tip, v_).norm();
}

ClosedLoop::GoalError ClosedLoop::goal_error() const {
  const auto& goal = scene_.goals[std::min(goal_index_, scene_.goals.size() - 1)];
  const bool slow = v_.lpNorm<Eigen::Infinity>() < goal.speed_max;
  GoalError error;
  if (goal.type == scene::GoalType::joint) {
    error.radians = (state_.q - goal.q).lpNorm<Eigen::Infinity>();
    error.has_radians = true;
    error.reached = error.radians < goal.tolerance_rad && slow;
    return error;
  }
  const geometry::SE3 tip = dynamics::tip_pose(plant_, ws_);
  error.metres = (tip.p() - goal.pose.p()).norm();
  error.has_metres = true;
  error.reached =
      error.metres < goal.tolerance_m && slow && !(goal.tip_speed_max_m_s && !(tip_speed() < *goal.tip_speed_max_m_s));
  if (goal.type == scene::GoalType::pose) {
    error.radians = angle_between(tip.R(), goal.pose.R());
    error.has_radians = true;
    error.reached = error.reached && error.radians < goal.tolerance_rad;
  }
  return error;
}

bool ClosedLoop::all_reached() {
  while (goal_index_ < scene_.goals.size() && goal_error().reached) {
    ++goal_index_;
    rest_s_ = 0.0;
    recorder_->event(state_.time_s, fmt::format("goal {} of {} reached", goal_index_, scene_.goals.size()));
  }
  return goal_index_ == scene_.goals.size();
}

// The host's own stall rule: the tip at rest, away from a goal that has a place for it, or joints at rest away from
// theirs.
bool ClosedLoop::at_rest_away_from_goal() {
  if (!scene_.stall || command_->raw().state == HAMELIN_PLANNER_OWN_STALL_RULE) return false;
  const auto& rule = *scene_.stall;
  const auto& goal = scene_.goals[goal_index_];
  bool away = true;
  if (goal.type != scene::GoalType::joint)
    away = (dynamics::tip_pose(plant_, ws_).p() - goal.pose.p()).norm() > rule.distance_m;
  rest_s_ = tip_speed() < rule.speed_m_s && away ? rest_s_ + scene_.step_s : 0.0;
  return rest_s_ >= rule.hold_s;
}

void ClosedLoop::finish(log::Outcome outcome, std::string cause) {
  result_.outcome = outcome;
  result_.cause = std::move(cause);
  done_ = true;
}

Certificate::Verdict ClosedLoop::certify() {
  const auto to_obstacles = [&](const std::vector<double>& all) {
    return environment_->has_obstacles() ? std::span<const double>(all) : std::span<const double>();
  };
  return certificate_->check(ws_,
                             {q_before_, v_before_, time_before_s_, arm_before_.view(), to_obstacles(clearance_before_),
                              self_clearance_before_},
                             {state_.q, v_, state_.time_s, arm_.view(), to_obstacles(clearance_), self_clearance_});
}

std::string ClosedLoop::where_touching() const {
  if (nearest_.sphere >= 0 && clearance_now_ <= 0.0)
    return fmt::format("{} at {} s; the way out is {}", environment_->words(nearest_, plant_), state_.time_s,
                       scene::way_out(nearest_));
  const std::string where = fmt::format("the arm touches itself: {} are {:.2g} mm inside each other at {} s",
                                        self_->words(nearest_pair_), -1e3 * self_clearance_now_, state_.time_s);
  return state_.k > 0 ? where : fmt::format("{}; {}", where, scene::self_contact_remedy(scene_.robot));
}

void ClosedLoop::look_at_goals(const Watch& watch) {
  if (!environment_->has_obstacles() && !self_) return;
  const std::array<double, 1> point{0.0};
  for (std::size_t i = 0; i < scene_.goals.size(); ++i) {
    const auto& goal = scene_.goals[i];
    const bool of_joints = goal.type == scene::GoalType::joint;
    const auto warn = [&](const std::string& what) {
      result_.warnings.push_back(fmt::format("goal {}: {}", i + 1, what));
      if (watch.warn) watch.warn(result_.warnings.back());
    };
    scene::Shapes there{{&goal.pose.p(), 1}, point};
    if (of_joints) {
      dynamics::forward_kinematics(plant_, ws_, goal.q);
      asked_.place(plant_, ws_);
      there = asked_.view();
    }
    const std::size_t count =
        std::min(contacts_.size(), environment_->closest(there, 0.0, 0.0, *scratch_, contacts_, scene::View::judge));
    const scene::Contact* deepest = nullptr;
    for (const auto& contact : std::span(contacts_).first(count)) {
      // what moves may be elsewhere by then
      if (contact.obstacle >= 0 &&
          scene::max_speed(environment_->obstacles()[static_cast<std::size_t>(contact.obstacle)]) > 0.0)
        continue;
      if (deepest == nullptr || contact.distance < deepest->distance) deepest = &contact;
    }
    if (deepest != nullptr)
      warn(fmt::format("{}; the way out is {}",
                       of_joints ? environment_->words(*deepest, plant_)
                                 : fmt::format("its tip is {:.2g} mm inside {}", -1e3 * deepest->distance,
                                               environment_->words(deepest->obstacle)),
                       scene::way_out(*deepest)));
    if (!of_joints || !self_) continue;
    const std::size_t near = std::min(self_contacts_.size(), self_->closest(there, 0.0, self_contacts_));
    const auto worst = std::min_element(self_contacts_.begin(), self_contacts_.begin() + static_cast<long>(near),
                                        [](const auto& a, const auto& b) { return a.distance < b.distance; });
    if (near > 0)
      warn(fmt::format("the arm touches itself: {} are {:.2g} mm inside each other", self_->words(worst->pair),
                       -1e3 * worst->distance));
  }
}

bool ClosedLoop::call_planner() {
  q_shown_ = state_.q;
  v_shown_ = v_;
  if (scene_.actuation.joint_noise_rad > 0.0 && scene_.actuation.type == scene::ActuationType::sampled)
    for (auto& angle : q_shown_) angle += scene_.actuation.joint_noise_rad * noise_.normal();
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.k = static_cast<std::uint64_t>(state_.k);
  tick.time_s = state_.time_s;
  tick.q = q_shown_.data();
  tick.v = v_shown_.data();
  tick.contacts = shown_.data();
  tick.contact_count = contact_count_;
  tick.goal_index = goal_index_;
  tick.speed_scale = speed_scale_;
  tick.self_contacts = self_shown_.data();
  tick.self_contact_count = self_contact_count_;
  return planner_.tick(tick, *command_);
}

void ClosedLoop::ask_planner() {
  if (!call_planner())
    finish(log::Outcome::defect,
           fmt::format("planner '{}' at step {}: {}", scene_.planner->name, state_.k, planner_.error()));
  else if (command_->raw().state == HAMELIN_PLANNER_GAVE_UP)
    finish(log::Outcome::stalled, command_->raw().cause);
}

void ClosedLoop::take_gyroscopic_terms() {
  channels_.gyroscopic.clear();
  for (const auto& term : command_->gyroscopic())
    channels_.gyroscopic.push_back({term.link, Vector3d::Map(term.point_link_m), Vector3d::Map(term.w_world)});
}

void ClosedLoop::limit_torques() {
  turning_.setZero();
  if (limits_.size() == 0) return;
  auto& held = channels_.held_torque;
  const VectorXd& wanted = command_->held_torque();
  held = held.cwiseMin(limits_).cwiseMax(-limits_);
  double scale = 1.0;
  if (!channels_.gyroscopic.empty()) {
    dynamics::gyroscopic_torque(plant_, ws_, state_.q, v_, channels_.gyroscopic, turning_);
    for (Eigen::Index i = 0; i < held.size(); ++i) {
      const double room = limits_[i] - (turning_[i] > 0.0 ? held[i] : -held[i]);
      if (std::abs(turning_[i]) > room) scale = std::min(scale, std::max(0.0, room) / std::abs(turning_[i]));
    }
    if (scale < 1.0)
      for (auto& term : channels_.gyroscopic) term.w_world *= scale;
    turning_ *= scale;
  }
  if (scale < 1.0 || held != wanted) saturated_ = true;
}

double ClosedLoop::room_for_node_velocity() {
  if (limits_.size() == 0) return 1.0;
  // what brings the change about within the step: M (x − v) / h
  v_shown_ = (command_->node_velocity() - v_) / scene_.step_s;
  dynamics::momentum(plant_, ws_, state_.q, v_shown_, impulse_);
  double scale = 1.0;
  for (Eigen::Index i = 0; i < limits_.size(); ++i) {
    const double rest = channels_.held_torque[i] + turning_[i];
    if (!(std::abs(impulse_[i] + rest) > limits_[i] * (1.0 + rounding_share))) continue;
    const double room = limits_[i] - (impulse_[i] > 0.0 ? rest : -rest);
    scale = std::min(scale, std::max(0.0, room) / std::abs(impulse_[i]));
  }
  if (scale < 1.0) saturated_ = true;
  return scale;
}

void ClosedLoop::check_accounts() {
  if (!proves_energy_) return;
  const auto& answer = command_->raw();
  const double rounding = rounding_share * (ledger_.kinetic + 1.0);
  if (answer.filter_work_J > rounding)
    finish(log::Outcome::defect,
           fmt::format("planner '{}' at step {}: its filter added {:.3g} J where standing still was admitted, expected "
                       "none",
                       scene_.planner->name, state_.k, answer.filter_work_J));
  else if (answer.recovery_work_J < -rounding)
    finish(log::Outcome::defect, fmt::format("planner '{}' at step {}: its recovery took out {:.3g} J, expected none",
                                             scene_.planner->name, state_.k, -answer.recovery_work_J));
}

void ClosedLoop::check_energy() {
  if (!proves_energy_ || state_.k == 0 || result_.outcome == log::Outcome::collision) return;
  const double turned = std::abs(report_.gyroscopic_work_J);
  if (turned > rounding_share * (ledger_.kinetic + 1.0))
    finish(log::Outcome::defect,
           fmt::format("step {}: steering did {:.3g} J of work, expected none", state_.k, report_.gyroscopic_work_J));
  // a control potential's changes in time are the planner's own, so its account is only reported
  else if (!has_potential_ && recorder_->energy_error() > account_share * (exchanged_J_ + ledger_.kinetic))
    finish(
        log::Outcome::defect,
        fmt::format("step {}: the energy account is off by {:.3g} J, with {:.3g} J in motion and {:.3g} J exchanged; "
                    "expected less than {} of them: a smaller step?",
                    state_.k, recorder_->energy_error(), ledger_.kinetic, exchanged_J_, account_share));
}

void ClosedLoop::arrive() {
  gradient_ = command_->potential_gradient();
  if (kicked_) {
    impulse_ = 0.5 * scene_.step_s * (gradient_before_ - gradient_);
    integrator_->kick(state_, impulse_);
    integrator_->velocity(state_, v_);
  }
  has_potential_ = has_potential_ || command_->raw().potential_J != 0.0 || !gradient_.isZero(0.0);
  book_node(command_->raw().potential_J);
}

void ClosedLoop::book_node(double control_J) {
  const auto energy = integrator_->energy(state_);
  ledger_.kinetic = energy.kinetic_J;
  ledger_.potential = energy.potential_J;
  ledger_.control = control_J;
  const Ledger& last = recorder_->last_node();
  if (state_.k > 0)
    for (const auto account : {&Ledger::kinetic, &Ledger::potential, &Ledger::held, &Ledger::dissipated, &Ledger::node})
      exchanged_J_ += std::abs(ledger_.*account - last.*account);
  recorder_->node(ledger_);
  check_energy();
}

void ClosedLoop::actuate() {
  arrive();
  check_accounts();
  if (done_) return;
  const bool potential = command_->raw().potential_J != 0.0 || !gradient_.isZero(0.0);
  channels_.held_torque = command_->held_torque();
  channels_.damping = command_->damping();
  take_gyroscopic_terms();
  saturated_ = false;
  limit_torques();
  node_velocity_ = v_;
  if (command_->raw().has_node_velocity != 0) {
    const double room = room_for_node_velocity();
    if (room < 1.0)
      node_velocity_ += room * (command_->node_velocity() - v_);
    else
      node_velocity_ = command_->node_velocity();
    integrator_->set_velocity(state_, node_velocity_);
    ledger_.node += dynamics::kinetic_energy(plant_, ws_, state_.q, node_velocity_) - ledger_.kinetic;
    ledger_.filter += command_->raw().filter_work_J;
    ledger_.recovery += command_->raw().recovery_work_J;
  }
  if (plant_damping_.size() > 0) channels_.damping += plant_damping_;
  if (potential) {
    impulse_ = -0.5 * scene_.step_s * gradient_;
    integrator_->kick(state_, impulse_);
  }
  gradient_before_ = gradient_;
  kicked_ = kicked_ || potential;
}

// Nothing acts any more, but the last node's energies still belong to the account; a control potential's value and its
// gradient for the closing half-kick are the planner's to know.
void ClosedLoop::settle() {
  if (state_.k == 0 || result_.outcome == log::Outcome::diverged) return;
  if (kicked_) {
    if (call_planner()) arrive();
    return;
  }
  book_node(ledger_.control);
}

// What a sampled controller can do: one torque, made of all channels at the tick, held over the control period.
void ClosedLoop::actuate_sampled() {
  book_node(0.0);
  if (state_.k % control_steps_ != 0) return;
  const double period = static_cast<double>(control_steps_) * scene_.step_s;
  VectorXd& torque = delayed_[static_cast<std::size_t>((state_.k / control_steps_) % (delay_periods_ + 1))];
  torque = command_->held_torque() - command_->damping().cwiseProduct(v_) - command_->potential_gradient();
  take_gyroscopic_terms();
  if (!channels_.gyroscopic.empty()) {
    dynamics::gyroscopic_torque(plant_, ws_, state_.q, v_, channels_.gyroscopic, impulse_);
    torque += impulse_;
    channels_.gyroscopic.clear();
  }
  if (command_->raw().has_node_velocity != 0) {
    // the velocity change of a node, spread over the period: M (x − v) / T
    v_shown_ = (command_->node_velocity() - v_) / period;
    dynamics::momentum(plant_, ws_, q_shown_, v_shown_, impulse_);
    // as the planner's own model has it: there all masses and inertias are scaled alike
    torque += scene_.actuation.planner_mass_scale * impulse_;
    ledger_.filter += command_->raw().filter_work_J;
    ledger_.recovery += command_->raw().recovery_work_J;
  }
  v_shown_ = torque;
  if (limits_.size() > 0) torque = torque.cwiseMin(limits_).cwiseMax(-limits_);
  if (scene_.actuation.torque_rate_max_Nm_s) {
    const double change = *scene_.actuation.torque_rate_max_Nm_s * period;
    torque = torque.cwiseMin((torque_before_.array() + change).matrix())
                 .cwiseMax((torque_before_.array() - change).matrix());
    torque_before_ = torque;
  }
  saturated_ = torque != v_shown_;
  // the slot written delay_periods_ ticks ago is the next one round
  channels_.held_torque = delayed_[static_cast<std::size_t>((state_.k / control_steps_ + 1) % (delay_periods_ + 1))];
}

log::Result ClosedLoop::run(const Watch& watch) {
  Recorder recorder(result_, watch, *integrator_, options_, steps_);
  recorder_ = &recorder;
  const auto n = plant_.dof();
  state_ = integrator_->start(scene_.start_q.size() > 0 ? scene_.start_q : VectorXd::Zero(n),
                              scene_.start_v.size() > 0 ? scene_.start_v : VectorXd::Zero(n));
  result_.provenance = log::provenance(inputs_, watch.argv);
  if (recorder.logging()) recorder.header(header(), plant_.robot(), steps_);
  for (const auto& text : early_events_) recorder.event(0.0, text);

  const bool sampled = scene_.actuation.type == scene::ActuationType::sampled;
  const bool obstacles = environment_->has_obstacles();
  double min_clearance = influence_, min_self_clearance = self_influence_;
  bool certified = true;
  look_at_goals(watch);
  while (!done_) {
    const double tick_started = thread_cpu_s();
    if (kicked_) {
      impulse_ = -0.5 * scene_.step_s * gradient_before_;
      integrator_->kick(state_, impulse_);
    }
    integrator_->velocity(state_, v_);
    look(state_.q);
    min_clearance = std::min(min_clearance, clearance_now_);
    min_self_clearance = std::min(min_self_clearance, self_clearance_now_);
    bool touching = (obstacles && clearance_now_ <= 0.0) || (self_ && self_clearance_now_ <= 0.0);
    if (state_.k > 0 && (obstacles || self_)) {
      const auto verdict = certify();
      certified = verdict.certified;
      ++checked_steps_;
      if (certified) ++certified_steps_;
      result_.tightest_step_m = std::min(result_.tightest_step_m.value_or(verdict.margin_m), verdict.margin_m);
      if (verdict.contact && !touching)
        finish(log::Outcome::collision,
               fmt::format("contact {}between the nodes {} and {}",
                           verdict.self_pair < 0 ? "" : fmt::format("of {} ", self_->words(verdict.self_pair)),
                           state_.k - 1, state_.k));
      dynamics::forward_kinematics(plant_, ws_, state_.q);
    }
    // what led here met the map as it was; what follows meets the new one
    if (const std::string said = environment_->advance(state_.time_s); !said.empty()) {
      recorder.event(state_.time_s, said);
      look(state_.q);
      min_clearance = std::min(min_clearance, clearance_now_);
      touching = touching || clearance_now_ <= 0.0;
    }
    recorder.observe(clearance_now_, certified, v_, scene_.step_s);
    if (watch.at_node) watch.at_node(state_.time_s, state_.q);
    if (!v_.allFinite() || !state_.q.allFinite()) {
      finish(log::Outcome::diverged, fmt::format("step {} left the finite numbers", state_.k));
    } else if (touching) {
      finish(state_.k == 0 ? log::Outcome::refused : log::Outcome::collision, where_touching());
    } else if (!done_) {
      if (all_reached())
        finish(log::Outcome::reached, "");
      else if (at_rest_away_from_goal())
        finish(log::Outcome::stalled, fmt::format("at rest for {} s away from the goal", scene_.stall->hold_s));
      else if (state_.k == steps_)
        finish(log::Outcome::timeout, fmt::format("goal not reached within {} s", scene_.duration_s));
      else if (recorder.stopped(state_.k))
        finish(log::Outcome::interrupted, "stopped from outside");
    }
    if (done_) settle();
    if (!done_ && (state_.k % control_steps_ == 0 || !sampled)) {
      ask_planner();
      if (done_ && !kicked_) settle();
    }
    if (!done_) {
      if (sampled)
        actuate_sampled();
      else
        actuate();
    }
    const double tick_paused = thread_cpu_s();
    if (recorder.wants_tick(state_.k) || (done_ && recorder.logging())) {
      if (!done_) gather_torques();
      log_tick(certified);
    }
    const double tick_resumed = thread_cpu_s();
    if (done_) break;

    q_before_ = state_.q;
    time_before_s_ = state_.time_s;
    std::swap(arm_before_, arm_);
    std::swap(clearance_before_, clearance_);
    std::swap(self_clearance_before_, self_clearance_);
    if (kicked_)
      integrator_->velocity(state_, v_before_);
    else
      v_before_ = sampled ? v_ : node_velocity_;
    if (saturated_) ++saturated_steps_;
    report_ = integrator_->step(state_, channels_, scene_.step_s);
    if (!report_.converged) {
      finish(log::Outcome::diverged, fmt::format("step {} of {} s found no root", state_.k + 1, scene_.step_s));
      recorder.step(report_);
      if (recorder.logging()) log_tick(certified);
      break;
    }
    state_.time_s = static_cast<double>(state_.k) * scene_.step_s;
    recorder.step(report_);
    ledger_.book(report_);
    recorder.tick_time(thread_cpu_s() - tick_resumed + tick_paused - tick_started);
    recorder.progress(state_.k, state_.time_s, scene_.duration_s);
  }
  if (obstacles) result_.min_clearance_m = min_clearance;
  if (self_) result_.min_self_clearance_m = min_self_clearance;
  fill_result();
  recorder.close(ledger_);
  recorder_ = nullptr;
  return result_;
}

void ClosedLoop::gather_torques() {
  tau_ = channels_.held_torque;
  channel_torques_ = Json::object();
  if (!channels_.held_torque.isZero(0.0)) channel_torques_["held"] = to_json(channels_.held_torque);
  if (scene_.actuation.type == scene::ActuationType::sampled) return;
  const auto add = [this](const char* channel, const VectorXd& torque) {
    tau_ += torque;
    channel_torques_[channel] = to_json(torque);
  };
  if (!gradient_.isZero(0.0)) add("potential", -gradient_);
  if (!command_->damping().isZero(0.0)) add("damping", -command_->damping().cwiseProduct(v_));
  if (!channels_.gyroscopic.empty()) {
    dynamics::gyroscopic_torque(plant_, ws_, state_.q, v_, channels_.gyroscopic, impulse_);
    add("gyroscopic", impulse_);
  }
  if (command_->raw().has_node_velocity != 0) {
    // what would bring the node's change of velocity about within one step: M (x − v) / h
    v_shown_ = (node_velocity_ - v_) / scene_.step_s;
    dynamics::momentum(plant_, ws_, state_.q, v_shown_, impulse_);
    add("node", impulse_);
  }
}

void ClosedLoop::log_tick(bool certified) {
  Json fields{{"k", state_.k},
              {"time_s", state_.time_s},
              {"q", to_json(state_.q)},
              {"v", to_json(v_)},
              {"tau", to_json(tau_)},
              {"goal_index", goal_index_},
              {"clearance_m", nullptr},
              {"closest", nullptr},
              {"energy", energy_json(recorder_->last_node())},
              {"solver", solver_json(report_)},
              {"certified", certified}};
  if (!done_) fields["channels"] = channel_torques_;
  if (torques_limited()) fields["saturated"] = saturated_;
  if (self_) fields["self_clearance_m"] = self_clearance_now_;
  if (environment_->has_obstacles()) {
    fields["clearance_m"] = clearance_now_;
    if (nearest_.sphere >= 0) {
      fields["closest"] = {{"sphere", nearest_.sphere}, {"obstacle", "map"}};
      if (nearest_.obstacle == scene::Contact::unknown) fields["closest"]["obstacle"] = "unknown";
      if (nearest_.obstacle >= 0)
        fields["closest"]["obstacle"] = environment_->obstacles()[static_cast<std::size_t>(nearest_.obstacle)].name;
    }
  }
  recorder_->tick(state_.k, std::move(fields));
}

Json ClosedLoop::header() const {
  Json config = resolved_config(scene_);
  config["planner"]["params"] = planner_params_;
  return {{"program", "run"},
          {"scene", scene_.name},
          {"seed", scene_.seed},
          {"generator", Rng::name},
          {"config", std::move(config)},
          {"robot_notes", plant_.robot().notes},
          {"plugin",
           {{"name", planner_.plugin().name()},
            {"version", planner_.plugin().version()},
            {"abi", HAMELIN_PLUGIN_ABI_VERSION}}},
          {"provenance", result_.provenance}};
}

void ClosedLoop::fill_result() {
  result_.scene = scene_.name;
  result_.planner = planner_.plugin().name();
  result_.time_s = state_.time_s;
  result_.steps = state_.k;
  result_.q = state_.q;
  result_.v = v_;
  result_.seed = scene_.seed;
  const auto& goal = scene_.goals[std::min(goal_index_, scene_.goals.size() - 1)];
  dynamics::forward_kinematics(plant_, ws_, state_.q);
  const GoalError error = goal_error();
  log::Result::Goal out;
  out.type = scene::type_name(goal);
  out.index = goal_index_;
  out.count = scene_.goals.size();
  if (error.has_metres) out.error_m = error.metres;
  if (error.has_radians) out.error_rad = error.radians;
  result_.goal = out;
  if (checked_steps_ > 0)
    result_.certified_share = static_cast<double>(certified_steps_) / static_cast<double>(checked_steps_);
  for (const auto& warning : environment_->summary().warnings) result_.warnings.push_back(warning);
  if (torques_limited() && state_.k > 0) {
    result_.saturated_share = static_cast<double>(saturated_steps_) / static_cast<double>(state_.k);
    if (saturated_steps_ > 0)
      result_.warnings.push_back(
          fmt::format("torque limits cut the planner's answer in {} of {} steps", saturated_steps_, state_.k));
  }
}

}  // namespace hamelin::simulation
