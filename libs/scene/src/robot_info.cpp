#include "hamelin/scene/robot_info.hpp"

#include <algorithm>
#include <optional>
#include <utility>

#include "hamelin/dynamics/centroidal.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::scene {

namespace {

Json or_null_number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

std::size_t capsules_of(const model::Link& link) {
  return static_cast<std::size_t>(
      std::count_if(link.segments.begin(), link.segments.end(),
                    [](const model::Segment& segment) { return segment.is_capsule(); }));
}

std::size_t count_shapes(const model::Model& model, bool capsules) {
  return static_cast<std::size_t>(std::count_if(
      model.shapes().begin(), model.shapes().end(),
      [capsules](const model::Model::Shape& shape) { return shape.is_capsule == capsules; }));
}

}  // namespace

Json robot_info(const model::Model& model) {
  const auto& robot = model.robot();
  Json links = Json::array();
  for (const auto& link : robot.links) {
    links.push_back(
        {{"name", link.name},
         {"joint", link.joint.name},
         {"type", link.joint.type == model::JointType::revolute ? "revolute" : "prismatic"},
         {"lower", or_null_number(link.joint.lower)},
         {"upper", or_null_number(link.joint.upper)},
         {"velocity_max", or_null_number(link.joint.velocity_max)},
         {"effort_max", or_null_number(link.joint.effort_max)},
         {"damping", link.joint.damping},
         {"mass_kg", link.mass_kg},
         {"spheres", link.spheres.size()},
         {"capsules", capsules_of(link)},
         {"lines", link.segments.size() - capsules_of(link)}});
  }
  Json frames = Json::array();
  for (const auto& frame : model.frames())
    frames.push_back(
        {{"name", frame.name},
         {"link", frame.link < 0 ? Json(nullptr)
                                 : Json(robot.links[static_cast<std::size_t>(frame.link)].name)}});
  const SelfField self(model);
  Json notes = robot.notes;
  if (!self.note().empty()) notes.push_back(self.note());
  return {{"name", robot.name},
          {"dof", robot.dof()},
          {"planar", model.planar()},
          {"tip", robot.tip.name},
          {"tip_link", robot.links[static_cast<std::size_t>(robot.tip.link)].name},
          {"frames", std::move(frames)},
          {"mass_kg", dynamics::total_mass(model)},
          {"reach_m", model.reach()},
          {"spheres", count_shapes(model, false)},
          {"capsules", count_shapes(model, true)},
          {"base_spheres", robot.base_spheres.size()},
          {"base_capsules", robot.base_segments.size()},
          {"self_collision_disabled", robot.self_collision_disabled.size()},
          {"self_collision_parts", self.parts().size()},
          {"self_collision_pairs", self.pairs().size()},
          {"links", links},
          {"notes", notes},
          {"warnings", robot.warnings}};
}

}  // namespace hamelin::scene
