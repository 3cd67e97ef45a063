#include "arm_messages.hpp"

#include <algorithm>

namespace hamelin::mcap {

namespace {

constexpr Color arm_color{0.95, 0.6, 0.2}, base_color{0.55, 0.55, 0.58},
    load_color{0.2, 0.55, 0.85};

}  // namespace

ArmMessages::ArmMessages(const scene::Scene& scene, const model::Model& model)
    : model_(model), ws_(model) {
  for (const auto& event : scene.events)
    if (event.attach) known_.push_back(*event.attach);
  if (!scene.model.payload) return;
  known_.push_back(*scene.model.payload);
  carried_at_start_ = scene.model.payload->name;
  attach(carried_at_start_);
}

bool ArmMessages::is_carried(const std::string& part) const {
  return !part.empty() && part == carried_at_start_;
}

void ArmMessages::add_transforms(std::uint64_t time_ns, const Eigen::VectorXd& q,
                                 Json& transforms) {
  if (!q.allFinite()) return;
  dynamics::forward_kinematics(model_, ws_, q);
  for (int i = 0; i < model_.dof(); ++i)
    transforms.push_back(frame_transform(
        time_ns, world_frame, com_frame(model_.robot().links[static_cast<std::size_t>(i)].name),
        dynamics::link_pose(model_, ws_, i)));
  transforms.push_back(
      frame_transform(time_ns, world_frame, tip_frame, dynamics::tip_pose(model_, ws_)));
}

void ArmMessages::attach(const std::string& name) {
  const auto found = std::find_if(known_.begin(), known_.end(),
                                  [&](const auto& payload) { return payload.name == name; });
  if (found == known_.end()) return;
  std::erase_if(loads_, [&](const Load& load) { return load.payload.name == name; });
  loads_.push_back({*found, std::nullopt});
}

void ArmMessages::detach(const std::string& name, const Eigen::VectorXd& q) {
  const auto found = std::find_if(loads_.begin(), loads_.end(),
                                  [&](const Load& load) { return load.payload.name == name; });
  if (found == loads_.end()) return;
  if (q.size() != model_.dof()) {
    loads_.erase(found);
    return;
  }
  dynamics::forward_kinematics(model_, ws_, q);
  found->left_at = dynamics::tip_pose(model_, ws_);
}

Entity ArmMessages::link_shapes(std::uint64_t time_ns, const model::Link& link) const {
  Entity entity(time_ns, com_frame(link.name), link.name);
  for (const auto& sphere : link.spheres)
    if (!is_carried(sphere.part)) entity.add_sphere(sphere.center_m, sphere.radius_m, arm_color);
  for (const auto& segment : link.segments)
    if (segment.is_capsule() && !is_carried(segment.part))
      entity.add_capsule(segment.from_m, segment.to_m, segment.radius_m, arm_color);
    else if (!segment.is_capsule())
      entity.add_path({segment.from_m, segment.to_m}, arm_color);
  return entity;
}

Entity ArmMessages::base_shapes(std::uint64_t time_ns) const {
  Entity entity(time_ns, base_frame, base_frame);
  for (const auto& sphere : model_.robot().base_spheres)
    entity.add_sphere(sphere.center_m, sphere.radius_m, base_color);
  for (const auto& segment : model_.robot().base_segments)
    entity.add_capsule(segment.from_m, segment.to_m, segment.radius_m, base_color);
  return entity;
}

Entity ArmMessages::load_shapes(std::uint64_t time_ns, const Load& load) const {
  Entity entity(time_ns, load.left_at ? world_frame : tip_frame, "load/" + load.payload.name);
  const geometry::SE3 pose = load.left_at.value_or(geometry::SE3{});
  for (const auto& sphere : load.payload.spheres)
    entity.add_sphere(pose * sphere.center_m, sphere.radius_m, load_color);
  for (const auto& capsule : load.payload.capsules)
    entity.add_capsule(pose * capsule.from_m, pose * capsule.to_m, capsule.radius_m, load_color);
  return entity;
}

Json ArmMessages::shapes(std::uint64_t time_ns) const {
  std::vector<Entity> entities{base_shapes(time_ns)};
  for (const auto& link : model_.robot().links) entities.push_back(link_shapes(time_ns, link));
  for (const Load& load : loads_) entities.push_back(load_shapes(time_ns, load));
  return scene_update(time_ns, entities);
}

}  // namespace hamelin::mcap
