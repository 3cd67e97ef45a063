#include "hamelin/control/planner_host.hpp"

#include <algorithm>
#include <utility>

namespace hamelin::control {

namespace {

void write(const Eigen::Vector3d& from, double (&to)[3]) {
  for (int i = 0; i < 3; ++i) to[i] = from[i];
}

hamelin_contact to_c(const WorldView& world, const scene::Contact& contact) {
  hamelin_contact out{};
  out.sphere = contact.sphere;
  out.obstacle = world.obstacle_id(contact.obstacle);
  out.distance_m = contact.distance;
  write(contact.arm_point, out.arm_point_world_m);
  write(contact.obstacle_point, out.obstacle_point_world_m);
  write(contact.direction, out.direction_world);
  write(contact.obstacle_velocity, out.obstacle_velocity_world_m_s);
  return out;
}

hamelin_self_contact to_c(const scene::SelfContact& contact) {
  hamelin_self_contact out{};
  out.sphere_a = contact.sphere_a;
  out.sphere_b = contact.sphere_b;
  out.distance_m = contact.distance;
  write(contact.point_a, out.point_a_world_m);
  write(contact.point_b, out.point_b_world_m);
  write(contact.direction, out.direction_world);
  return out;
}

}  // namespace

PlannerHost::PlannerHost(const planning::Plugin& plugin, planning::SetupData setup,
                         const Json& params, WorldView& world, LineSink sink)
    : world_(world),
      sink_(std::move(sink)),
      query_q_(Eigen::VectorXd::Zero(static_cast<Eigen::Index>(setup.dof))),
      query_contacts_(world.contacts_max()),
      query_self_contacts_(world.self_contacts_max()),
      contacts_(world.contacts_max()),
      self_contacts_(world.self_contacts_max()),
      command_(setup.dof, world.contacts_max()),
      planner_(plugin.create(std::move(setup), *this, params)) {}

bool PlannerHost::tick(long k, double time_s, const Eigen::VectorXd& q, const Eigen::VectorXd& v,
                       std::size_t goal_index) {
  const auto contacts = world_.contacts();
  const auto self_contacts = world_.self_contacts();
  for (std::size_t i = 0; i < contacts.size(); ++i) contacts_[i] = to_c(world_, contacts[i]);
  for (std::size_t i = 0; i < self_contacts.size(); ++i) self_contacts_[i] = to_c(self_contacts[i]);
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.k = static_cast<std::uint64_t>(k);
  tick.time_s = time_s;
  tick.q = q.data();
  tick.v = v.data();
  tick.contacts = contacts_.data();
  tick.contact_count = contacts.size();
  tick.goal_index = goal_index;
  tick.speed_scale = world_.speed_scale();
  tick.self_contacts = self_contacts_.data();
  tick.self_contact_count = self_contacts.size();
  return planner_.tick(tick, command_);
}

void PlannerHost::log(std::int32_t level, std::string_view line) {
  if (sink_) sink_(level, line);
}

std::size_t PlannerHost::closest_points(std::span<const double> q, double influence_m,
                                        std::span<hamelin_contact> out) {
  query_q_ = Eigen::Map<const Eigen::VectorXd>(q.data(), query_q_.size());
  const auto contacts =
      std::span(query_contacts_).first(std::min(query_contacts_.size(), out.size()));
  const std::size_t found = world_.closest(query_q_, influence_m, contacts);
  for (std::size_t i = 0; i < std::min(found, contacts.size()); ++i)
    out[i] = to_c(world_, contacts[i]);
  return found;
}

std::size_t PlannerHost::closest_self(std::span<const double> q, double influence_m,
                                      std::span<hamelin_self_contact> out) {
  query_q_ = Eigen::Map<const Eigen::VectorXd>(q.data(), query_q_.size());
  const auto contacts =
      std::span(query_self_contacts_).first(std::min(query_self_contacts_.size(), out.size()));
  const std::size_t found = world_.closest_self(query_q_, influence_m, contacts);
  for (std::size_t i = 0; i < std::min(found, contacts.size()); ++i) out[i] = to_c(contacts[i]);
  return found;
}

}  // namespace hamelin::control
