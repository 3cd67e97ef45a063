// The model of an arm with what it carries.
#include <algorithm>
#include <string>
#include <utility>
#include <vector>

#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "hamelin/scene/shapes.hpp"

namespace hamelin::scene {

using Eigen::VectorXd;

namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

// The pairs of parts on different bodies that a field leaves out.
Pairs left_out(const SelfField& field) {
  Pairs out;
  const auto& parts = field.parts();
  const auto checked = [&](std::size_t a, std::size_t b) {
    return std::any_of(field.pairs().begin(), field.pairs().end(), [&](const auto& pair) {
      return static_cast<std::size_t>(pair.part_a) == a &&
             static_cast<std::size_t>(pair.part_b) == b;
    });
  };
  for (std::size_t a = 0; a < parts.size(); ++a)
    for (std::size_t b = a + 1; b < parts.size(); ++b)
      if (parts[a].body != parts[b].body && !checked(a, b))
        out.emplace_back(parts[a].name, parts[b].name);
  return out;
}

// The pairs with one of the payloads that are within a distance at q.
Pairs touching_pairs(const model::Model& model, const SelfField& field,
                     std::span<const Payload> payloads, double touching_m, const VectorXd& q) {
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  PlacedShapes arm(model);
  arm.place(model, ws);
  const auto carried = [&](int part) {
    const std::string& name = field.parts()[static_cast<std::size_t>(part)].name;
    return std::any_of(payloads.begin(), payloads.end(),
                       [&](const auto& payload) { return payload.name == name; });
  };
  Pairs out;
  for (std::size_t k = 0; k < field.pairs().size(); ++k) {
    const auto& pair = field.pairs()[k];
    const bool touch = field.distance(k, arm.view(), touching_m + 1.0) <= touching_m;
    if (touch && (carried(pair.part_a) || carried(pair.part_b)))
      out.emplace_back(field.parts()[static_cast<std::size_t>(pair.part_a)].name,
                       field.parts()[static_cast<std::size_t>(pair.part_b)].name);
  }
  return out;
}

}  // namespace

model::Model carrying(const model::Model& bare, std::span<const Payload> payloads,
                      bool self_collision, double touching_m, const VectorXd& q) {
  model::Robot robot = with_payloads(bare.robot(), payloads);
  model::Model loaded(robot, bare.base(), bare.gravity());
  if (!self_collision) return loaded;
  const SelfField field(loaded);
  const Pairs touching = touching_pairs(loaded, field, payloads, touching_m, q);
  if (touching.empty()) return loaded;
  // A robot with a list of pairs is checked for all others, neighbours included.
  if (robot.self_collision_disabled.empty()) robot.self_collision_disabled = left_out(field);
  robot.self_collision_disabled.insert(robot.self_collision_disabled.end(), touching.begin(),
                                       touching.end());
  return model::Model(std::move(robot), bare.base(), bare.gravity());
}

}  // namespace hamelin::scene
