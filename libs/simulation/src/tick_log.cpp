#include "tick_log.hpp"

#include <cmath>
#include <utility>

#include "hamelin/core/rng.hpp"
#include "scene_values.hpp"

namespace hamelin::simulation {

namespace {

std::string obstacle_name(const scene::Environment& environment, int obstacle) {
  if (obstacle == scene::Contact::unknown) return "unknown";
  if (obstacle < 0) return "map";
  return environment.obstacles()[static_cast<std::size_t>(obstacle)].name;
}

// One list of numbers per line, in steps of 0.1 mm: a drawing needs no more.
Json paths_json(const control::Drawing& drawing) {
  constexpr double steps_per_m = 1e4;
  Json paths = Json::array();
  std::size_t from = 0;
  for (const std::size_t end : drawing.ends) {
    Json& path = paths.emplace_back(Json::array());
    for (; from < end; ++from)
      for (const double x : drawing.points[from])
        path.push_back(std::round(steps_per_m * x) / steps_per_m);
  }
  return paths;
}

Json target_json(const control::TargetState& target, const TrackingAudit& tracking) {
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(target.pose.R());
  Json out{{"position_m", to_json(target.pose.p())},
           {"quaternion_wxyz", to_json(wxyz)},
           {"error_m", tracking.error().metres.value_or(0.0)},
           {"free", tracking.free()}};
  if (tracking.error().radians) out["error_rad"] = *tracking.error().radians;
  if (target.lost) out["lost"] = true;
  return out;
}

}  // namespace

void TickLog::header(const scene::Scene& scene, const Json& params, const Json& provenance,
                     long steps) {
  const planning::Plugin& plugin = controller_.plugin();
  Json config = resolved_config(scene);
  config["planner"]["params"] = params;
  Json fields{
      {"program", "run"},
      {"scene", scene.name},
      {"seed", scene.seed},
      {"generator", Rng::name},
      {"config", std::move(config)},
      {"robot_notes", model_.robot().notes},
      {"plugin",
       {{"name", plugin.name()}, {"version", plugin.version()}, {"abi", plugin.abi_version()}}},
      {"provenance", provenance}};
  for (const auto& one : controller_.series())
    fields["series"].push_back({{"name", one.name}, {"unit", one.unit}});
  recorder_.header(std::move(fields), model_.robot(), steps);
}

void TickLog::tick(bool certified, const planning::CommandBuffers* answer) {
  // a planner that has failed answers no more, but the shield brings the arm to rest
  const bool stops = controller_.answer().stopping, acts = answer != nullptr || stops;
  Json channels = Json::object();
  if (acts) actuation_.torques(stops ? nullptr : answer, torque_, channels);
  Json fields{{"k", plant_.node().k},
              {"time_s", plant_.node().time_s},
              {"q", to_json(plant_.node().q)},
              {"v", to_json(plant_.node().v)},
              {"tau", to_json(torque_)},
              {"goal_index", controller_.goals().index()},
              {"clearance_m", nullptr},
              {"closest", nullptr},
              {"energy", energy_json(recorder_.last_node())},
              {"solver", solver_json(plant_.report())},
              {"certified", certified}};
  if (acts) fields["channels"] = std::move(channels);
  if (answer != nullptr)
    for (const double value : answer->series())
      fields["series"].push_back(std::isfinite(value) ? Json(value) : Json(nullptr));
  if (const auto& drawing = controller_.drawing(); drawing.number != drawn_) {
    drawn_ = drawing.number;
    fields["paths"] = paths_json(drawing);
  }
  const auto shield = controller_.shield_report();
  if (shield && acts) fields["fail_safe"] = shield->along_path ? "path" : "line";
  if (shield && acts && shield->stopping) {
    fields["stop"] = {{"cause", to_string(*shield->cause)}, {"q_end", to_json(*shield->stop_end)}};
    if (shield->evades) fields["stop"]["evades"] = true;
  }
  const control::TargetState* const target = controller_.answer().target;
  if (tracking_ != nullptr && target != nullptr && !target->waiting)
    fields["target"] = target_json(*target, *tracking_);
  if (const control::ReferenceState* const reference = controller_.answer().reference)
    fields["reference"] = {
        {"q", to_json(reference->q)}, {"time_s", reference->time_s}, {"rate", reference->rate}};
  if (actuation_.limited()) fields["saturated"] = actuation_.saturated();
  if (world_->has_self()) fields["self_clearance_m"] = world_->self_clearance_m();
  if (world_->has_obstacles()) {
    fields["clearance_m"] = world_->clearance_m();
    if (const auto* nearest = world_->nearest())
      fields["closest"] = {{"sphere", nearest->sphere},
                           {"obstacle", obstacle_name(world_->environment(), nearest->obstacle)}};
  }
  recorder_.tick(plant_.node().k, std::move(fields));
}

}  // namespace hamelin::simulation
