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
#include "rotation.hpp"
#include "waypoint_file.hpp"

namespace hamelin::scene {

namespace {

// Reads one JSON object that was already checked against the schema; null is the same as absent.
class Reader {
 public:
  Reader(const Json& object, std::string place) : object_(object), place_(std::move(place)) {}

  [[nodiscard]] const Json* find(const char* key) const {
    if (!object_.is_object()) return nullptr;
    const auto it = object_.find(key);
    return it == object_.end() || it->is_null() ? nullptr : &*it;
  }
  template <typename T>
  [[nodiscard]] T get(const char* key, T fallback) const {
    const Json* value = find(key);
    return value != nullptr ? value->get<T>() : fallback;
  }
  template <typename T>
  [[nodiscard]] std::optional<T> maybe(const char* key) const {
    const Json* value = find(key);
    return value != nullptr ? std::optional<T>(value->get<T>()) : std::nullopt;
  }
  [[nodiscard]] Reader child(const char* key) const {
    static const Json nothing;
    const Json* value = find(key);
    return {value != nullptr ? *value : nothing, place_of(key)};
  }
  /// Calls `read` with each element of a list.
  template <class Read>
  void each(const char* key, const Read& read) const {
    const Json* list = find(key);
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i)
      read(Reader((*list)[i], fmt::format("{}/{}", place_of(key), i)));
  }
  [[nodiscard]] const std::string& place() const noexcept { return place_; }
  [[nodiscard]] std::string place_of(const char* key) const {
    return fmt::format("{}/{}", place_, key);
  }

  [[nodiscard]] Eigen::Vector3d vector(const char* key, const Eigen::Vector3d& fallback) const {
    const Json* value = find(key);
    if (value == nullptr) return fallback;
    return {(*value)[0].get<double>(), (*value)[1].get<double>(), (*value)[2].get<double>()};
  }
  [[nodiscard]] Eigen::VectorXd joints(const char* key) const {
    if (const Json* value = find(key); value != nullptr)
      for (std::size_t i = 0; i < value->size(); ++i)
        if (!(*value)[i].is_number())
          fail(fmt::format("{}/{}", key, i).c_str(),
               "is a list, expected a number (way-points belong to a goal of type path)");
    const auto values = get<std::vector<double>>(key, {});
    return Eigen::Map<const Eigen::VectorXd>(values.data(),
                                             static_cast<Eigen::Index>(values.size()));
  }
  // Way-points as columns.
  [[nodiscard]] Eigen::MatrixXd joint_path(const char* key) const {
    const Json& points = *find(key);
    if (points.empty()) fail(key, "is empty, expected at least one way-point");
    Eigen::MatrixXd path;
    for (std::size_t i = 0; i < points.size(); ++i) {
      const std::string place = fmt::format("{}/{}", key, i);
      if (!points[i].is_array() || points[i].empty())
        fail(place.c_str(), "expected a way-point, a list of one number per joint");
      const auto q = points[i].get<std::vector<double>>();
      const auto size = static_cast<Eigen::Index>(q.size());
      if (i == 0) path.resize(size, static_cast<Eigen::Index>(points.size()));
      if (size != path.rows())
        fail(place.c_str(), fmt::format("{} values given, expected {} as in the first way-point",
                                        size, path.rows()));
      path.col(static_cast<Eigen::Index>(i)) = Eigen::Map<const Eigen::VectorXd>(q.data(), size);
    }
    return path;
  }
  [[nodiscard]] Quaternion quaternion() const {
    Quaternion c{1.0, 0.0, 0.0, 0.0};
    if (const Json* value = find("quaternion_wxyz"); value != nullptr)
      for (std::size_t i = 0; i < c.size(); ++i) c[i] = (*value)[i].get<double>();
    const double norm = Eigen::Map<const Eigen::Vector4d>(c.data()).norm();
    if (!(std::abs(norm - 1.0) <= 1e-3))
      fail("quaternion_wxyz", fmt::format("the norm is {:.6g}, expected a unit quaternion", norm));
    return c;
  }
  [[nodiscard]] geometry::SE3 pose() const {
    return {rotation_of(quaternion()), vector("position_m", Eigen::Vector3d::Zero())};
  }
  [[noreturn]] void fail(const char* key, const std::string& message) const {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", place_of(key), message));
  }
  void require(const char* key, std::string_view kind) const {
    if (find(key) == nullptr) fail(key, fmt::format("is missing, expected for a {}", kind));
  }
  void refuse(const char* key, std::string_view kind) const {
    if (find(key) != nullptr) fail(key, fmt::format("is not allowed for a {}", kind));
  }

 private:
  const Json& object_;
  std::string place_;
};

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

Goal default_goal(GoalType type) {
  const bool joint = type == GoalType::joint, position = type == GoalType::position;
  Goal goal;
  goal.type = type;
  goal.tolerance_m = joint ? 0.0 : position ? 0.02 : 0.01;
  goal.tolerance_rad = joint ? 0.05 : position ? 0.0 : type == GoalType::follow ? 0.1 : 0.26;
  goal.speed_max = joint ? 0.05 : std::numeric_limits<double>::infinity();
  return goal;
}

TargetStream read_target_stream(const Reader& in, const std::filesystem::path& folder) {
  TargetStream stream;
  if (const auto file = in.maybe<std::string>("file")) stream.file = resolve_path(folder, *file);
  stream.gap_max_s = in.get("gap_max_s", stream.gap_max_s);
  stream.jump_max_m = in.get("jump_max_m", stream.jump_max_m);
  stream.jump_max_rad = in.get("jump_max_rad", stream.jump_max_rad);
  stream.noise_m = in.get("noise_m", stream.noise_m);
  stream.noise_rad = in.get("noise_rad", stream.noise_rad);
  stream.leash_m = in.get("leash_m", stream.leash_m);
  stream.leash_rad = in.get("leash_rad", stream.leash_rad);
  if (in.get<std::string>("when_lost", "hold") == to_string(WhenLost::end))
    stream.when_lost = WhenLost::end;
  return stream;
}

// A target that moves by the scene has a place, unless its way-points have one.
void read_target(const Reader& in, const std::filesystem::path& folder, Goal& goal) {
  goal.position_only = in.get<std::string>("tracks", "pose") == "position";
  if (in.find("motion") == nullptr) {
    const std::string kind = "follow goal without a motion, whose target is streamed";
    in.refuse("position_m", kind);
    in.refuse("quaternion_wxyz", kind);
    goal.stream = read_target_stream(in.child("stream"), folder);
    return;
  }
  in.refuse("stream", "follow goal with a motion");
  goal.motion = read_motion(in.child("motion"), folder);
  check(*goal.motion, in.place_of("motion"));
  if (std::holds_alternative<WaypointMotion>(*goal.motion)) return;
  in.require("position_m", "follow goal with this motion");
  if (!goal.position_only) in.require("quaternion_wxyz", "follow goal that tracks a pose");
}

GoalType goal_type_of(const std::string& type) {
  if (type == "path" || type == "trajectory") return GoalType::joint;
  for (const GoalType known : {GoalType::position, GoalType::pose, GoalType::follow})
    if (type == to_string(known)) return known;
  return GoalType::joint;
}

// One of the paths of a file that `hamelin plan` wrote: way-points as columns.
Eigen::MatrixXd read_path_file(const std::filesystem::path& file, std::size_t index) {
  const Json document = read_json(file);
  check_shipped_schema(document, "path", file.string());
  const Json& paths = document["paths"];
  if (index >= paths.size() || paths[index]["q"].empty())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /paths/{}: has no way-points, expected a path that was found",
                            file.string(), index));
  return Reader(paths[index], fmt::format("{}: /paths/{}", file.string(), index)).joint_path("q");
}

// The motion of a goal of type trajectory, and its points as a path.
void set_trajectory(Goal& goal, JointTrajectory trajectory) {
  goal.path = trajectory.q;
  goal.q = goal.path.rightCols(1);
  goal.trajectory = std::move(trajectory);
}

void read_trajectory_of(const Reader& in, const std::filesystem::path& folder, Goal& goal) {
  if (in.find("file") == nullptr) {
    in.require("trajectory", "trajectory goal without a file");
    set_trajectory(goal,
                   joint_trajectory_from_json(*in.find("trajectory"), in.place_of("trajectory")));
    return;
  }
  in.refuse("trajectory", "trajectory goal with a file");
  goal.path_file = resolve_path(folder, in.get<std::string>("file", ""));
  set_trajectory(goal, read_joint_trajectory(goal.path_file));
}

// A corner of a box; null: it has no end there.
Eigen::Vector3d read_corner(const Reader& in, const char* key, double end) {
  const Json* given = in.find(key);
  Eigen::Vector3d out = Eigen::Vector3d::Constant(end);
  for (std::size_t i = 0; given != nullptr && i < 3; ++i)
    if (!(*given)[i].is_null()) out[static_cast<Eigen::Index>(i)] = (*given)[i].get<double>();
  return out;
}

TipConstraint read_constraint(const Reader& in) {
  const auto type = in.get<std::string>("type", "");
  const std::string kind = "constraint of type " + type;
  const bool is_axis = type == "axis";
  for (const char* key : {"axis", "direction", "angle_rad"})
    if (!is_axis) in.refuse(key, kind);
  for (const char* key : {"position_m", "quaternion_wxyz", "low_m", "high_m"})
    if (is_axis) in.refuse(key, kind);
  TipConstraint out;
  if (is_axis) {
    in.require("angle_rad", kind);
    const Eigen::Vector3d up = Eigen::Vector3d::UnitZ();
    out = AxisConstraint{in.vector("axis", up), in.vector("direction", up),
                         in.get("angle_rad", 0.0)};
  } else {
    out = BoxConstraint{in.pose(), in.quaternion(), read_corner(in, "low_m", -infinity),
                        read_corner(in, "high_m", infinity)};
  }
  check(out, in.place());
  return out;
}

Goal read_goal(const Reader& in, const std::filesystem::path& folder) {
  const auto type = in.get<std::string>("type", "");
  const bool path = type == "path", trajectory = type == "trajectory";
  Goal goal = default_goal(goal_type_of(type));
  const bool joint = goal.type == GoalType::joint, pose = goal.type == GoalType::pose,
             follow = goal.type == GoalType::follow;
  const std::string kind = type + " goal";
  const bool from_file = path && in.find("file") != nullptr;
  joint && !from_file && !trajectory ? in.require("q", kind) : in.refuse("q", kind);
  if (!path && !trajectory) in.refuse("file", kind);
  if (!trajectory) in.refuse("trajectory", kind);
  if (!from_file) in.refuse("index", kind);
  if (!follow) {
    joint ? in.refuse("position_m", kind) : in.require("position_m", kind);
    pose ? in.require("quaternion_wxyz", kind) : in.refuse("quaternion_wxyz", kind);
    for (const char* key : {"tracks", "motion", "stream"}) in.refuse(key, kind);
  }
  if (joint) in.refuse("tolerance_m", kind);
  if (joint || follow) in.refuse("tip_speed_max_m_s", kind);
  if (follow) in.refuse("speed_max", kind);
  if (goal.type == GoalType::position) in.refuse("tolerance_rad", kind);
  if (trajectory) {
    read_trajectory_of(in, folder, goal);
  } else if (from_file) {
    goal.path_file = resolve_path(folder, in.get<std::string>("file", ""));
    goal.path = read_path_file(goal.path_file, in.get<std::size_t>("index", 0));
    goal.q = goal.path.rightCols(1);
  } else if (path) {
    goal.path = in.joint_path("q");
    goal.q = goal.path.rightCols(1);
  } else {
    goal.q = in.joints("q");
  }
  goal.pose = in.pose();
  goal.quaternion_wxyz = in.quaternion();
  goal.tolerance_m = in.get("tolerance_m", goal.tolerance_m);
  goal.tolerance_rad = in.get("tolerance_rad", goal.tolerance_rad);
  goal.speed_max = in.get("speed_max", goal.speed_max);
  goal.tip_speed_max_m_s = in.maybe<double>("tip_speed_max_m_s");
  if (follow) read_target(in, folder, goal);
  const Reader may_touch = in.child("may_touch");
  goal.may_touch = {read_boxes(may_touch, "boxes_m"),
                    may_touch.get<std::vector<std::string>>("obstacles", {})};
  check(goal.may_touch, in.place_of("may_touch"));
  in.each("constraints",
          [&](const Reader& each) { goal.constraints.push_back(read_constraint(each)); });
  return goal;
}

// A target is never reached, so no goal can come after it.
std::vector<Goal> read_goals(const Reader& in, const std::filesystem::path& folder) {
  std::vector<Goal> goals;
  in.each("goals", [&](const Reader& goal) {
    if (!goals.empty() && goals.back().type == GoalType::follow)
      in.fail(fmt::format("goals/{}", goals.size() - 1).c_str(),
              "is a follow goal, which is never reached, expected it as the last goal");
    goals.push_back(read_goal(goal, folder));
  });
  return goals;
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
    sensor.mount = mount == "tip" ? Mount::tip : mount == "base" ? Mount::base : Mount::world;
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

Goal joint_goal(Eigen::VectorXd q) {
  Goal goal = default_goal(GoalType::joint);
  goal.q = std::move(q);
  return goal;
}

Goal trajectory_goal(JointTrajectory trajectory) {
  check(trajectory, "trajectory");
  Goal goal = default_goal(GoalType::joint);
  set_trajectory(goal, std::move(trajectory));
  return goal;
}

Goal trajectory_goal(const std::filesystem::path& file) {
  Goal goal = trajectory_goal(read_joint_trajectory(file));
  goal.path_file = file;
  return goal;
}

Goal position_goal(const Eigen::Vector3d& position_m) {
  Goal goal = default_goal(GoalType::position);
  goal.pose = {Eigen::Matrix3d::Identity(), position_m};
  return goal;
}

Goal pose_goal(const geometry::SE3& pose) {
  Goal goal = default_goal(GoalType::pose);
  goal.pose = pose;
  return goal;
}

Goal follow_goal(bool position_only, const TargetStream& stream) {
  Goal goal = default_goal(GoalType::follow);
  goal.position_only = position_only;
  goal.stream = stream;
  return goal;
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
