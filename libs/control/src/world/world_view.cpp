#include "hamelin/control/world_view.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <utility>

#include "hamelin/core/error.hpp"
#include "loop/append_line.hpp"

namespace hamelin::control {

namespace {

// The largest distance at which parts of the arm are found near each other.
constexpr double self_influence_max_m = 0.10;
// The share of the speed at which a planner is asked to move in unknown space that is to be crossed
// slowly.
constexpr double slow_speed_scale = 0.25;

void require_shapes(const scene::Scene& scene, const model::Model& model, const char* place,
                    const char* expected) {
  if (!model.shapes().empty()) return;
  throw Error(ErrorCode::invalid,
              fmt::format("{}: {}: '{}' has no collision spheres or capsules, expected {}",
                          scene.name, place, model.robot().name, expected));
}

}  // namespace

WorldView::WorldView(const scene::Scene& scene, const model::Model& model, double influence_m)
    : WorldView(scene, model, influence_m,
                Own(scene::make_environment(scene, model, influence_m), model.shapes().size()),
                nullptr, 0) {}

WorldView::WorldView(const scene::Scene& scene, const model::Model& model, const WorldView& other)
    : WorldView(scene, model, other.influence_,
                Own(other.environment_->with_obstacles(
                        scene.obstacles,
                        scene.map ? scene.map->changes : std::vector<scene::MapChangeSpec>{}),
                    model.shapes().size()),
                nullptr, 0) {}

std::unique_ptr<WorldView> WorldView::for_other_load(const scene::Scene& scene,
                                                     const model::Model& model,
                                                     const WorldView& other) {
  scene::Environment same = *other.whole_;
  std::unique_ptr<WorldView> view(new WorldView(
      scene, model, other.influence_, Own(std::move(same), model.shapes().size()), nullptr, 0));
  view->seen_ = other.seen_;
  view->allow(other.own_->allowance);
  return view;
}

WorldView::WorldView(const scene::Scene& scene, const model::Model& model, World& world)
    : WorldView(scene, model, world.influence_m(), std::nullopt, &world, world.contacts_max()) {}

WorldView::WorldView(const scene::Scene& scene, const model::Model& model, double influence_m,
                     std::optional<Own> own, World* world, std::size_t contacts_max)
    : model_(model),
      own_(std::move(own)),
      world_(world),
      influence_(influence_m),
      slow_in_unknown_(scene.map && scene.map->unknown == scene::UnknownPolicy::slow),
      poses_(model),
      arm_(model),
      arm_before_(model),
      vicinity_(model.shapes().size()),
      query_poses_(model),
      query_arm_(model) {
  if (world_ != nullptr) {
    first_view_ = world_->view_of_latest();
    whole_ = &first_view_->snapshot->environment;
    see(*first_view_);
  } else {
    environment_ = whole_ = &own_->environment;
    scratch_ = &own_->scratch;
    contacts_max = environment_->contacts_max(model.shapes().size());
  }
  if (has_obstacles())
    require_shapes(scene, model, "/robot",
                   "some because there are obstacles; hamelin robot fit makes them");
  if (scene.model.self_collision) {
    require_shapes(scene, model, "/model/self_collision", "some or false");
    self_ = std::make_unique<scene::SelfField>(model);
    self_influence_ = std::min(influence_, self_influence_max_m);
    self_contacts_.resize(self_->pairs().size());
    self_clearance_.assign(self_->pairs().size(), self_influence_);
    self_clearance_before_ = self_clearance_;
  }
  certificate_ = std::make_unique<Certificate>(
      model, influence_, self_.get(), self_influence_,
      world_ != nullptr ? world_->obstacles_max() : environment_->obstacles().size());
  if (own_) {
    seen_.assign(environment_->obstacles().size(), 0);
    revealed_.reserve(environment_->obstacles().size());
    for (const auto& obstacle : environment_->obstacles())
      hidden_obstacles_ = hidden_obstacles_ || obstacle.judge_only || !obstacle.known;
  }
  contacts_.resize(contacts_max + 1);
  other_contacts_.resize(contacts_.size());
  clearance_.assign(model.shapes().size(), influence_);
  clearance_before_ = clearance_;
  q_ = query_q_ = q_before_ = v_before_ = Eigen::VectorXd::Zero(model.dof());
}

bool WorldView::take_newest() {
  if (world_ == nullptr) return false;
  World::View& all = world_->take();
  World::View& newest = all.with(allowance_);
  whole_ = &all.snapshot->environment;
  if (environment_ == &newest.snapshot->environment) return false;
  see(newest);
  return true;
}

bool WorldView::allow(std::uint64_t allowance) {
  if (allowance == allowance_) return false;
  allowance_ = allowance;
  return take_newest();
}

void WorldView::allow(const scene::Allowance& allowance) {
  if (allowance == own_->allowance) return;
  own_->allowance = allowance;
  if (!own_->whole) own_->whole = own_->environment;
  leave_out_allowed();
}

void WorldView::leave_out_allowed() {
  own_->environment = own_->whole->with_allowance(own_->allowance);
  if (own_->allowance.empty()) own_->whole.reset();
  whole_ = own_->whole ? &*own_->whole : &own_->environment;
  own_->scratch = scene::Environment::Scratch(own_->environment, model_.shapes().size());
  current_ = false;
}

std::string WorldView::advance_map() {
  current_ = false;
  if (!own_->whole) return own_->environment.advance(time_s_);
  std::string line = own_->whole->advance(time_s_);
  if (!line.empty()) leave_out_allowed();
  return line;
}

double WorldView::whole_clearance_m() const {
  if (whole_ == environment_) return clearance_now_;
  return whole_->clearance(arm_.view(), time_s_, clearance_now_);
}

void WorldView::see(World::View& view) {
  environment_ = &view.snapshot->environment;
  scratch_ = &view.scratch;
  ids_ = view.snapshot->obstacle_ids;
  snapshot_ = view.snapshot->number;
  standing_ = view.snapshot->standing;
  current_ = false;
}

void WorldView::change_map(const scene::MapChangeSpec& change) {
  take_world(all_of_it().with_change(change));
}

void WorldView::change_obstacle(std::size_t index, const scene::Obstacle& obstacle) {
  take_world(all_of_it().with_obstacle(index, obstacle));
}

scene::Environment& WorldView::all_of_it() noexcept {
  return own_->whole ? *own_->whole : own_->environment;
}

void WorldView::take_world(scene::Environment environment) {
  all_of_it() = std::move(environment);
  if (own_->whole) return leave_out_allowed();
  own_->scratch = scene::Environment::Scratch(own_->environment, model_.shapes().size());
  current_ = false;
}

void WorldView::look(const Eigen::VectorXd& q, double time_s) {
  if (!place_arm(q, time_s) && has_contacts_) return;
  has_contacts_ = true;
  clearance_now_ = influence_;
  if (has_obstacles()) update_obstacle_contacts();
  if (has_self()) update_self_contacts();
}

void WorldView::glance(const Eigen::VectorXd& q, double time_s) {
  if (hidden_obstacles_ || slow_in_unknown_ || environment_->has_movers())
    look(q, time_s);
  else if (place_arm(q, time_s))
    measure_clearances();
}

bool WorldView::place_arm(const Eigen::VectorXd& q, double time_s) {
  if (current_ && time_s == time_s_ && q == q_) return false;
  current_ = true;
  has_contacts_ = false;
  q_ = q;
  time_s_ = time_s;
  dynamics::forward_kinematics(model_, poses_, q);
  nearest_.sphere = -1;
  contact_count_ = self_contact_count_ = 0;
  speed_scale_ = 1.0;
  revealed_.clear();
  if (has_obstacles() || has_self()) arm_.place(model_, poses_);
  return true;
}

// The last clearance bounds the search: an arm moves little from tick to tick.
void WorldView::measure_clearances() {
  constexpr double moved_m = 0.02;
  if (has_self()) {
    update_self_contacts();
    self_contact_count_ = 0;
  }
  const double near = std::min(clearance_now_ + moved_m, influence_);
  const auto within = [this](double limit) {
    return has_obstacles() ? environment_->clearance(arm_.view(), time_s_, limit) : limit;
  };
  clearance_now_ = within(near);
  if (clearance_now_ == near && near < influence_) clearance_now_ = within(influence_);
}

void WorldView::update_obstacle_contacts() {
  std::fill(clearance_.begin(), clearance_.end(), influence_);
  if (hidden_obstacles_) reveal_visible();
  contact_count_ = find(scene::View::planner, contacts_);
  update_clearances(contacts());
  if (hidden_obstacles_) {
    const std::size_t hidden = find(scene::View::hidden, other_contacts_);
    update_clearances(std::span(other_contacts_).first(hidden));
  }
  if (slow_in_unknown_ && environment_->in_slow_space(arm_.view())) speed_scale_ = slow_speed_scale;
}

void WorldView::reveal_visible() {
  for (int found = environment_->reveal_visible(arm_.view(), time_s_, seen_); found >= 0;
       found = environment_->reveal_visible(arm_.view(), time_s_, seen_))
    revealed_.push_back(found);
}

std::size_t WorldView::find(scene::View view, std::span<scene::Contact> out) {
  return std::min(out.size(), environment_->closest(arm_.view(), influence_, time_s_, *scratch_,
                                                    out, view, seen_, &vicinity_));
}

void WorldView::update_clearances(std::span<const scene::Contact> contacts) {
  for (const auto& contact : contacts) {
    auto& clearance = clearance_[static_cast<std::size_t>(contact.sphere)];
    clearance = std::min(clearance, contact.distance);
    if (contact.distance < clearance_now_) {
      clearance_now_ = contact.distance;
      nearest_ = contact;
    }
  }
}

void WorldView::update_self_contacts() {
  self_clearance_now_ = self_influence_;
  self_contact_count_ = self_->closest(arm_.view(), self_influence_, self_contacts_);
  std::fill(self_clearance_.begin(), self_clearance_.end(), self_influence_);
  for (const auto& contact : self_contacts()) {
    self_clearance_[static_cast<std::size_t>(contact.pair)] = contact.distance;
    if (contact.distance < self_clearance_now_) {
      self_clearance_now_ = contact.distance;
      nearest_pair_ = contact.pair;
    }
  }
}

void WorldView::depart(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  current_ = false;
  q_before_ = q;
  v_before_ = v;
  time_before_s_ = time_s_;
  std::swap(arm_before_, arm_);
  std::swap(clearance_before_, clearance_);
  std::swap(self_clearance_before_, self_clearance_);
}

Certificate::Verdict WorldView::certify(const Eigen::VectorXd& q, const Eigen::VectorXd& v) {
  const auto to_obstacles = [&](const std::vector<double>& all) {
    return has_obstacles() ? std::span<const double>(all) : std::span<const double>();
  };
  return certificate_->check(
      query_poses_, *environment_,
      {q_before_, v_before_, time_before_s_, arm_before_.view(), to_obstacles(clearance_before_),
       self_clearance_before_},
      {q, v, time_s_, arm_.view(), to_obstacles(clearance_), self_clearance_});
}

scene::Shapes WorldView::place(const Eigen::VectorXd& q) {
  if (query_placed_ && query_q_ == q) return query_arm_.view();
  query_placed_ = true;
  query_q_ = q;
  dynamics::forward_kinematics(model_, query_poses_, q);
  query_arm_.place(model_, query_poses_);
  return query_arm_.view();
}

std::size_t WorldView::closest(const Eigen::VectorXd& q, double influence_m,
                               std::span<scene::Contact> out, double ahead_s, scene::Among among) {
  if (!has_obstacles()) return 0;
  if (among != scene::Among::moving) influence_m = std::min(influence_m, influence_);
  return environment_->closest(place(q), influence_m, {time_s_, ahead_s}, *scratch_, out,
                               scene::View::planner, seen_, nullptr, among);
}

std::size_t WorldView::closest_self(const Eigen::VectorXd& q, double influence_m,
                                    std::span<scene::SelfContact> out) {
  if (!has_self()) return 0;
  return self_->closest(place(q), std::min(influence_m, self_influence_), out);
}

bool WorldView::deepest_at_start(const scene::Shapes& shapes, scene::Contact& deepest) {
  const std::size_t count = std::min(
      other_contacts_.size(),
      environment_->closest(shapes, 0.0, 0.0, *scratch_, other_contacts_, scene::View::judge));
  bool found = false;
  for (const auto& contact : std::span(other_contacts_).first(count)) {
    // a moving obstacle may be elsewhere when the arm arrives
    if (contact.obstacle >= 0 && environment_->moves(static_cast<std::size_t>(contact.obstacle)))
      continue;
    if (!found || contact.distance < deepest.distance) deepest = contact;
    found = true;
  }
  return found;
}

bool WorldView::deepest_self(const scene::Shapes& shapes, scene::SelfContact& deepest) {
  if (!has_self()) return false;
  const std::size_t count =
      std::min(self_contacts_.size(), self_->closest(shapes, 0.0, self_contacts_));
  if (count == 0) return false;
  deepest =
      *std::min_element(self_contacts_.begin(), self_contacts_.begin() + static_cast<long>(count),
                        [](const auto& a, const auto& b) { return a.distance < b.distance; });
  return true;
}

void WorldView::describe_contact(LineBuffer& line) const {
  append(line, "its shapes are {:.2g} mm inside ",
         -1e3 * std::min(clearance_now_, self_clearance_now_));
  if (nearest() != nullptr && clearance_now_ <= 0.0)
    append_obstacle(line, *environment_, nearest_.obstacle);
  else
    append(line, "another part of the arm");
}

std::string WorldView::describe_contact() const {
  if (nearest() != nullptr && clearance_now_ <= 0.0)
    return fmt::format("{} at {} s; the exit direction is {}",
                       environment_->describe(nearest_, model_), time_s_,
                       scene::describe_exit_direction(nearest_));
  return fmt::format("the arm touches itself: {} are {:.2g} mm inside each other at {} s",
                     self_->describe(nearest_pair_), -1e3 * self_clearance_now_, time_s_);
}

}  // namespace hamelin::control
