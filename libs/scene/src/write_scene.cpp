#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/scene/scene.hpp"
#include "writer.hpp"

namespace hamelin::scene {

namespace {

Json choice_json(const Choice& choice) {
  return {{"name", choice.name}, {"params", choice.params}};
}

void add_guide(const GuideSpec& guide, Json& planner) {
  planner["guide"] = to_string(guide.type);
  planner["guide_options"] = {{"margin_m", or_null(guide.margin_m)},
                              {"checks_max", guide.checks_max},
                              {"improve_checks", guide.improve_checks},
                              {"searches_max", guide.searches_max},
                              {"check_time_s", guide.check_time_s}};
}

Json path_or_null(const std::optional<std::filesystem::path>& path) {
  return path ? Json(path->string()) : Json(nullptr);
}

Json boxes_json(const std::vector<Box>& boxes) {
  Json list = Json::array();
  for (const Box& box : boxes)
    list.push_back({box.lo.x(), box.lo.y(), box.lo.z(), box.hi.x(), box.hi.y(), box.hi.z()});
  return list;
}

Json change_json(const MapChangeSpec& change) {
  return {{"time_s", change.time_s},
          {"file", change.file ? Json(change.file->generic_string()) : Json(nullptr)},
          {"free_boxes_m", boxes_json(change.free_m)},
          {"occupied_boxes_m", boxes_json(change.occupied_m)}};
}

Json map_json(const MapSpec& map) {
  Json out{{"file", map.file.empty() ? Json(nullptr) : Json(map.file.string())}};
  if (map.file.empty()) out["resolution_m"] = map.resolution_m;
  out.update(pose_json(map.pose, map.quaternion_wxyz));
  out["scale"] = or_null(map.scale);
  out["occupancy_threshold"] = map.occupancy_threshold;
  out["unknown"] = to_string(map.unknown);
  out["keep_out_radius_m"] = map.keep_out_radius_m;
  out["self_filter"] = nullptr;
  if (map.self_filter_padding_m) out["self_filter"] = {{"padding_m", *map.self_filter_padding_m}};
  out["known"] = map.known;
  const PointsSpec& points = map.points;
  out["points"] = {{"margin_m", points.margin_m},
                   {"time_error_s", points.time_error_s},
                   {"age_max_s", points.age_max_s},
                   {"movers", points.movers},
                   {"close_gaps", points.close_gaps},
                   {"hit", points.hit},
                   {"miss", points.miss},
                   {"least", points.least},
                   {"most", points.most}};
  out["changes"] = Json::array();
  for (const MapChangeSpec& change : map.changes) out["changes"].push_back(change_json(change));
  return out;
}

Json sensor_json(const SensorSpec& sensor) {
  Json out{{"type", "depth"}, {"name", sensor.name}, {"mount", to_string(sensor.mount)}};
  if (sensor.mount == Mount::frame) out["frame"] = sensor.frame;
  out.update(pose_json(sensor.pose, sensor.quaternion_wxyz));
  out["fov_rad"] = sensor.fov_rad;
  out["size"] = {sensor.width, sensor.height};
  out["rate_hz"] = sensor.rate_hz;
  out["range_m"] = sensor.range_m;
  out["noise_m"] = sensor.noise_m;
  out["delay_s"] = sensor.delay_s;
  return out;
}

Json one_or_list(const std::vector<double>& values) {
  return values.size() == 1 ? Json(values.front()) : Json(values);
}

Json joint_numbers_json(const JointNumbers& numbers) {
  if (numbers.from_robot) return "robot";
  return numbers.values.empty() ? Json(0.0) : one_or_list(numbers.values);
}

Json payload_json(const Payload& payload) {
  const Eigen::Matrix3d& I = payload.inertia_kg_m2;
  Json out{{"name", payload.name},
           {"mass_kg", payload.mass_kg},
           {"position_m", array(payload.position_m)},
           {"inertia_kg_m2", {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}},
           {"spheres", Json::array()},
           {"capsules", Json::array()},
           {"shapes_known", payload.shapes_known}};
  for (const model::Sphere& sphere : payload.spheres)
    out["spheres"].push_back({{"center_m", array(sphere.center_m)}, {"radius_m", sphere.radius_m}});
  for (const model::Segment& capsule : payload.capsules)
    out["capsules"].push_back({{"from_m", array(capsule.from_m)},
                               {"to_m", array(capsule.to_m)},
                               {"radius_m", capsule.radius_m}});
  return out;
}

Json wrench_json(const WrenchSpec& wrench) {
  return {{"frame", wrench.frame.empty() ? Json(nullptr) : Json(wrench.frame)},
          {"reference", dynamics::name_of(wrench.reference)},
          {"force_N", array(wrench.force_N)},
          {"moment_Nm", array(wrench.moment_Nm)},
          {"from_s", wrench.from_s},
          {"to_s", or_null(wrench.to_s)}};
}

Json event_json(const Event& event) {
  Json out = Json::object();
  if (event.time_s) out["time_s"] = *event.time_s;
  if (event.goals_reached) out["goals_reached"] = *event.goals_reached;
  if (event.attach) out["attach"] = payload_json(*event.attach);
  if (!event.obstacle.empty()) out["obstacle"] = event.obstacle;
  if (event.detach) out["detach"] = *event.detach;
  if (event.map) {
    out["map"] = change_json(*event.map);
    out["map"].erase("time_s");
  }
  out["required"] = event.required;
  return out;
}

Json model_json(const ModelFlags& model) {
  Json out{{"joint_damping", joint_numbers_json(model.joint_damping)},
           {"friction", joint_numbers_json(model.friction)},
           {"friction_speed", model.friction_speed},
           {"armature", joint_numbers_json(model.armature)},
           {"joint_limits", model.joint_limits},
           {"velocity_limits", model.velocity_limits},
           {"torque_limits", model.torque_limits},
           {"self_collision", model.self_collision},
           {"payload", nullptr}};
  if (model.payload) out["payload"] = payload_json(*model.payload);
  return out;
}

Json safety_json(const Scene& scene) {
  const SafetyType type = safety_type(scene);
  Json out{{"type", to_string(type)}};
  if (type != SafetyType::shield) return out;
  const SafetyBounds bounds = safety_bounds(scene);
  out["margin_m"] = bounds.margin_m;
  out["torque_share"] = bounds.torque_share;
  out["tracking_rad"] = bounds.tracking_rad;
  out["mass_error"] = bounds.mass_error;
  out["friction_share"] = bounds.friction_share;
  out["joint_noise_rad"] = bounds.joint_noise_rad;
  return out;
}

Json actuation_json(const Actuation& actuation) {
  Json out{{"type", to_string(actuation.type)},
           {"control_period_s", actuation.control_period_s},
           {"delay_s", actuation.delay_s},
           {"joint_noise_rad", actuation.joint_noise_rad},
           {"planner_mass_scale", actuation.planner_mass_scale},
           {"torque_rate_max_Nm_s", or_null(actuation.torque_rate_max_Nm_s)},
           {"coulomb_friction_share", actuation.coulomb_friction_share}};
  if (actuation.estimates_velocity) {
    out["joint_velocity"] = "estimated";
    out["estimator_bandwidth"] = actuation.estimator_bandwidth;
  }
  if (actuation.type == ActuationType::position)
    out["servo"] = {{"kp", one_or_list(actuation.servo.kp)},
                    {"kv", one_or_list(actuation.servo.kv)},
                    {"feedforward", to_string(actuation.servo.feedforward)},
                    {"acceleration_max", one_or_list(actuation.servo.acceleration_max)},
                    {"jerk_max", one_or_list(actuation.servo.jerk_max)}};
  if (actuation.deadline_s) out["deadline_s"] = *actuation.deadline_s;
  return out;
}

Json start_json(const Scene& scene) {
  Json out{{"q", nullptr}, {"v", nullptr}};
  if (scene.start_q.size() > 0) out["q"] = array(scene.start_q);
  if (scene.start_v.size() > 0) out["v"] = array(scene.start_v);
  return out;
}

}  // namespace

std::string_view to_string(ActuationType type) noexcept {
  switch (type) {
    case ActuationType::ideal:
      return "ideal";
    case ActuationType::sampled:
      return "sampled";
    case ActuationType::position:
      return "position";
  }
  return "unknown";
}

std::string_view to_string(Feedforward feedforward) noexcept {
  switch (feedforward) {
    case Feedforward::dynamics:
      return "dynamics";
    case Feedforward::gravity:
      return "gravity";
  }
  return "";
}

std::string_view to_string(SafetyType type) noexcept {
  switch (type) {
    case SafetyType::shield:
      return "shield";
    case SafetyType::certificate:
      return "certificate";
    case SafetyType::none:
      break;
  }
  return "none";
}

std::string_view to_string(GuideType type) noexcept {
  switch (type) {
    case GuideType::on_request:
      return "on-request";
    case GuideType::none:
      return "none";
    case GuideType::rrt_connect:
      return "rrt-connect";
  }
  return "";
}

std::optional<GuideType> guide_type(std::string_view name) noexcept {
  for (const GuideType type : {GuideType::on_request, GuideType::none, GuideType::rrt_connect})
    if (name == to_string(type)) return type;
  return std::nullopt;
}

std::string_view to_string(PlantType type) noexcept {
  switch (type) {
    case PlantType::hamelin:
      return "hamelin";
    case PlantType::mujoco:
      return "mujoco";
  }
  return "unknown";
}

namespace {

Json waypoints_json(const WaypointPath& path) {
  Json out{{"type", "waypoints"},
           {"repeat", path.options().repeat},
           {"gap_max_s", or_null(path.options().gap_max_s)}};
  if (!path.file().empty()) {
    out["file"] = path.file().string();
    return out;
  }
  out["waypoints"] = Json::array();
  for (const Waypoint& w : path.waypoints())
    out["waypoints"].push_back({{"time_s", w.time_s},
                                {"position_m", array(w.position_m)},
                                {"quaternion_wxyz", w.quaternion_wxyz}});
  return out;
}

}  // namespace

Json motion_json(const Motion& motion) {
  if (const auto* sine = std::get_if<SineMotion>(&motion))
    return {
        {"type", "sine"}, {"amplitude_m", array(sine->amplitude_m)}, {"period_s", sine->period_s}};
  if (const auto* waypoints = std::get_if<WaypointMotion>(&motion))
    return waypoints_json(*waypoints->path);
  if (std::holds_alternative<ObservedMotion>(motion))
    throw Error(
        ErrorCode::invalid,
        "motion: was observed in a running loop, expected one that a scene can state: sine, "
        "linear or waypoints");
  const auto& line = std::get<LinearMotion>(motion);
  return {{"type", "linear"},
          {"velocity_m_s", array(line.velocity_m_s)},
          {"start_s", line.start_s},
          {"duration_s", std::isinf(line.duration_s) ? Json(nullptr) : Json(line.duration_s)}};
}

Json to_json(const Allowance& allowance) {
  if (allowance.empty()) return nullptr;
  return {{"boxes_m", boxes_json(allowance.boxes_m)}, {"obstacles", allowance.obstacles}};
}

Json to_json(const Obstacle& o) {
  Json out{{"name", o.name}, {"type", to_string(o.shape)}};
  if (o.shape == Shape::box) {
    out["size_m"] = array(o.size_m);
  } else if (o.shape != Shape::frame) {
    out["radius_m"] = o.radius_m;
  }
  if (o.shape == Shape::cylinder || o.shape == Shape::capsule) out["length_m"] = o.length_m;
  out["attached_to"] = o.attached_to.empty() ? Json(nullptr) : Json(o.attached_to);
  out["position_m"] = array(o.pose.p());
  out["quaternion_wxyz"] = quaternion_json(o.pose.R(), o.quaternion_wxyz);
  out["motion"] = nullptr;
  if (o.motion) out["motion"] = motion_json(*o.motion);
  out["prediction"] = o.prediction == Prediction::speed_bound ? Json{{"speed_max", o.speed_max_m_s}}
                                                              : Json(to_string(o.prediction));
  out["known"] = o.known;
  out["visible_within_m"] = or_null(o.visible_within_m);
  out["appears_s"] = o.appears_s;
  out["judge_only"] = o.judge_only;
  return out;
}

Json resolved_json(const Scene& scene) {
  Json out;
  out["schema"] = "hamelin.scene/1";
  out["robot"] = {{"file", scene.robot.file.string()},
                  {"tip", or_null(scene.robot.tip)},
                  {"spheres", path_or_null(scene.robot.spheres)},
                  {"srdf", path_or_null(scene.robot.srdf)}};
  out["base"] = pose_json(scene.base, scene.base_quaternion_wxyz);
  out["gravity_m_s2"] = array(scene.gravity_m_s2);
  out["start"] = start_json(scene);
  out["goals"] = Json::array();
  for (const Goal& goal : scene.goals) out["goals"].push_back(goal_json(goal));
  out["map"] = scene.map ? map_json(*scene.map) : Json(nullptr);
  out["obstacles"] = Json::array();
  for (const Obstacle& obstacle : scene.obstacles) out["obstacles"].push_back(to_json(obstacle));
  out["sensors"] = Json::array();
  for (const SensorSpec& sensor : scene.sensors) out["sensors"].push_back(sensor_json(sensor));
  for (const Event& event : scene.events) out["events"].push_back(event_json(event));
  for (const WrenchSpec& wrench : scene.wrenches) out["wrenches"].push_back(wrench_json(wrench));
  out["model"] = model_json(scene.model);
  out["actuation"] = actuation_json(scene.actuation);
  if (scene.plant != PlantType::hamelin) out["plant"] = {{"type", to_string(scene.plant)}};
  out["safety"] = safety_json(scene);
  out["planner"] = scene.planner ? choice_json(*scene.planner) : Json(nullptr);
  if (scene.planner) add_guide(scene.guide, out["planner"]);
  out["integrator"] = choice_json(scene.integrator);
  out["stall"] = nullptr;
  if (scene.stall)
    out["stall"] = {{"speed_m_s", scene.stall->speed_m_s},
                    {"distance_m", scene.stall->distance_m},
                    {"hold_s", scene.stall->hold_s}};
  out["step_s"] = scene.step_s;
  out["duration_s"] = scene.duration_s;
  out["seed"] = scene.seed;
  return out;
}

}  // namespace hamelin::scene
