#include "loop/planner_host.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "loop/to_c.hpp"
#include "world/world_query.hpp"

namespace hamelin::control {

namespace {

// The obstacles of some kinds; none if there are no such kinds.
std::optional<scene::Among> among_of(std::int32_t kinds) {
  const bool standing = (kinds & HAMELIN_STANDING) != 0, moving = (kinds & HAMELIN_MOVING) != 0;
  if (!standing && !moving) return std::nullopt;
  if (standing && moving) return scene::Among::all;
  return moving ? scene::Among::moving : scene::Among::standing;
}

/// A planner's query handle.
class Handle final : public planning::QueryServices {
 public:
  Handle(const model::Model& model, const World& world, const WorldView& view,
         const std::atomic<double>& time_s)
      : query_(model, world, view), view_(view), now_s_(time_s) {
    (void)refresh();
  }
  Snapshot refresh() override {
    time_s_ = now_s_.load();
    return {query_.refresh(view_.allowance()), time_s_};
  }
  void clearance(const double* q, std::size_t count, double time_ahead_s, double at_least_m,
                 double* out) override {
    for (std::size_t i = 0; i < count; ++i)
      out[i] = query_.clearance(q + i * query_.dof(), {time_s_, time_ahead_s}, at_least_m);
  }
  std::size_t contacts(const double* q, double time_ahead_s, double influence_m,
                       planning::ArrayOut<hamelin_contact> out) override {
    return query_.contacts(q, {time_s_, time_ahead_s}, influence_m, out);
  }
  std::size_t self_contacts(const double* q, double influence_m,
                            planning::ArrayOut<hamelin_self_contact> out) override {
    return query_.self_contacts(q, influence_m, out);
  }
  bool motion_clear(const double* q0, const double* q1, double t0_s, double t1_s,
                    double& margin_m) override {
    return query_.motion_clear(q0, q1, time_s_, t0_s, t1_s, margin_m);
  }
  void distance(const double* points_world_m, std::size_t count, double time_ahead_s,
                double limit_m, double* distance_m, double* gradient) override {
    Eigen::Vector3d direction;
    for (std::size_t i = 0; i < count; ++i) {
      distance_m[i] = query_.distance(Eigen::Vector3d::Map(points_world_m + 3 * i),
                                      {time_s_, time_ahead_s}, limit_m, direction);
      if (gradient != nullptr) Eigen::Vector3d::Map(gradient + 3 * i) = direction;
    }
  }
  std::size_t boxes(const Eigen::Vector3d& low_world_m, const Eigen::Vector3d& high_world_m,
                    planning::ArrayOut<hamelin_box> out) override {
    return query_.boxes(low_world_m, high_world_m, out);
  }
  std::size_t obstacles(double time_ahead_s,
                        planning::ArrayOut<hamelin_obstacle_state> out) override {
    return list_obstacles(query_.snapshot().environment, query_.snapshot().obstacle_ids,
                          {time_s_, time_ahead_s}, scene::Among::all, out);
  }

 private:
  WorldQuery query_;
  const WorldView& view_;
  const std::atomic<double>& now_s_;
  double time_s_ = 0.0;
};

}  // namespace

PlannerHost::PlannerHost(const planning::Plugin& plugin, planning::SetupData setup,
                         const Json& params, const model::Model& nominal, const World& world,
                         WorldView& view, LineSink sink, double now_s)
    : nominal_(nominal),
      world_(world),
      view_(view),
      sink_(std::move(sink)),
      query_q_(Eigen::VectorXd::Zero(nominal.dof())),
      query_contacts_(view.contacts_max()),
      query_self_contacts_(view.self_contacts_max()),
      contacts_(view.contacts_max()),
      self_contacts_(view.self_contacts_max()),
      kept_(nominal.dof()),
      time_s_(now_s),
      world_number_(view.snapshot()),
      planner_(plugin.create(std::move(setup), *this, params)),
      command_(static_cast<std::size_t>(nominal.dof()), view.contacts_max(),
               planner_.series().size()) {}

void PlannerHost::restart(planning::SetupData setup, const Json& params) {
  const planning::Plugin plugin = planner_.plugin();
  world_number_ = view_.snapshot();
  planner_ = plugin.create(std::move(setup), *this, params);
}

bool PlannerHost::tick(long k, double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                       const PlannerGoal& goal, const Torques& torques, Guidance* guidance) {
  time_s_ = time_s;
  draws_ = false;
  if (const std::uint64_t world = view_.snapshot(); world != world_number_) {
    world_number_ = world;
    planner_.world_changed(world);
  }
  const auto contacts = view_.contacts();
  const auto self_contacts = view_.self_contacts();
  for (std::size_t i = 0; i < contacts.size(); ++i)
    contacts_[i] = to_c(contacts[i], view_.obstacle_id(contacts[i].obstacle));
  for (std::size_t i = 0; i < self_contacts.size(); ++i) self_contacts_[i] = to_c(self_contacts[i]);
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.k = static_cast<std::uint64_t>(k);
  tick.time_s = time_s;
  tick.q = q.data();
  tick.v = v.data();
  tick.contacts = contacts_.data();
  tick.contact_count = contacts.size();
  tick.contact_stride = sizeof(hamelin_contact);
  tick.self_contacts = self_contacts_.data();
  tick.self_contact_count = self_contacts.size();
  tick.self_contact_stride = sizeof(hamelin_self_contact);
  tick.goal = goal.goal;
  tick.goal_number = goal.number;
  tick.goal_index = goal.index;
  tick.world = world_number_;
  tick.speed_scale = view_.speed_scale();
  tick.torque = torques.last != nullptr ? torques.last->data() : nullptr;
  tick.disturbance = torques.disturbance != nullptr ? torques.disturbance->data() : nullptr;
  tick.moving_count = list_obstacles(view_.environment(), view_.obstacle_ids(), time_s,
                                     scene::Among::moving, {nullptr, 0, 0});
  kept_.clear();
  if (goal.constraints != nullptr) kept_.update(nominal_, view_.poses(), *goal.constraints);
  tick.kept_count = static_cast<std::size_t>(kept_.size());
  tick.kept_slack = kept_.slack();
  tick.kept_gradient = kept_.gradient();
  guidance_ = guidance;
  const bool answered = planner_.tick(tick, command_);
  guidance_ = nullptr;
  return answered;
}

void PlannerHost::log(std::int32_t level, std::string_view line) {
  if (sink_) sink_(level, line);
}

std::size_t PlannerHost::closest_points(std::span<const double> q, double influence_m,
                                        planning::ArrayOut<hamelin_contact> out) {
  return closest_ahead(q, 0.0, HAMELIN_STANDING + HAMELIN_MOVING, influence_m, out);
}

std::size_t PlannerHost::closest_ahead(std::span<const double> q, double time_ahead_s,
                                       std::int32_t kinds, double influence_m,
                                       planning::ArrayOut<hamelin_contact> out) {
  const auto among = among_of(kinds);
  if (!among) return 0;
  query_q_ = Eigen::Map<const Eigen::VectorXd>(q.data(), query_q_.size());
  const auto contacts =
      std::span(query_contacts_).first(std::min(query_contacts_.size(), out.size()));
  const std::size_t found = view_.closest(query_q_, influence_m, contacts, time_ahead_s, *among);
  for (std::size_t i = 0; i < std::min(found, contacts.size()); ++i)
    out.set(i, to_c(contacts[i], view_.obstacle_id(contacts[i].obstacle)));
  return found;
}

std::size_t PlannerHost::closest_self(std::span<const double> q, double influence_m,
                                      planning::ArrayOut<hamelin_self_contact> out) {
  query_q_ = Eigen::Map<const Eigen::VectorXd>(q.data(), query_q_.size());
  const auto contacts =
      std::span(query_self_contacts_).first(std::min(query_self_contacts_.size(), out.size()));
  const std::size_t found = view_.closest_self(query_q_, influence_m, contacts);
  for (std::size_t i = 0; i < std::min(found, contacts.size()); ++i) out.set(i, to_c(contacts[i]));
  return found;
}

std::size_t PlannerHost::obstacles(planning::ArrayOut<hamelin_obstacle_state> out) {
  return list_obstacles(view_.environment(), view_.obstacle_ids(), time_s_.load(),
                        scene::Among::all, out);
}

std::size_t PlannerHost::obstacles_ahead(double time_ahead_s, std::int32_t kinds,
                                         planning::ArrayOut<hamelin_obstacle_state> out) {
  const auto among = among_of(kinds);
  if (!among) return 0;
  return list_obstacles(view_.environment(), view_.obstacle_ids(), {time_s_.load(), time_ahead_s},
                        *among, out);
}

// Grows with the largest drawing; planners that draw nothing cost nothing.
void PlannerHost::draw_path(std::span<const double> points_world_m) {
  if (!draws_) {
    drawing_.points.clear();
    drawing_.ends.clear();
    ++drawing_.number;
    draws_ = true;
  }
  for (std::size_t i = 0; i + 2 < points_world_m.size(); i += 3)
    drawing_.points.emplace_back(points_world_m.data() + i);
  drawing_.ends.push_back(drawing_.points.size());
}

std::unique_ptr<planning::QueryServices> PlannerHost::open_query() {
  return std::make_unique<Handle>(nominal_, world_, view_, time_s_);
}

}  // namespace hamelin::control
