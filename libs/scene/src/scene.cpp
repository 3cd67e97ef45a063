#include "hamelin/scene/scene.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <charconv>
#include <cmath>

#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/dynamics/dynamics.hpp"

namespace hamelin::scene {

namespace {

Eigen::Matrix3d rotation_of(const Quaternion& c) {
  return Eigen::Quaterniond(c[0], c[1], c[2], c[3]).normalized().toRotationMatrix();
}

// Reads one JSON object whose form the schema has already vouched for; null is the same as absent.
class Reader {
 public:
  Reader(const Json& object, std::string place) : object_(object), place_(std::move(place)) {}

  [[nodiscard]] const Json* find(const char* key) const {
    if (!object_.is_object()) return nullptr;
    const auto it = object_.find(key);
    return it == object_.end() || it->is_null() ? nullptr : &*it;
  }
  template <typename T>
  [[nodiscard]] T get(const char* key, T otherwise) const {
    const Json* value = find(key);
    return value != nullptr ? value->get<T>() : otherwise;
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
  [[nodiscard]] std::string place_of(const char* key) const { return fmt::format("{}/{}", place_, key); }

  [[nodiscard]] Eigen::Vector3d vector(const char* key, const Eigen::Vector3d& otherwise) const {
    const Json* value = find(key);
    if (value == nullptr) return otherwise;
    return {(*value)[0].get<double>(), (*value)[1].get<double>(), (*value)[2].get<double>()};
  }
  [[nodiscard]] Eigen::VectorXd joints(const char* key) const {
    if (const Json* value = find(key); value != nullptr)
      for (std::size_t i = 0; i < value->size(); ++i)
        if (!(*value)[i].is_number())
          fail(fmt::format("{}/{}", key, i).c_str(), "is a list, expected a number: lists make a goal of type path");
    const auto values = get<std::vector<double>>(key, {});
    return Eigen::Map<const Eigen::VectorXd>(values.data(), static_cast<Eigen::Index>(values.size()));
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
        fail(place.c_str(), fmt::format("{} numbers given, expected {} as in the first way-point", size, path.rows()));
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
  [[noreturn]] void fail(const char* key, const std::string& what) const {
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", place_of(key), what));
  }
  void need(const char* key, std::string_view kind) const {
    if (find(key) == nullptr) fail(key, fmt::format("is missing, a {} needs it", kind));
  }
  void refuse(const char* key, std::string_view kind) const {
    if (find(key) != nullptr) fail(key, fmt::format("is not allowed, a {} has none", kind));
  }

 private:
  const Json& object_;
  std::string place_;
};

Json array(const Eigen::Ref<const Eigen::VectorXd>& v) {
  return std::vector<double>(v.data(), v.data() + v.size());
}

Json quaternion_json(const Eigen::Matrix3d& R, const Quaternion& written) {
  if (rotation_of(written) == R) return written;
  Eigen::Quaterniond q(R);
  if (q.w() < 0.0) q.coeffs() = -q.coeffs();
  return {q.w(), q.x(), q.y(), q.z()};
}

template <typename T>
Json or_null(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Obstacle read_obstacle(const Reader& in) {
  Obstacle o;
  o.name = in.get<std::string>("name", "");
  const auto type = in.get<std::string>("type", "");
  o.shape = type == "sphere" ? Shape::sphere : type == "box" ? Shape::box : Shape::cylinder;
  const bool box = o.shape == Shape::box, cylinder = o.shape == Shape::cylinder;
  box ? in.need("size_m", type) : in.refuse("size_m", type);
  box ? in.refuse("radius_m", type) : in.need("radius_m", type);
  cylinder ? in.need("length_m", type) : in.refuse("length_m", type);
  o.radius_m = in.get("radius_m", 0.0);
  o.length_m = in.get("length_m", 0.0);
  o.size_m = in.vector("size_m", Eigen::Vector3d::Zero());
  o.pose = in.pose();
  o.quaternion_wxyz = in.quaternion();
  if (in.find("motion") != nullptr) {
    const Reader motion = in.child("motion");
    if (motion.get<std::string>("type", "") == "sine") {
      motion.need("amplitude_m", "sine");
      motion.need("period_s", "sine");
      for (const char* key : {"velocity_m_s", "start_s", "duration_s"}) motion.refuse(key, "sine");
      o.motion = SineMotion{motion.vector("amplitude_m", Eigen::Vector3d::Zero()), motion.get("period_s", 0.0)};
    } else {
      motion.need("velocity_m_s", "linear motion");
      for (const char* key : {"amplitude_m", "period_s"}) motion.refuse(key, "linear motion");
      o.motion = LinearMotion{motion.vector("velocity_m_s", Eigen::Vector3d::Zero()), motion.get("start_s", 0.0),
                              motion.get("duration_s", std::numeric_limits<double>::infinity())};
    }
  }
  o.known = in.get("known", true);
  o.visible_within_m = in.maybe<double>("visible_within_m");
  o.appears_s = in.get("appears_s", 0.0);
  o.judge_only = in.get("judge_only", false);
  return o;
}

// @param not_before the time of the change before [s]
template <class Resolve>
MapChangeSpec read_map_change(const Reader& in, const Resolve& resolve, double not_before) {
  MapChangeSpec change;
  change.time_s = in.get("time_s", 0.0);
  if (change.time_s < not_before)
    in.fail("time_s",
            fmt::format("{} s is before the change at {} s, expected changes by time", change.time_s, not_before));
  if (const auto file = in.maybe<std::string>("file")) change.file = resolve(*file);
  const auto boxes = [&](const char* key, std::vector<Box>& out) {
    for (const auto& six : in.get<std::vector<std::vector<double>>>(key, {})) {
      const Box box{{six[0], six[1], six[2]}, {six[3], six[4], six[5]}};
      if (!(box.lo.array() < box.hi.array()).all())
        in.fail(fmt::format("{}/{}", key, out.size()).c_str(),
                "its low corner is not below its high one, expected [x, y, z, x, y, z]");
      out.push_back(box);
    }
  };
  boxes("free_boxes_m", change.free_m);
  boxes("occupied_boxes_m", change.occupied_m);
  if (!change.file && change.free_m.empty() && change.occupied_m.empty())
    in.fail("file", "is missing, a change needs a file, free_boxes_m or occupied_boxes_m");
  return change;
}

Goal read_goal(const Reader& in) {
  Goal goal;
  const auto type = in.get<std::string>("type", "");
  const bool path = type == "path";
  goal.type = type == "joint" || path ? GoalType::joint : type == "position" ? GoalType::position : GoalType::pose;
  const bool joint = goal.type == GoalType::joint, pose = goal.type == GoalType::pose;
  const std::string kind = type + " goal";
  joint ? in.need("q", kind) : in.refuse("q", kind);
  joint ? in.refuse("position_m", kind) : in.need("position_m", kind);
  pose ? in.need("quaternion_wxyz", kind) : in.refuse("quaternion_wxyz", kind);
  if (joint) in.refuse("tolerance_m", kind);
  if (joint) in.refuse("tip_speed_max_m_s", kind);
  if (goal.type == GoalType::position) in.refuse("tolerance_rad", kind);
  if (path) {
    goal.path = in.joint_path("q");
    goal.q = goal.path.rightCols(1);
  } else {
    goal.q = in.joints("q");
  }
  goal.pose = in.pose();
  goal.quaternion_wxyz = in.quaternion();
  goal.tolerance_m = in.get("tolerance_m", joint ? 0.0 : pose ? 0.01 : 0.02);
  goal.tolerance_rad = in.get("tolerance_rad", joint ? 0.05 : pose ? 0.26 : 0.0);
  goal.speed_max = in.get("speed_max", joint ? 0.05 : std::numeric_limits<double>::infinity());
  goal.tip_speed_max_m_s = in.maybe<double>("tip_speed_max_m_s");
  return goal;
}

JointNumbers read_joint_numbers(const Reader& in, const char* key, JointNumbers otherwise) {
  const Json* given = in.find(key);
  if (given == nullptr) return otherwise;
  JointNumbers numbers;
  if (given->is_string()) numbers.from_robot = true;
  if (given->is_number()) numbers.values = {given->get<double>()};
  if (given->is_array()) numbers.values = given->get<std::vector<double>>();
  if (numbers.values == std::vector<double>{0.0}) numbers.values.clear();
  return numbers;
}

ModelFlags read_model(const Reader& in) {
  ModelFlags model;
  model.joint_damping = read_joint_numbers(in, "joint_damping", model.joint_damping);
  model.friction = read_joint_numbers(in, "friction", model.friction);
  model.friction_speed = in.get("friction_speed", model.friction_speed);
  model.armature = read_joint_numbers(in, "armature", model.armature);
  model.joint_limits = in.get("joint_limits", false);
  model.velocity_limits = in.get("velocity_limits", false);
  model.torque_limits = in.get("torque_limits", false);
  model.self_collision = in.get("self_collision", false);
  if (in.find("payload") != nullptr) {
    const Reader body = in.child("payload");
    Payload payload;
    payload.mass_kg = body.get("mass_kg", 0.0);
    payload.position_m = body.vector("position_m", Eigen::Vector3d::Zero());
    const auto i = body.get<std::vector<double>>("inertia_kg_m2", {0, 0, 0, 0, 0, 0});
    payload.inertia_kg_m2 << i[0], i[3], i[4], i[3], i[1], i[5], i[4], i[5], i[2];
    model.payload = payload;
  }
  return model;
}

Actuation read_actuation(const Reader& in, double step_s) {
  Actuation actuation;
  if (in.get<std::string>("type", "ideal") == "sampled") actuation.type = ActuationType::sampled;
  actuation.control_period_s = in.get("control_period_s", step_s);
  actuation.delay_s = in.get("delay_s", 0.0);
  actuation.joint_noise_rad = in.get("joint_noise_rad", 0.0);
  actuation.planner_mass_scale = in.get("planner_mass_scale", 1.0);
  actuation.torque_rate_max_Nm_s = in.maybe<double>("torque_rate_max_Nm_s");
  actuation.coulomb_friction_share = in.get("coulomb_friction_share", 0.0);
  const double steps = actuation.control_period_s / step_s;
  if (!(std::round(steps) >= 1.0 && std::abs(steps - std::round(steps)) <= 1e-9 * steps))
    in.fail("control_period_s", fmt::format("{} s is {} steps of {} s, expected a whole number",
                                            actuation.control_period_s, steps, step_s));
  if (actuation.type == ActuationType::ideal && std::round(steps) != 1.0)
    in.fail("control_period_s", fmt::format("{} s is not allowed, ideal actuation has one tick a step ({} s)",
                                            actuation.control_period_s, step_s));
  if (actuation.type == ActuationType::ideal && actuation.delay_s > 0.0)
    in.fail("delay_s", fmt::format("{} s is not allowed, ideal actuation has no delay", actuation.delay_s));
  if (actuation.type == ActuationType::ideal && actuation.torque_rate_max_Nm_s)
    in.fail("torque_rate_max_Nm_s", "is not allowed, only sampled actuation has torques that change from tick to tick");
  return actuation;
}

}  // namespace

std::string_view to_string(GoalType type) noexcept {
  switch (type) {
    case GoalType::joint:
      return "joint";
    case GoalType::position:
      return "position";
    case GoalType::pose:
      return "pose";
  }
  return "unknown";
}

std::string_view type_name(const Goal& goal) noexcept {
  return goal.path.size() > 0 ? "path" : to_string(goal.type);
}

std::string_view to_string(ActuationType type) noexcept {
  switch (type) {
    case ActuationType::ideal:
      return "ideal";
    case ActuationType::sampled:
      return "sampled";
  }
  return "unknown";
}

Obstacle obstacle_from_json(const Json& document, const std::string& where) {
  return read_obstacle({document, where});
}

Scene scene_from_json(const Json& document, const std::filesystem::path& base_dir, const std::string& where) {
  check_shipped_schema(document, "scene", where);
  const auto resolve = [&](const std::string& path) { return (base_dir / path).lexically_normal(); };
  const Reader in(document, where + ": ");
  Scene scene;
  scene.name = where;
  const Reader robot = in.child("robot");
  scene.robot.file = resolve(robot.get<std::string>("file", ""));
  scene.robot.tip = robot.maybe<std::string>("tip");
  if (const auto spheres = robot.maybe<std::string>("spheres")) scene.robot.spheres = resolve(*spheres);
  if (const auto srdf = robot.maybe<std::string>("srdf")) scene.robot.srdf = resolve(*srdf);
  scene.base = in.child("base").pose();
  scene.base_quaternion_wxyz = in.child("base").quaternion();
  if (in.find("gravity_m_s2") != nullptr) scene.gravity_m_s2 = in.vector("gravity_m_s2", Eigen::Vector3d::Zero());
  scene.start_q = in.child("start").joints("q");
  scene.start_v = in.child("start").joints("v");
  const auto each = [&](const char* key, const auto& read) {
    const Json* list = in.find(key);
    for (std::size_t i = 0; list != nullptr && i < list->size(); ++i)
      read(Reader((*list)[i], fmt::format("{}/{}", in.place_of(key), i)));
  };
  each("goals", [&](const Reader& goal) { scene.goals.push_back(read_goal(goal)); });
  each("obstacles", [&](const Reader& obstacle) { scene.obstacles.push_back(read_obstacle(obstacle)); });
  if (in.find("map") != nullptr) {
    const Reader map = in.child("map");
    MapSpec spec;
    spec.file = resolve(map.get<std::string>("file", ""));
    spec.pose = map.pose();
    spec.quaternion_wxyz = map.quaternion();
    spec.scale = map.maybe<double>("scale");
    spec.occupancy_threshold = map.get("occupancy_threshold", 0.5);
    const auto unknown = map.get<std::string>("unknown", "free");
    spec.unknown = unknown == "slow"    ? UnknownPolicy::slow
                   : unknown == "block" ? UnknownPolicy::block
                                        : UnknownPolicy::free;
    spec.keep_out_radius_m = map.get("keep_out_radius_m", 0.0);
    if (const Json* filter = map.find("self_filter"); filter != nullptr && *filter != Json(false))
      spec.self_filter_padding_m = map.child("self_filter").get("padding_m", default_self_filter_padding_m);
    const Json* changes = map.find("changes");
    for (std::size_t i = 0; changes != nullptr && i < changes->size(); ++i)
      spec.changes.push_back(read_map_change(Reader((*changes)[i], fmt::format("{}/{}", map.place_of("changes"), i)),
                                             resolve, spec.changes.empty() ? 0.0 : spec.changes.back().time_s));
    scene.map = spec;
  }
  scene.model = read_model(in.child("model"));
  if (in.find("planner") != nullptr) {
    const Reader planner = in.child("planner");
    scene.planner = Choice{planner.get<std::string>("name", ""), planner.get<Json>("params", Json::object())};
  }
  const Reader integrator = in.child("integrator");
  scene.integrator = {integrator.get<std::string>("name", "hamel-variational"),
                      integrator.get<Json>("params", Json::object())};
  if (in.find("stall") != nullptr) {
    const Reader stall = in.child("stall");
    scene.stall = StallRule{stall.get("speed_m_s", 0.002), stall.get("distance_m", 0.2), stall.get("hold_s", 1.0)};
  }
  scene.step_s = in.get("step_s", 0.001);
  scene.duration_s = in.get("duration_s", 10.0);
  scene.seed = in.get<std::uint64_t>("seed", 1);
  scene.actuation = read_actuation(in.child("actuation"), scene.step_s);
  return scene;
}

Scene read_scene(const std::filesystem::path& file) {
  return scene_from_json(read_json(file), file.parent_path(), file.string());
}

Json motion_json(const std::variant<SineMotion, LinearMotion>& motion) {
  if (const auto* sine = std::get_if<SineMotion>(&motion))
    return {{"type", "sine"}, {"amplitude_m", array(sine->amplitude_m)}, {"period_s", sine->period_s}};
  const auto& line = std::get<LinearMotion>(motion);
  return {{"type", "linear"},
          {"velocity_m_s", array(line.velocity_m_s)},
          {"start_s", line.start_s},
          {"duration_s", std::isinf(line.duration_s) ? Json(nullptr) : Json(line.duration_s)}};
}

Json to_json(const Obstacle& o) {
  Json out{{"name", o.name}, {"type", to_string(o.shape)}};
  if (o.shape == Shape::box) {
    out["size_m"] = array(o.size_m);
  } else {
    out["radius_m"] = o.radius_m;
  }
  if (o.shape == Shape::cylinder) out["length_m"] = o.length_m;
  out["position_m"] = array(o.pose.p());
  out["quaternion_wxyz"] = quaternion_json(o.pose.R(), o.quaternion_wxyz);
  out["motion"] = nullptr;
  if (o.motion) out["motion"] = motion_json(*o.motion);
  out["known"] = o.known;
  out["visible_within_m"] = or_null(o.visible_within_m);
  out["appears_s"] = o.appears_s;
  out["judge_only"] = o.judge_only;
  return out;
}

Json resolved_json(const Scene& scene) {
  const auto pose = [](const geometry::SE3& g, const Quaternion& written) {
    return Json{{"position_m", array(g.p())}, {"quaternion_wxyz", quaternion_json(g.R(), written)}};
  };
  const auto choice = [](const Choice& c) { return Json{{"name", c.name}, {"params", c.params}}; };
  Json out;
  out["schema"] = "hamelin.scene/1";
  out["robot"] = {{"file", scene.robot.file.string()}, {"tip", or_null(scene.robot.tip)}, {"spheres", nullptr}};
  if (scene.robot.spheres) out["robot"]["spheres"] = scene.robot.spheres->string();
  if (scene.robot.srdf) out["robot"]["srdf"] = scene.robot.srdf->string();
  out["base"] = pose(scene.base, scene.base_quaternion_wxyz);
  out["gravity_m_s2"] = scene.gravity_m_s2 ? array(*scene.gravity_m_s2) : Json(nullptr);
  out["start"] = {{"q", nullptr}, {"v", nullptr}};
  if (scene.start_q.size() > 0) out["start"]["q"] = array(scene.start_q);
  if (scene.start_v.size() > 0) out["start"]["v"] = array(scene.start_v);
  out["goals"] = Json::array();
  for (const Goal& goal : scene.goals) {
    Json g{{"type", type_name(goal)}};
    if (goal.path.size() > 0) {
      g["q"] = Json::array();
      for (Eigen::Index i = 0; i < goal.path.cols(); ++i) g["q"].push_back(array(goal.path.col(i)));
    } else if (goal.type == GoalType::joint) {
      g["q"] = array(goal.q);
    } else {
      g["position_m"] = array(goal.pose.p());
      if (goal.type == GoalType::pose) g["quaternion_wxyz"] = quaternion_json(goal.pose.R(), goal.quaternion_wxyz);
      g["tolerance_m"] = goal.tolerance_m;
    }
    if (goal.type != GoalType::position) g["tolerance_rad"] = goal.tolerance_rad;
    g["speed_max"] = std::isfinite(goal.speed_max) ? Json(goal.speed_max) : Json(nullptr);
    if (goal.type != GoalType::joint) g["tip_speed_max_m_s"] = or_null(goal.tip_speed_max_m_s);
    out["goals"].push_back(std::move(g));
  }
  out["map"] = nullptr;
  if (scene.map) {
    Json map{{"file", scene.map->file.string()}};
    map.update(pose(scene.map->pose, scene.map->quaternion_wxyz));
    map["scale"] = or_null(scene.map->scale);
    map["occupancy_threshold"] = scene.map->occupancy_threshold;
    map["unknown"] = to_string(scene.map->unknown);
    map["keep_out_radius_m"] = scene.map->keep_out_radius_m;
    map["self_filter"] = nullptr;
    if (scene.map->self_filter_padding_m) map["self_filter"] = {{"padding_m", *scene.map->self_filter_padding_m}};
    map["changes"] = Json::array();
    for (const MapChangeSpec& change : scene.map->changes) {
      const auto boxes = [](const std::vector<Box>& from) {
        Json list = Json::array();
        for (const Box& box : from)
          list.push_back({box.lo.x(), box.lo.y(), box.lo.z(), box.hi.x(), box.hi.y(), box.hi.z()});
        return list;
      };
      map["changes"].push_back({{"time_s", change.time_s},
                                {"file", change.file ? Json(change.file->generic_string()) : Json(nullptr)},
                                {"free_boxes_m", boxes(change.free_m)},
                                {"occupied_boxes_m", boxes(change.occupied_m)}});
    }
    out["map"] = std::move(map);
  }
  out["obstacles"] = Json::array();
  for (const Obstacle& obstacle : scene.obstacles) out["obstacles"].push_back(to_json(obstacle));
  const ModelFlags& model = scene.model;
  const auto joint_numbers = [](const JointNumbers& numbers) -> Json {
    if (numbers.from_robot) return "robot";
    if (numbers.values.empty()) return 0.0;
    return numbers.values.size() == 1 ? Json(numbers.values.front()) : Json(numbers.values);
  };
  out["model"] = {{"joint_damping", joint_numbers(model.joint_damping)},
                  {"friction", joint_numbers(model.friction)},
                  {"friction_speed", model.friction_speed},
                  {"armature", joint_numbers(model.armature)},
                  {"joint_limits", model.joint_limits},
                  {"velocity_limits", model.velocity_limits},
                  {"torque_limits", model.torque_limits},
                  {"self_collision", model.self_collision},
                  {"payload", nullptr}};
  if (model.payload) {
    const Eigen::Matrix3d& I = model.payload->inertia_kg_m2;
    out["model"]["payload"] = {{"mass_kg", model.payload->mass_kg},
                               {"position_m", array(model.payload->position_m)},
                               {"inertia_kg_m2", {I(0, 0), I(1, 1), I(2, 2), I(0, 1), I(0, 2), I(1, 2)}}};
  }
  const Actuation& a = scene.actuation;
  out["actuation"] = {{"type", to_string(a.type)},
                      {"control_period_s", a.control_period_s},
                      {"delay_s", a.delay_s},
                      {"joint_noise_rad", a.joint_noise_rad},
                      {"planner_mass_scale", a.planner_mass_scale},
                      {"torque_rate_max_Nm_s", or_null(a.torque_rate_max_Nm_s)},
                      {"coulomb_friction_share", a.coulomb_friction_share}};
  out["planner"] = scene.planner ? choice(*scene.planner) : Json(nullptr);
  out["integrator"] = choice(scene.integrator);
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

namespace {

// The robot as it stands when the scene starts; its shapes live as long as this.
class StandingRobot {
 public:
  StandingRobot(const Scene& scene, const model::Model& model);
  [[nodiscard]] RobotAtStart view() const { return {arm_.view(), {centers_, radii_, half_axes_}}; }

 private:
  PlacedShapes arm_;
  std::vector<Eigen::Vector3d> centers_, half_axes_;  // of the base
  std::vector<double> radii_;
};

StandingRobot::StandingRobot(const Scene& scene, const model::Model& model) : arm_(model) {
  const Eigen::VectorXd q = scene.start_q.size() > 0 ? scene.start_q : Eigen::VectorXd::Zero(model.dof());
  if (q.size() != model.dof())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: /start/q: {} numbers given, expected {}", scene.name, q.size(), model.dof()));
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  arm_.place(model, ws);
  const auto add = [&](const Eigen::Vector3d& from, const Eigen::Vector3d& to, double radius) {
    centers_.push_back(model.base() * Eigen::Vector3d(0.5 * (from + to)));
    half_axes_.push_back(model.base().R() * (0.5 * (to - from)));
    radii_.push_back(radius);
  };
  for (const auto& sphere : model.robot().base_spheres) add(sphere.center_m, sphere.center_m, sphere.radius_m);
  for (const auto& capsule : model.robot().base_segments) add(capsule.from_m, capsule.to_m, capsule.radius_m);
}

}  // namespace

MapRegion make_region(const Scene& scene, const model::Model& model, double influence) {
  if (!scene.map) throw Error(ErrorCode::usage, fmt::format("{}: /map: is missing", scene.name));
  const StandingRobot robot(scene, model);
  return read_region(*scene.map, scene.base, model.reach(), influence, robot.view());
}

Environment make_environment(const Scene& scene, const model::Model& model, double influence) {
  const StandingRobot robot(scene, model);
  return {scene.map, scene.obstacles, scene.base, model.reach(), influence, robot.view()};
}

void set_pointer(Json& document, std::string_view assignment) {
  const auto fail = [&](const std::string& what) {
    std::string shown(assignment.substr(0, 200));
    for (char& c : shown) c = c < ' ' && c >= 0 ? ' ' : c;
    throw Error(ErrorCode::usage, fmt::format("{}: {}", shown, what));
  };
  const auto equals = assignment.find('=');
  if (assignment.empty() || assignment.front() != '/' || equals == std::string_view::npos)
    fail("expected /json/pointer=VALUE");
  std::vector<std::string> tokens;
  try {
    for (nlohmann::json::json_pointer rest{std::string(assignment.substr(0, equals))}; !rest.empty(); rest.pop_back())
      tokens.insert(tokens.begin(), rest.back());
  } catch (const nlohmann::json::exception&) {
    fail("the part before '=' is no JSON pointer");
  }
  const std::string text(assignment.substr(equals + 1));
  Json value = Json::parse(text, nullptr, false);
  if (value.is_discarded()) value = text;

  const Json schema = Json::parse(schema_text("scene"));
  const Json* rule = &schema;
  Json changed = document;
  Json* at = &changed;
  for (const std::string& token : tokens) {
    const bool is_list = at->is_array();
    if (is_list) {
      std::size_t index = 0;
      const auto [end, error] = std::from_chars(token.data(), token.data() + token.size(), index);
      if (error != std::errc{} || end != token.data() + token.size() || index >= at->size())
        fail(fmt::format("no element '{}', the list has {}", token, at->size()));
      at = &(*at)[index];
      rule = rule != nullptr && rule->contains("items") ? &(*rule)["items"] : nullptr;
      continue;
    }
    if (!at->is_object() && !at->is_null())
      fail(fmt::format("nothing stands under '{}': its parent is a plain value", token));
    const bool has_properties = rule != nullptr && rule->contains("properties");
    if (has_properties && !(*rule)["properties"].contains(token)) {
      std::vector<std::string> known;
      for (const auto& item : (*rule)["properties"].items()) known.push_back(item.key());
      const auto near = nearest_name(token, known);
      fail(fmt::format("unknown key '{}', expected {}", token,
                       near.empty() ? fmt::format("one of {}", fmt::join(known, ", ")) : fmt::format("'{}'", near)));
    }
    if (at->is_null()) *at = Json::object();
    at = &(*at)[token];
    rule = has_properties ? &(*rule)["properties"][token] : nullptr;
  }
  *at = std::move(value);
  document = std::move(changed);
}

}  // namespace hamelin::scene
