#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

// How far beyond the arm's reach the map of a problem has free space [m]: farther than a planner's
// queries.
constexpr double free_margin_m = 0.5;
// The faces of the free space are multiples of this many voxels, so that few nodes describe it.
constexpr double free_grain = 16.0;

// Reads the keys of a problem. Each message names the key.
class ProblemReader {
 public:
  ProblemReader(const Json& document, std::string where)
      : document_(document), where_(std::move(where)) {
    if (!document.is_object())
      fail("", "is not an object, expected a problem with start, goal and obstacles");
    if (const Json* units = find(document, "units"); units != nullptr && *units != "m,rad")
      fail("/units", fmt::format("are {}, expected \"m,rad\"", units->dump()));
  }

  [[nodiscard]] std::vector<double> joints(const char* key, int dof) const {
    const std::string place = fmt::format("/{}", key);
    const Json* value = find(document_, key);
    if (value == nullptr)
      fail(place, fmt::format("is missing, expected {} numbers (one per joint)", dof));
    return numbers(*value, place, static_cast<std::size_t>(dof));
  }

  [[nodiscard]] Json obstacles() const {
    const Json* list = find(document_, "obstacles");
    if (list == nullptr || !list->is_array())
      fail("/obstacles", "is missing, expected a list of primitives");
    Json out = Json::array();
    for (std::size_t i = 0; i < list->size(); ++i)
      out.push_back(obstacle((*list)[i], fmt::format("/obstacles/{}", i)));
    return out;
  }

  [[noreturn]] void fail(const std::string& place, const std::string& message) const {
    throw Error(ErrorCode::invalid,
                fmt::format("{}: {}: {}", where_, place.empty() ? "/" : place, message));
  }

 private:
  static const Json* find(const Json& object, const char* key) {
    const auto it = object.find(key);
    return it == object.end() || it->is_null() ? nullptr : &*it;
  }

  [[nodiscard]] std::vector<double> numbers(const Json& value, const std::string& place,
                                            std::size_t count) const {
    if (!value.is_array() || value.size() != count ||
        !std::all_of(value.begin(), value.end(), [](const Json& x) { return x.is_number(); }))
      fail(place, fmt::format("is {}, expected {} numbers", brief(value), count));
    return value.get<std::vector<double>>();
  }

  static std::string brief(const Json& value) {
    if (value.is_array()) return fmt::format("a list of {}", value.size());
    if (value.is_object()) return "an object";
    const std::string text = value.dump();
    return text.size() > 40 ? text.substr(0, 40) + "..." : text;
  }

  // In the format of a scene.
  [[nodiscard]] Json obstacle(const Json& from, const std::string& place) const {
    if (!from.is_object()) fail(place, fmt::format("is {}, expected a primitive", brief(from)));
    const Json* type = find(from, "type");
    const Json given = type != nullptr ? *type : Json(nullptr);
    const bool box = given == "box", sphere = given == "sphere", cylinder = given == "cylinder";
    if (!box && !sphere && !cylinder)
      fail(place + "/type",
           fmt::format("is {}, expected \"sphere\", \"box\" or \"cylinder\"", brief(given)));
    Json out{{"name", ""}, {"type", given}};
    const auto length = [&](const Json& value, const std::string& at) {
      if (!value.is_number() || !(value.get<double>() > 0.0 && std::isfinite(value.get<double>())))
        fail(at, fmt::format("is {}, expected a length above 0", brief(value)));
    };
    bool placed = false;
    for (const auto& [key, value] : from.items()) {
      const std::string at = fmt::format("{}/{}", place, key);
      if (key == "type") continue;
      if (key == "name") {
        if (!value.is_string()) fail(at, fmt::format("is {}, expected a name", brief(value)));
        out["name"] = value;
      } else if (key == "position") {
        out["position_m"] = numbers(value, at, 3);
        placed = true;
      } else if (key == "quaternion_wxyz") {
        out["quaternion_wxyz"] = numbers(value, at, 4);
      } else if (key == "size" && box) {
        for (const double edge : numbers(value, at, 3)) length(edge, at);
        out["size_m"] = value;
      } else if ((key == "radius" && !box) || (key == "length" && cylinder)) {
        length(value, at);
        out[key + "_m"] = value;
      } else {
        fail(at, fmt::format("is not known, a {} has name, type, position, quaternion_wxyz and {}",
                             given.get<std::string>(),
                             box      ? "size"
                             : sphere ? "radius"
                                      : "radius, length"));
      }
    }
    if (!placed) fail(place + "/position", "is missing, expected 3 numbers");
    for (const char* needed : {box ? "size" : "radius", cylinder ? "length" : "type"})
      if (find(from, needed) == nullptr)
        fail(fmt::format("{}/{}", place, needed),
             fmt::format("is missing, expected for a {}", given.get<std::string>()));
    out["judge_only"] = true;
    return out;
  }

  const Json& document_;
  std::string where_;
};

// The problem's goal in the format of a scene.
Json goal_json(const std::vector<double>& q, GoalType type, const model::Model& model) {
  if (type == GoalType::joint) return {{"type", "joint"}, {"q", q}};
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(
      model, ws, Eigen::Map<const Eigen::VectorXd>(q.data(), static_cast<Eigen::Index>(q.size())));
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  Json goal{{"type", to_string(type)}, {"position_m", {tip.p().x(), tip.p().y(), tip.p().z()}}};
  if (type == GoalType::pose) {
    const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(tip.R());
    goal["quaternion_wxyz"] = {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
  }
  return goal;
}

// The cube around the base that contains everything that the arm can come near. The space of a
// problem is known.
Box free_space(const model::Model& model, double resolution) {
  const double grain = free_grain * resolution;
  const double half = grain * std::ceil((model.reach() + free_margin_m) / grain);
  return {Eigen::Vector3d::Constant(-half), Eigen::Vector3d::Constant(half)};
}

}  // namespace

MakeReport make_scene_from_problem(const std::filesystem::path& problem,
                                   const ProblemOptions& options) {
  const Json document = read_json(problem);
  const ProblemReader in(document, problem.string());
  const auto directory = options.output.parent_path();
  const auto relative = [&](const std::filesystem::path& path) {
    return std::filesystem::proximate(path, directory.empty() ? "." : directory).generic_string();
  };
  description::RobotOptions of_robot;
  if (!options.tip.empty()) of_robot.tip = options.tip;
  if (!options.spheres.empty()) of_robot.spheres = options.spheres;
  const model::Model model(description::read_robot(options.robot, of_robot));
  MakeMapOptions map;
  map.resolution_m = options.resolution_m;
  map.mark = options.mark;
  map.output = options.output;
  map.output.replace_extension(".bt");
  if (map.output == options.output)
    throw Error(
        ErrorCode::invalid,
        fmt::format("{}: is the name of the map, expected that of a scene, such as {}",
                    options.output.string(),
                    std::filesystem::path(options.output).replace_extension(".json").string()));
  Json out{{"schema", "hamelin.scene/1"}};
  out["robot"] = {{"file", relative(options.robot)}};
  if (!options.tip.empty()) out["robot"]["tip"] = options.tip;
  if (!options.spheres.empty()) out["robot"]["spheres"] = relative(options.spheres);
  out["gravity_m_s2"] = {0.0, 0.0, -9.81};
  out["start"] = {{"q", in.joints("start", model.dof())}};
  out["goals"] = Json::array({goal_json(in.joints("goal", model.dof()), options.goal, model)});
  out["map"] = {{"file", map.output.filename().string()}};
  out["obstacles"] = in.obstacles();
  out["model"] = {{"joint_limits", true},
                  {"velocity_limits", true},
                  {"torque_limits", true},
                  {"self_collision", true}};
  out["planner"] = {{"name", "hybrid"}};
  out["step_s"] = 0.001;
  out["duration_s"] = 30.0;
  out["seed"] = 1;
  map.primitives = scene_from_json(out, directory, problem.string()).obstacles;
  map.free_bounds = free_space(model, map.resolution_m);
  MakeReport report = make_map(map);
  write_file_atomically(options.output, out.dump(2) + "\n");
  return report;
}

}  // namespace hamelin::scene
