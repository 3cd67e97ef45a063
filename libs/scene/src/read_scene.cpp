#include <fmt/format.h>

#include <Eigen/Geometry>
#include <cmath>
#include <initializer_list>
#include <limits>
#include <memory>
#include <set>

#include "hamelin/core/error.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"
#include "read_scene.hpp"
#include "reader.hpp"
#include "rotation.hpp"
#include "waypoint_file.hpp"

namespace hamelin::scene {

namespace {

Shape shape_of(const std::string& type) {
  for (const Shape shape : {Shape::box, Shape::cylinder, Shape::capsule, Shape::frame})
    if (type == to_string(shape)) return shape;
  return Shape::sphere;
}

WaypointMotion read_waypoint_motion(const Reader& in, const std::filesystem::path& folder) {
  WaypointPath::Options options;
  options.repeat = in.get("repeat", false);
  options.gap_max_s = in.maybe<double>("gap_max_s");
  const auto file = in.maybe<std::string>("file");
  const Json* list = in.find("waypoints");
  if (file && list != nullptr)
    in.fail("file", "is given in addition to waypoints, expected one of the two");
  if (list != nullptr)
    return {std::make_shared<WaypointPath>(waypoints_from_json(*list, in.place_of("waypoints")),
                                           options, in.place_of("waypoints"))};
  if (!file) in.fail("waypoints", "is missing, expected waypoints or a file");
  try {
    return {
        std::make_shared<WaypointPath>(read_waypoint_path(resolve_path(folder, *file), options))};
  } catch (const Error& e) {
    throw Error(e.code(), fmt::format("{}: {}", in.place_of("file"), e.what()));
  }
}

}  // namespace

Motion read_motion(const Reader& in, const std::filesystem::path& folder) {
  const auto type = in.get<std::string>("type", "");
  const auto take = [&](std::string_view kind, const std::string& name,
                        std::initializer_list<const char*> keys) {
    for (const char* key : keys)
      if (type != kind) in.refuse(key, name);
  };
  const std::string name = type == "linear"      ? "linear motion"
                           : type == "waypoints" ? "motion by way-points"
                                                 : type;
  take("sine", name, {"amplitude_m", "period_s"});
  take("linear", name, {"velocity_m_s", "start_s", "duration_s"});
  take("waypoints", name, {"waypoints", "file", "repeat", "gap_max_s"});
  if (type == "waypoints") return read_waypoint_motion(in, folder);
  if (type == "sine") {
    in.require("amplitude_m", "sine");
    in.require("period_s", "sine");
    return SineMotion{in.vector("amplitude_m", Eigen::Vector3d::Zero()), in.get("period_s", 0.0)};
  }
  in.require("velocity_m_s", name);
  return LinearMotion{in.vector("velocity_m_s", Eigen::Vector3d::Zero()), in.get("start_s", 0.0),
                      in.get("duration_s", std::numeric_limits<double>::infinity())};
}

namespace {

void read_prediction(const Reader& in, Obstacle& o) {
  const Json* given = in.find("prediction");
  if (given == nullptr) return;
  if (given->is_object()) {
    o.prediction = Prediction::speed_bound;
    o.speed_max_m_s = given->at("speed_max").get<double>();
    return;
  }
  for (const Prediction kind : {Prediction::path, Prediction::constant_velocity})
    if (*given == to_string(kind)) o.prediction = kind;
}

Obstacle read_obstacle(const Reader& in, const std::filesystem::path& folder) {
  Obstacle o;
  o.name = in.get<std::string>("name", "");
  const auto type = in.get<std::string>("type", "");
  o.shape = shape_of(type);
  const bool box = o.shape == Shape::box, frame = o.shape == Shape::frame,
             has_length = o.shape == Shape::cylinder || o.shape == Shape::capsule;
  box ? in.require("size_m", type) : in.refuse("size_m", type);
  box || frame ? in.refuse("radius_m", type) : in.require("radius_m", type);
  has_length ? in.require("length_m", type) : in.refuse("length_m", type);
  o.radius_m = in.get("radius_m", 0.0);
  o.length_m = in.get("length_m", 0.0);
  o.size_m = in.vector("size_m", Eigen::Vector3d::Zero());
  o.attached_to = in.get<std::string>("attached_to", "");
  if (in.find("motion") != nullptr) o.motion = read_motion(in.child("motion"), folder);
  const bool has_place = frame || !o.attached_to.empty() ||
                         (o.motion && std::holds_alternative<WaypointMotion>(*o.motion));
  if (!has_place) in.require("position_m", type);
  o.pose = in.pose();
  o.quaternion_wxyz = in.quaternion();
  read_prediction(in, o);
  o.known = in.get("known", true);
  o.visible_within_m = in.maybe<double>("visible_within_m");
  o.appears_s = in.get("appears_s", 0.0);
  o.judge_only = in.get("judge_only", false);
  return o;
}

// Obstacles may be attached to later ones, so that speeds are known after all were read.
std::vector<Obstacle> read_obstacles(const Reader& in, const std::filesystem::path& folder) {
  std::vector<Obstacle> out;
  in.each("obstacles",
          [&](const Reader& obstacle) { out.push_back(read_obstacle(obstacle, folder)); });
  const std::string place = in.place_of("obstacles");
  attach(out, place);
  for (std::size_t i = 0; i < out.size(); ++i) check(out[i], fmt::format("{}/{}", place, i));
  return out;
}

}  // namespace

std::vector<Box> read_boxes(const Reader& in, const char* key) {
  std::vector<Box> out;
  for (const auto& six : in.get<std::vector<std::vector<double>>>(key, {})) {
    const Box box{{six[0], six[1], six[2]}, {six[3], six[4], six[5]}};
    if (!(box.lo.array() < box.hi.array()).all())
      in.fail(fmt::format("{}/{}", key, out.size()).c_str(),
              "the low corner is not below the high one on each axis, expected [x, y, z, x, y, z]");
    out.push_back(box);
  }
  return out;
}

namespace {

// Cameras may find obstacles that no scene names.
void check_named(const Reader& in, const Scene& scene) {
  if (!scene.sensors.empty()) return;
  std::vector<std::string> names;
  for (const Obstacle& obstacle : scene.obstacles) names.push_back(obstacle.name);
  for (std::size_t i = 0; i < scene.goals.size(); ++i)
    for (const std::string& name : scene.goals[i].may_touch.obstacles)
      if (std::find(names.begin(), names.end(), name) == names.end())
        in.fail(fmt::format("goals/{}/may_touch/obstacles", i).c_str(),
                fmt::format("there is no obstacle '{}', expected one of the scene's {}{}", name,
                            names.size(), did_you_mean(name, names)));
}

MapChangeSpec read_map_change(const Reader& in, const std::filesystem::path& folder) {
  MapChangeSpec change;
  change.time_s = in.get("time_s", 0.0);
  if (const auto file = in.maybe<std::string>("file")) change.file = resolve_path(folder, *file);
  change.free_m = read_boxes(in, "free_boxes_m");
  change.occupied_m = read_boxes(in, "occupied_boxes_m");
  if (!change.file && change.free_m.empty() && change.occupied_m.empty())
    in.fail("file", "is missing, expected a file, free_boxes_m or occupied_boxes_m");
  return change;
}

JointNumbers read_joint_numbers(const Reader& in, const char* key, JointNumbers fallback) {
  const Json* given = in.find(key);
  if (given == nullptr) return fallback;
  JointNumbers numbers;
  if (given->is_string()) numbers.from_robot = true;
  if (given->is_number()) numbers.values = {given->get<double>()};
  if (given->is_array()) numbers.values = given->get<std::vector<double>>();
  if (numbers.values == std::vector<double>{0.0}) numbers.values.clear();
  return numbers;
}

Payload read_payload(const Reader& in) {
  Payload payload;
  payload.name = in.get("name", payload.name);
  payload.mass_kg = in.get("mass_kg", 0.0);
  payload.position_m = in.vector("position_m", Eigen::Vector3d::Zero());
  const auto i = in.get<std::vector<double>>("inertia_kg_m2", {0, 0, 0, 0, 0, 0});
  payload.inertia_kg_m2 << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
  const Eigen::Vector3d zero = Eigen::Vector3d::Zero();
  in.each("spheres", [&](const Reader& sphere) {
    payload.spheres.push_back({sphere.vector("center_m", zero), sphere.get("radius_m", 0.0)});
  });
  in.each("capsules", [&](const Reader& capsule) {
    payload.capsules.push_back({capsule.vector("from_m", zero), capsule.vector("to_m", zero),
                                capsule.get("radius_m", 0.0)});
  });
  payload.shapes_known = in.get("shapes_known", true);
  check(payload, in.place());
  return payload;
}

// Unlike other values, null differs from a missing one: it means no gravity. Logs of earlier
// versions have null where a scene is weightless.
Eigen::Vector3d read_gravity(const Json& document, const Reader& in, const Eigen::Vector3d& usual) {
  const char* const key = "gravity_m_s2";
  if (!document.contains(key)) return usual;
  return in.vector(key, Eigen::Vector3d::Zero());
}

ModelFlags read_model(const Reader& in) {
  ModelFlags model;
  model.joint_damping = read_joint_numbers(in, "joint_damping", model.joint_damping);
  model.friction = read_joint_numbers(in, "friction", model.friction);
  model.friction_speed = in.get("friction_speed", model.friction_speed);
  model.armature = read_joint_numbers(in, "armature", model.armature);
  model.joint_limits = in.get("joint_limits", model.joint_limits);
  model.velocity_limits = in.get("velocity_limits", model.velocity_limits);
  model.torque_limits = in.get("torque_limits", model.torque_limits);
  model.self_collision = in.get("self_collision", model.self_collision);
  if (in.find("payload") != nullptr) model.payload = read_payload(in.child("payload"));
  return model;
}

// One number, or a list of them.
std::vector<double> read_numbers(const Reader& in, const char* key,
                                 std::vector<double> fallback = {}) {
  const Json* given = in.find(key);
  if (given == nullptr) return fallback;
  return given->is_number() ? std::vector{given->get<double>()} : given->get<std::vector<double>>();
}

void read_servo(const Reader& in, Actuation& actuation) {
  const bool position = actuation.type == ActuationType::position;
  if (position != (in.find("servo") != nullptr))
    in.fail("servo", position ? "is missing, expected the gains kp and kv of the position servos"
                              : "is not allowed, expected position actuation");
  if (!position) return;
  const Reader servo = in.child("servo");
  actuation.servo.kp = read_numbers(servo, "kp");
  actuation.servo.kv = read_numbers(servo, "kv");
  if (servo.get<std::string>("feedforward", "dynamics") == "gravity")
    actuation.servo.feedforward = Feedforward::gravity;
  for (auto [key, values] : {std::pair("acceleration_max", &actuation.servo.acceleration_max),
                             std::pair("jerk_max", &actuation.servo.jerk_max)})
    *values = read_numbers(servo, key, *values);
}

PlantType read_plant(const Reader& in, const Reader& plant, ActuationType actuation) {
  if (plant.get<std::string>("type", "hamelin") == "hamelin") return PlantType::hamelin;
  if (actuation == ActuationType::ideal)
    in.fail("actuation/type",
            "is ideal, expected sampled or position because the joints of MuJoCo take torques");
  return PlantType::mujoco;
}

Actuation read_actuation(const Reader& in, double step_s) {
  Actuation actuation;
  const auto type = in.get<std::string>("type", "ideal");
  if (type == "sampled") actuation.type = ActuationType::sampled;
  if (type == "position") actuation.type = ActuationType::position;
  actuation.control_period_s = in.get("control_period_s", step_s);
  actuation.delay_s = in.get("delay_s", 0.0);
  actuation.joint_noise_rad = in.get("joint_noise_rad", 0.0);
  actuation.estimates_velocity = in.get<std::string>("joint_velocity", "measured") == "estimated";
  actuation.estimator_bandwidth = in.get("estimator_bandwidth", actuation.estimator_bandwidth);
  actuation.planner_mass_scale = in.get("planner_mass_scale", 1.0);
  actuation.torque_rate_max_Nm_s = in.maybe<double>("torque_rate_max_Nm_s");
  actuation.coulomb_friction_share = in.get("coulomb_friction_share", 0.0);
  actuation.deadline_s = in.maybe<double>("deadline_s");
  const double steps = actuation.control_period_s / step_s;
  if (!(std::round(steps) >= 1.0 && std::abs(steps - std::round(steps)) <= 1e-9 * steps))
    in.fail("control_period_s", fmt::format("{} s is not an integer multiple of the step {} s",
                                            actuation.control_period_s, step_s));
  if (actuation.type == ActuationType::ideal && std::round(steps) != 1.0)
    in.fail("control_period_s",
            fmt::format("{} s is not allowed, ideal actuation has one tick per step ({} s)",
                        actuation.control_period_s, step_s));
  if (actuation.type == ActuationType::ideal && actuation.delay_s > 0.0)
    in.fail("delay_s",
            fmt::format("{} s is not allowed, ideal actuation has no delay", actuation.delay_s));
  if (actuation.type != ActuationType::sampled && actuation.estimates_velocity)
    in.fail("joint_velocity", "'estimated' is not allowed, expected sampled actuation");
  if (actuation.type != ActuationType::sampled && actuation.torque_rate_max_Nm_s)
    in.fail("torque_rate_max_Nm_s",
            "is not allowed, expected sampled actuation, whose torques change from tick to tick");
  read_servo(in, actuation);
  return actuation;
}

Safety read_safety(const Reader& in) {
  Safety safety;
  if (const auto type = in.maybe<std::string>("type"))
    safety.type = *type == "shield"        ? SafetyType::shield
                  : *type == "certificate" ? SafetyType::certificate
                                           : SafetyType::none;
  safety.margin_m = in.get("margin_m", safety.margin_m);
  safety.torque_share = in.get("torque_share", unstated);
  safety.tracking_rad = in.get("tracking_rad", unstated);
  safety.mass_error = in.get("mass_error", safety.mass_error);
  safety.friction_share = in.get("friction_share", safety.friction_share);
  safety.joint_noise_rad = in.get("joint_noise_rad", unstated);
  return safety;
}

RobotRef read_robot_ref(const Reader& in, const std::filesystem::path& folder) {
  const auto path = [&](const char* key) -> std::optional<std::filesystem::path> {
    const auto text = in.maybe<std::string>(key);
    return text ? std::optional(resolve_path(folder, *text)) : std::nullopt;
  };
  return {path("file").value_or(folder), in.maybe<std::string>("tip"), path("spheres"),
          path("srdf")};
}

PointsSpec read_points_spec(const Reader& in) {
  PointsSpec points;
  for (auto [key, value] : {std::pair{"margin_m", &points.margin_m},
                            {"time_error_s", &points.time_error_s},
                            {"age_max_s", &points.age_max_s},
                            {"hit", &points.hit},
                            {"miss", &points.miss},
                            {"least", &points.least},
                            {"most", &points.most}})
    *value = in.get(key, *value);
  points.movers = in.get("movers", points.movers);
  points.close_gaps = in.get("close_gaps", points.close_gaps);
  if (points.least > points.most)
    in.fail("least", fmt::format("{} is above most, {}", points.least, points.most));
  return points;
}

MapSpec read_map_spec(const Reader& in, const std::filesystem::path& folder) {
  MapSpec map;
  if (const auto file = in.maybe<std::string>("file")) map.file = resolve_path(folder, *file);
  const auto resolution_m = in.maybe<double>("resolution_m");
  if (map.file.empty() && !resolution_m)
    in.fail("file", "is missing, expected it or, for a map that sensors make, resolution_m");
  if (!map.file.empty() && resolution_m)
    in.fail("resolution_m", "is given in addition to file, expected one of them");
  map.resolution_m = resolution_m.value_or(map.resolution_m);
  map.pose = in.pose();
  map.quaternion_wxyz = in.quaternion();
  map.scale = in.maybe<double>("scale");
  map.occupancy_threshold = in.get("occupancy_threshold", 0.5);
  const auto unknown = in.get<std::string>("unknown", "free");
  map.unknown = unknown == "slow"    ? UnknownPolicy::slow
                : unknown == "block" ? UnknownPolicy::block
                                     : UnknownPolicy::free;
  map.keep_out_radius_m = in.get("keep_out_radius_m", 0.0);
  if (const Json* filter = in.find("self_filter"); filter != nullptr && *filter != Json(false))
    map.self_filter_padding_m =
        in.child("self_filter").get("padding_m", default_self_filter_padding_m);
  map.known = in.get("known", true);
  if (!map.known && map.file.empty())
    in.fail("known", "is false, but there is no file, expected one that sensors see");
  map.points = read_points_spec(in.child("points"));
  in.each("changes", [&](const Reader& change) {
    const double last_s = map.changes.empty() ? 0.0 : map.changes.back().time_s;
    map.changes.push_back(read_map_change(change, folder));
    if (const double time_s = map.changes.back().time_s; time_s < last_s)
      change.fail("time_s", fmt::format("{} s is before the change at {} s, expected changes by "
                                        "time",
                                        time_s, last_s));
  });
  return map;
}

std::vector<SensorSpec> read_sensors(const Reader& in, const Scene& scene) {
  std::vector<SensorSpec> out;
  in.each("sensors", [&](const Reader& given) {
    SensorSpec sensor;
    sensor.name = given.get<std::string>("name", fmt::format("camera {}", out.size() + 1));
    const auto mount = given.get<std::string>("mount", "world");
    sensor.mount = mount == "tip"     ? Mount::tip
                   : mount == "base"  ? Mount::base
                   : mount == "frame" ? Mount::frame
                                      : Mount::world;
    sensor.frame = given.get<std::string>("frame", "");
    if ((sensor.mount == Mount::frame) == sensor.frame.empty())
      given.fail("frame", sensor.frame.empty() ? "is not given, expected one with mount \"frame\""
                                               : "is given, expected mount \"frame\" with it");
    sensor.pose = given.pose();
    sensor.quaternion_wxyz = given.quaternion();
    if (const auto size = given.get<std::vector<int>>("size", {}); !size.empty()) {
      sensor.width = size[0];
      sensor.height = size[1];
    }
    sensor.fov_rad = given.get("fov_rad", sensor.fov_rad);
    sensor.rate_hz = given.get("rate_hz", sensor.rate_hz);
    sensor.range_m = given.get("range_m", sensor.range_m);
    sensor.noise_m = given.get("noise_m", sensor.noise_m);
    sensor.delay_s = given.get("delay_s", sensor.delay_s);
    if (!scene.map)
      given.fail("type", "there is no map, expected one in the scene, into which a sensor sees");
    out.push_back(std::move(sensor));
  });
  return out;
}

// An obstacle that an arm carries must be one that rests by itself, and that it can see.
void check_carried(const Reader& event, const Event& given, const Scene& scene) {
  if (!given.attach) event.fail("obstacle", "is given without attach, expected both");
  std::vector<std::string> names;
  for (const Obstacle& obstacle : scene.obstacles) {
    names.push_back(obstacle.name);
    if (obstacle.attached_to == given.obstacle)
      event.fail("obstacle", fmt::format("obstacle '{}' is attached to '{}', expected an obstacle "
                                         "that nothing is attached to",
                                         obstacle.name, given.obstacle));
  }
  const auto found = std::find(names.begin(), names.end(), given.obstacle);
  if (found == names.end())
    event.fail("obstacle",
               fmt::format("there is no obstacle '{}', expected one of the scene's {}{}",
                           given.obstacle, names.size(), did_you_mean(given.obstacle, names)));
  const Obstacle& o = scene.obstacles[static_cast<std::size_t>(found - names.begin())];
  if (moves(o) || o.shape == Shape::frame || !o.known || o.judge_only || o.appears_s > 0.0)
    event.fail("obstacle",
               fmt::format("'{}' moves, is a frame, or is not known from the start, expected a "
                           "solid that rests and is known",
                           given.obstacle));
}

std::vector<Event> read_events(const Reader& in, const std::filesystem::path& folder,
                               const Scene& scene) {
  std::vector<Event> out;
  std::set<std::string> attached;
  if (scene.model.payload) attached.insert(scene.model.payload->name);
  in.each("events", [&](const Reader& given) {
    Event event;
    event.time_s = given.maybe<double>("time_s");
    event.goals_reached = given.maybe<std::size_t>("goals_reached");
    if (event.time_s.has_value() == event.goals_reached.has_value())
      given.fail("time_s", event.time_s ? "is given in addition to goals_reached, expected one of "
                                          "the two"
                                        : "is missing, expected time_s or goals_reached");
    if (event.goals_reached && *event.goals_reached >= scene.goals.size())
      given.fail("goals_reached",
                 fmt::format("is {}, expected less than the number of goals, {}, because the run "
                             "ends with the last one",
                             *event.goals_reached, scene.goals.size()));
    if (given.find("attach") != nullptr) event.attach = read_payload(given.child("attach"));
    event.detach = given.maybe<std::string>("detach");
    event.obstacle = given.get<std::string>("obstacle", "");
    if (!event.obstacle.empty()) check_carried(given, event, scene);
    event.required = given.get("required", true);
    if (given.find("map") != nullptr) event.map = read_map_change(given.child("map"), folder);
    if (event.attach && event.detach)
      given.fail("detach", "is given in addition to attach, expected one of the two");
    if (!event.attach && !event.detach && !event.map)
      given.fail("attach", "is missing, expected attach, detach or map");
    if (event.map && !scene.map) given.fail("map", "there is no map, expected one in the scene");
    if (event.attach && !attached.insert(event.attach->name).second)
      given.fail("attach/name",
                 fmt::format("'{}' is attached already, expected another name or a detach before",
                             event.attach->name));
    if (event.detach && scene.model.payload && *event.detach == scene.model.payload->name)
      given.fail("detach", fmt::format("'{}' is the payload of /model, which stays attached, "
                                       "expected what an earlier event attaches",
                                       *event.detach));
    if (event.detach && attached.erase(*event.detach) == 0)
      given.fail("detach",
                 fmt::format("'{}' is not attached, expected what an earlier event attaches",
                             *event.detach));
    out.push_back(std::move(event));
  });
  return out;
}

std::vector<WrenchSpec> read_wrenches(const Reader& in) {
  using dynamics::Reference;
  std::vector<WrenchSpec> out;
  in.each("wrenches", [&](const Reader& given) {
    WrenchSpec wrench;
    wrench.frame = given.get<std::string>("frame", "");
    wrench.reference =
        dynamics::reference_named(given.get<std::string>("reference", "local_world_aligned"))
            .value_or(Reference::local_world_aligned);
    wrench.force_N = given.vector("force_N", wrench.force_N);
    wrench.moment_Nm = given.vector("moment_Nm", wrench.moment_Nm);
    if (given.find("force_N") == nullptr && given.find("moment_Nm") == nullptr)
      given.fail("force_N", "is missing, expected force_N, moment_Nm or both");
    wrench.from_s = given.get("from_s", 0.0);
    wrench.to_s = given.maybe<double>("to_s");
    if (wrench.to_s && !(*wrench.to_s > wrench.from_s))
      given.fail("to_s",
                 fmt::format("is {}, expected more than from_s, {}", *wrench.to_s, wrench.from_s));
    out.push_back(std::move(wrench));
  });
  return out;
}

GuideSpec read_guide(const Reader& planner) {
  GuideSpec guide;
  guide.type =
      guide_type(planner.get<std::string>("guide", "on-request")).value_or(GuideType::on_request);
  const Reader options = planner.child("guide_options");
  guide.margin_m = options.maybe<double>("margin_m");
  guide.checks_max = options.get("checks_max", guide.checks_max);
  guide.improve_checks = options.get("improve_checks", guide.improve_checks);
  guide.searches_max = options.get("searches_max", guide.searches_max);
  guide.check_time_s = options.get("check_time_s", guide.check_time_s);
  return guide;
}

}  // namespace

Obstacle obstacle_from_json(const Json& document, const std::string& where) {
  Obstacle obstacle = read_obstacle({document, where}, {});
  if (!obstacle.attached_to.empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}/attached_to: is '{}', expected none for an obstacle that is alone",
                            where, obstacle.attached_to));
  return obstacle;
}

Scene scene_from_json(const Json& document, const std::filesystem::path& base_dir,
                      const std::string& where) {
  Scene scene = parts_from_json(document, base_dir, where);
  check_named(Reader(document, where + ": "), scene);
  return scene;
}

Scene parts_from_json(const Json& document, const std::filesystem::path& base_dir,
                      const std::string& where) {
  check_shipped_schema(document, "scene", where);
  const Reader in(document, where + ": ");
  Scene scene;
  scene.name = where;
  scene.robot = read_robot_ref(in.child("robot"), base_dir);
  scene.base = in.child("base").pose();
  scene.base_quaternion_wxyz = in.child("base").quaternion();
  scene.gravity_m_s2 = read_gravity(document, in, scene.gravity_m_s2);
  scene.start_q = in.child("start").joints("q");
  scene.start_v = in.child("start").joints("v");
  scene.goals = read_goals(in, base_dir);
  scene.obstacles = read_obstacles(in, base_dir);
  if (in.find("map") != nullptr) scene.map = read_map_spec(in.child("map"), base_dir);
  scene.sensors = read_sensors(in, scene);
  scene.model = read_model(in.child("model"));
  if (in.find("planner") != nullptr) {
    const Reader planner = in.child("planner");
    scene.planner =
        Choice{planner.get<std::string>("name", ""), planner.get<Json>("params", Json::object())};
    scene.guide = read_guide(planner);
  }
  const Reader integrator = in.child("integrator");
  scene.integrator = {integrator.get<std::string>("name", "hamel-variational"),
                      integrator.get<Json>("params", Json::object())};
  if (in.find("stall") != nullptr) {
    const Reader stall = in.child("stall");
    scene.stall = StallRule{stall.get("speed_m_s", 0.002), stall.get("distance_m", 0.2),
                            stall.get("hold_s", 1.0)};
  }
  scene.step_s = in.get("step_s", 0.001);
  scene.duration_s = in.get("duration_s", 10.0);
  scene.seed = in.get<std::uint64_t>("seed", 1);
  scene.actuation = read_actuation(in.child("actuation"), scene.step_s);
  scene.plant = read_plant(in, in.child("plant"), scene.actuation.type);
  scene.safety = read_safety(in.child("safety"));
  scene.events = read_events(in, base_dir, scene);
  scene.wrenches = read_wrenches(in);
  return scene;
}

std::vector<std::filesystem::path> input_files(const Scene& scene) {
  std::vector<std::filesystem::path> files{scene.robot.file};
  if (scene.robot.spheres) files.push_back(*scene.robot.spheres);
  if (scene.robot.srdf) files.push_back(*scene.robot.srdf);
  for (const Obstacle& obstacle : scene.obstacles)
    if (const auto file = waypoint_file(obstacle); !file.empty()) files.push_back(file);
  for (const Goal& goal : scene.goals) {
    if (!goal.path_file.empty()) files.push_back(goal.path_file);
    if (const auto file = target_file(goal); !file.empty()) files.push_back(file);
  }
  if (!scene.map) return files;
  if (!scene.map->file.empty()) files.push_back(scene.map->file);
  for (const MapChangeSpec& change : scene.map->changes)
    if (change.file) files.push_back(*change.file);
  for (const Event& event : scene.events)
    if (event.map && event.map->file) files.push_back(*event.map->file);
  return files;
}

std::filesystem::path target_file(const Goal& goal) {
  if (!goal.motion) return goal.stream.file;
  const auto* waypoints = std::get_if<WaypointMotion>(&*goal.motion);
  return waypoints != nullptr ? waypoints->path->file() : std::filesystem::path();
}

Scene read_scene(const std::filesystem::path& file) {
  return scene_from_json(read_json(file), file.parent_path(), file.string());
}

}  // namespace hamelin::scene
