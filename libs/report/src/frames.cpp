#include "frames.hpp"

#include <algorithm>
#include <limits>

namespace hamelin::report {

Frames::Frames(const World& world)
    : world_(world),
      ws_(world.model),
      arm_(world.model),
      scratch_(world.environment, world.model.shapes().size()),
      found_(world.environment.contacts_max(world.model.shapes().size())),
      J_(3, world.model.dof()),
      acceleration_(world.model.dof()) {}

void Frames::add(const Frame& frame) {
  t_.push_back(frame.time_s);
  q_.insert(q_.end(), frame.q.begin(), frame.q.end());
  goal_index_.push_back(static_cast<std::uint16_t>(frame.goal_index));
  dynamics::forward_kinematics(world_.model, ws_, frame.q);
  if (world_.has_clearances) add_contacts(frame);
  add_forces(frame);
  add_target(frame);
}

// The frames before the first target get its position, later ones without any that of the last.
void Frames::add_target(const Frame& frame) {
  if (targets_.empty() && !frame.target) return;
  while (targets_.size() < 3 * t_.size()) {
    const Eigen::Vector3d at = frame.target ? *frame.target : Eigen::Vector3d(&targets_.end()[-3]);
    targets_.insert(targets_.end(), at.begin(), at.end());
  }
}

void Frames::add_contacts(const Frame& frame) {
  constexpr std::size_t contacts_max = 6;
  arm_.place(world_.model, ws_);
  const std::size_t count = std::min(
      found_.size(), world_.environment.closest(arm_.view(), world_.influence_m, frame.time_s,
                                                scratch_, found_, scene::View::judge));
  std::vector<const scene::Contact*> nearest(world_.model.shapes().size(), nullptr);
  for (std::size_t i = 0; i < count; ++i) {
    auto& known = nearest[static_cast<std::size_t>(found_[i].sphere)];
    if (known == nullptr || found_[i].distance < known->distance) known = &found_[i];
  }
  for (const auto* contact : nearest)
    clearances_.push_back(contact != nullptr ? contact->distance
                                             : std::numeric_limits<double>::quiet_NaN());
  nearest.erase(std::remove(nearest.begin(), nearest.end(), nullptr), nearest.end());
  std::stable_sort(nearest.begin(), nearest.end(),
                   [](const auto* a, const auto* b) { return a->distance < b->distance; });
  if (nearest.size() > contacts_max) nearest.resize(contacts_max);
  counts_.push_back(static_cast<std::uint8_t>(nearest.size()));
  for (const auto* contact : nearest)
    for (const auto* point : {&contact->arm_point, &contact->obstacle_point})
      points_.insert(points_.end(), point->begin(), point->end());
}

void Frames::add_forces(const Frame& frame) {
  const model::Model& model = world_.model;
  Eigen::Matrix3d inertia = Eigen::Matrix3d::Zero();
  if (std::any_of(frame.channels.begin(), frame.channels.end(),
                  [](const auto& x) { return x.size() > 0; })) {
    dynamics::point_jacobian(model, ws_, model.robot().tip.link, dynamics::tip_pose(model, ws_).p(),
                             J_);
    inertia = dynamics::operational_inertia(model, ws_, frame.q, J_);
  }
  for (std::size_t i = 0; i < channel_names.size(); ++i) {
    Eigen::Vector3d force = Eigen::Vector3d::Zero();
    if (frame.channels[i].size() > 0) {
      dynamics::solve_mass(model, ws_, frame.q, frame.channels[i], acceleration_);
      force = inertia * (J_ * acceleration_);
      channel_used_[i] = channel_used_[i] || !force.isZero(0.0);
    }
    forces_[i].insert(forces_[i].end(), force.begin(), force.end());
  }
}

Json Frames::json(Container& container, double step_s) const {
  constexpr double angle_step = 1e-6, clearance_step = 1e-4, deepest = -0.5, point_step = 1e-4;
  constexpr int force_bits = 10;
  Json json{{"t", container.stepped(t_, step_s)},         {"q", container.stepped(q_, angle_step)},
            {"goal_index", container.exact(goal_index_)}, {"clearance", nullptr},
            {"influence_m", world_.influence_m},          {"contacts", nullptr}};
  if (world_.has_clearances) {
    json["clearance"] = container.bounded(clearances_, clearance_step, deepest);
    json["contacts"] = {{"count", container.exact(counts_)},
                        {"points", container.centred(points_, point_step)}};
  }
  json["target"] = nullptr;
  if (!targets_.empty()) json["target"] = container.centred(targets_, point_step);
  json["forces"] = Json::array();
  for (std::size_t i = 0; i < channel_names.size(); ++i)
    if (channel_used_[i])
      json["forces"].push_back(
          {{"channel", channel_names[i]}, {"f", container.relative(forces_[i], force_bits)}});
  return json;
}

}  // namespace hamelin::report
