#include "hamelin/control/loaded_arm.hpp"

#include <algorithm>
#include <string>
#include <utility>
#include <vector>

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

using Pairs = std::vector<std::pair<std::string, std::string>>;

// The pairs of parts on different bodies that a field leaves out.
Pairs left_out(const scene::SelfField& field) {
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
Pairs touching_pairs(const model::Model& model, const scene::SelfField& field,
                     std::span<const scene::Payload> payloads, double touching_m,
                     const VectorXd& q) {
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  scene::PlacedShapes arm(model);
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

model::Model carrying(const model::Model& bare, std::span<const scene::Payload> payloads,
                      bool self_collision, double touching_m, const VectorXd& q) {
  model::Robot robot = scene::with_payloads(bare.robot(), payloads);
  model::Model loaded(robot, bare.base(), bare.gravity());
  if (!self_collision) return loaded;
  const scene::SelfField field(loaded);
  const Pairs touching = touching_pairs(loaded, field, payloads, touching_m, q);
  if (touching.empty()) return loaded;
  // A robot with a list of pairs is checked for all others, neighbours included.
  if (robot.self_collision_disabled.empty()) robot.self_collision_disabled = left_out(field);
  robot.self_collision_disabled.insert(robot.self_collision_disabled.end(), touching.begin(),
                                       touching.end());
  return model::Model(std::move(robot), bare.base(), bare.gravity());
}

LoadedArm::LoadedArm(const scene::Scene& scene, model::Model nominal, const Json& params,
                     const Common& common)
    : model(std::move(nominal)),
      view(scene, model, common.world),
      shield(make_shield(scene, common)),
      planner(common.plugin, make_setup(scene, common), params, model, common.world, view,
              common.log, common.now_s),
      guide(make_guide(scene, params, common)),
      start_q_(scene.start_q) {
  DriveOptions of_drive = common.drive;
  of_drive.gyroscopic_terms_max = view.contacts_max();
  drive = make_drive(scene, model, of_drive, shield ? shield->limit_reserve() : LimitReserve{});
  if (!shield) make_stop(scene, common);
}

void LoadedArm::make_stop(const scene::Scene& scene, const Common& common) {
  ChangeBounds changes = common.drive.changes(scene);
  changes.acceleration_max = common.drive.acceleration_max;
  finder_.emplace(scene, model, common.drive.period_s, changes);
  unverified_stop_.emplace(scene, model, common.drive.period_s, changes, *finder_, nullptr);
}

bool LoadedArm::restart(scene::Scene scene, const Json& params, const Common& common) {
  scene.start_q = start_q_;
  shield = make_shield(scene, common);
  guide = make_guide(scene, params, common);
  drive->forget();
  if (common.plugin.can_reset()) return false;
  planner.restart(make_setup(scene, common), params);
  return true;
}

std::unique_ptr<Shield> LoadedArm::make_shield(const scene::Scene& scene,
                                               const Common& common) const {
  if (scene::safety_type(scene) != scene::SafetyType::shield) return nullptr;
  return std::make_unique<Shield>(scene, model, view.self_field(), common.drive.period_s,
                                  common.drive.changes(scene));
}

std::unique_ptr<GuideSearch> LoadedArm::make_guide(const scene::Scene& scene, const Json& params,
                                                   const Common& common) {
  if (scene.guide.type == scene::GuideType::none) return nullptr;
  return std::make_unique<GuideSearch>(
      model, common.world, view,
      guide_settings(scene, model, view, shield ? shield->limit_reserve() : LimitReserve{}, params),
      static_cast<Eigen::Index>(common.path_points_max), common.guide_thread);
}

planning::SetupData LoadedArm::make_setup(const scene::Scene& scene, const Common& common) {
  if (common.now_s > 0.0) view.look(scene.start_q, common.now_s);  // the planner may ask at once
  planning::SetupData setup = planner_setup(scene, model, view, common.drive.period_s,
                                            shield ? shield->limit_reserve() : LimitReserve{});
  setup.path_points_max = common.path_points_max;
  return setup;
}

}  // namespace hamelin::control
