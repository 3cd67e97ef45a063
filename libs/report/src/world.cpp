#include "world.hpp"

#include <fmt/format.h>
#include <Eigen/Geometry>
#include <Eigen/LU>

#include <algorithm>
#include <array>
#include <bit>
#include <iterator>
#include <limits>
#include <set>
#include <span>
#include <tuple>
#include <utility>

#include "hamelin/control/preparation.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "loads.hpp"

namespace hamelin::report {

namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

// A page with more cells is slow: hidden cells are then omitted first, and if necessary small cells
// are drawn as larger ones.
constexpr std::size_t cells_max = 60000;

// Clearances are computed up to this share of the reach, within these bounds [m].
constexpr double influence_share = 0.15, influence_min = 0.3, influence_max = 5.0;

Json array(const Eigen::Ref<const Eigen::VectorXd>& x) {
  Json out = Json::array();
  for (const double value : x) out.push_back(value);
  return out;
}

Json pose_json(const geometry::SE3& pose) {
  return {{"position_m", array(pose.p())},
          {"quaternion_wxyz", array(geometry::quaternion_wxyz(pose.R()))}};
}

// ---- robot

Json robot_json(const model::Model& model) {
  const model::Robot& robot = model.robot();
  Json joints = Json::array(), spheres = Json::array(), segments = Json::array(),
       points = Json::array();
  for (std::size_t i = 0; i < robot.links.size(); ++i) {
    const model::Link& link = robot.links[i];
    joints.push_back(
        {{"name", link.joint.name},
         {"type", link.joint.type == model::JointType::revolute ? "revolute" : "prismatic"},
         {"screw", array(link.joint.screw)},
         {"link", link.name}});
    for (const auto& segment : link.segments)
      segments.push_back({{"link", i},
                          {"from_m", array(link.com * segment.from_m)},
                          {"to_m", array(link.com * segment.to_m)},
                          {"radius_m", segment.radius_m}});
  }
  // a capsule is drawn as a row of balls
  for (std::size_t s = 0; s < model.shapes().size(); ++s) {
    const auto& shape = model.shapes()[s];
    const auto i = static_cast<std::size_t>(shape.link),
               index = static_cast<std::size_t>(shape.index_in_link);
    const model::Link& link = robot.links[i];
    const auto add = [&](const Vector3d& center) {
      spheres.push_back({{"link", i},
                         {"center_m", array(link.com * center)},
                         {"radius_m", shape.radius},
                         {"shape", s}});
    };
    if (!shape.is_capsule) {
      add(link.spheres[index].center_m);
      continue;
    }
    const model::Segment& capsule = link.segments[index];
    for (const Vector3d& center : balls_along(capsule.from_m, capsule.to_m, shape.radius))
      add(center);
  }
  for (const Vector3d& point : skeleton(robot)) points.push_back(array(point));
  Json normal = nullptr;
  if (model.planar()) normal = array(model.root().R().col(2));
  return {
      {"name", robot.name},   {"base", pose_json(model.base())}, {"joints", std::move(joints)},
      {"skeleton", points},   {"tip_link", robot.tip.link},      {"spheres", std::move(spheres)},
      {"segments", segments}, {"planar_normal", normal},         {"shapes", model.shapes().size()}};
}

// ---- map

using Key = std::tuple<std::int32_t, std::int32_t, std::int32_t, std::int32_t>;  // size, z, y, x

Key key_of(const scene::Cell& cell) {
  return {cell.size, cell.lo[2], cell.lo[1], cell.lo[0]};
}

// The cell of the octree's grid with the given size, a power of two, that contains the voxel.
scene::Cell enclosing_cell(const std::array<std::int32_t, 3>& voxel, std::int32_t size) {
  scene::Cell cell{voxel, size};
  for (auto& lo : cell.lo) lo &= ~(size - 1);  // rounds towards −∞, as the octree does
  return cell;
}

class Occupancy {
 public:
  explicit Occupancy(const std::vector<scene::Cell>& cells) {
    for (const auto& cell : cells) {
      keys_.insert(key_of(cell));
      largest_ = std::max(largest_, cell.size);
    }
  }

  /// Whether all six faces of the cell are covered by other cells.
  [[nodiscard]] bool hides(const scene::Cell& cell) const {
    for (std::size_t axis = 0; axis < 3; ++axis)
      for (const bool up : {false, true}) {
        scene::Cell neighbour = cell;
        neighbour.lo[axis] += up ? cell.size : -cell.size;
        if (!covers(neighbour, axis, up)) return false;
      }
    return true;
  }

 private:
  /// Whether the lower (up) or the upper side of `cell` along the axis is occupied all over.
  [[nodiscard]] bool covers(const scene::Cell& cell, std::size_t axis, bool up) const {
    for (std::int32_t size = cell.size; size <= largest_; size *= 2)
      if (keys_.count(key_of(enclosing_cell(cell.lo, size))) > 0) return true;
    if (cell.size == 1) return false;
    const std::int32_t half = cell.size / 2;
    for (unsigned part = 0; part < 4; ++part) {
      scene::Cell quarter{cell.lo, half};
      if (!up) quarter.lo[axis] += half;
      if ((part & 1U) != 0) quarter.lo[(axis + 1) % 3] += half;
      if ((part & 2U) != 0) quarter.lo[(axis + 2) % 3] += half;
      if (!covers(quarter, axis, up)) return false;
    }
    return true;
  }

  std::set<Key> keys_;
  std::int32_t largest_ = 1;
};

// Replaces cells smaller than a size by the cells of that size that contain them.
std::vector<scene::Cell> coarsened(const std::vector<scene::Cell>& cells, std::int32_t size) {
  std::set<Key> seen;
  std::vector<scene::Cell> out;
  for (const auto& cell : cells) {
    const scene::Cell coarse = enclosing_cell(cell.lo, std::max(size, cell.size));
    if (seen.insert(key_of(coarse)).second) out.push_back(coarse);
  }
  return out;
}

Json map_json(const scene::Scene& scene, const model::Model& model, double influence,
              Container& container, std::vector<std::string>& notes) {
  const scene::MapSpec& spec = *scene.map;
  const scene::MapRegion region = scene::make_region(scene, model, influence);
  std::vector<scene::Cell> cells = region.occupied;
  std::size_t left_out = 0;
  if (cells.size() > cells_max) {
    const Occupancy occupancy(cells);
    const auto seen = std::remove_if(cells.begin(), cells.end(),
                                     [&](const auto& cell) { return occupancy.hides(cell); });
    left_out = static_cast<std::size_t>(cells.end() - seen);
    cells.erase(seen, cells.end());
  }
  std::int32_t size = 1;
  for (const std::size_t visible = cells.size(); cells.size() > cells_max;) {
    cells = coarsened(cells, size *= 2);
    if (cells.size() <= cells_max)
      notes.push_back(fmt::format(
          "the map's {} visible cells are drawn at least {} m wide, its resolution is {} m; "
          "clearances are computed from the map itself",
          visible, size * region.resolution_m, region.resolution_m));
  }
  std::sort(cells.begin(), cells.end(),
            [](const auto& a, const auto& b) { return key_of(a) < key_of(b); });
  std::vector<std::int16_t> lo;
  std::vector<std::uint8_t> level;
  for (const auto& cell : cells) {
    for (const std::int32_t at : cell.lo) lo.push_back(static_cast<std::int16_t>(at));
    level.push_back(
        static_cast<std::uint8_t>(std::countr_zero(static_cast<std::uint32_t>(cell.size))));
  }
  Json json{{"file", spec.file.string()}, {"resolution_m", region.resolution_m}};
  json.update(pose_json(spec.pose));
  json["lo"] = container.exact(lo);
  json["level"] = container.exact(level);
  json["left_out"] = left_out;
  return json;
}

// ---- obstacles and goals

// Poses of an obstacle are sampled so often, or as many times [s].
constexpr double sample_s = 0.02;
constexpr std::size_t samples_max = 3000;

// Whether the page has no formula for where the obstacle is.
bool is_sampled(const scene::Obstacle& obstacle) {
  if (!scene::moves(obstacle)) return false;
  return obstacle.parent ||
         (obstacle.motion && !std::holds_alternative<scene::SineMotion>(*obstacle.motion) &&
          !std::holds_alternative<scene::LinearMotion>(*obstacle.motion));
}

// Evenly spaced times, at most `parts_max` and one.
std::vector<double> sample_times(double duration_s, double every_s, std::size_t parts_max) {
  const auto parts = static_cast<std::size_t>(
      std::clamp(std::ceil(duration_s / every_s), 1.0, static_cast<double>(parts_max)));
  std::vector<double> t;
  for (std::size_t k = 0; k <= parts; ++k)
    t.push_back(duration_s * static_cast<double>(k) / static_cast<double>(parts));
  return t;
}

Json sampled_poses(const scene::Obstacle& obstacle, double duration_s, Container& container) {
  const std::vector<double> t = sample_times(duration_s, sample_s, samples_max);
  std::vector<double> position, quaternion;
  for (const double time_s : t) {
    const geometry::SE3 pose = scene::motion_at(obstacle, time_s).pose;
    const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(pose.R());
    position.insert(position.end(), pose.p().begin(), pose.p().end());
    quaternion.insert(quaternion.end(), wxyz.begin(), wxyz.end());
  }
  return {{"t", container.exact(t)},
          {"position_m", container.stepped(position, 1e-5)},
          {"quaternion_wxyz", container.stepped(quaternion, 1e-5)}};
}

// So far ahead the page shows where a mover is predicted to be [s]. One of which only the speed is
// bounded may soon be everywhere.
constexpr std::array<double, 5> ahead_s{0.2, 0.4, 0.6, 0.8, 1.0};
constexpr std::array<double, 2> bounded_ahead_s{0.1, 0.2};

// Predictions are sampled so often, or as many times: there are several for each time [s].
constexpr double prediction_sample_s = 0.05;
constexpr std::size_t predictions_max = 1000;

// Where a planner that is shown the mover is told that it will be; null for others.
Json predicted_json(const scene::Obstacle& obstacle, double duration_s, Container& container) {
  const bool shown = !obstacle.judge_only && (obstacle.known || obstacle.visible_within_m);
  if (!shown || !scene::moves(obstacle)) return nullptr;
  const std::span<const double> ahead = obstacle.prediction == scene::Prediction::speed_bound
                                            ? std::span<const double>(bounded_ahead_s)
                                            : std::span<const double>(ahead_s);
  std::vector<double> t = sample_times(duration_s, prediction_sample_s, predictions_max), position,
                      quaternion;
  Json nearer = Json::array();
  bool turns = false;
  const Matrix3d first = scene::motion_at(obstacle, 0.0).pose.R();
  for (const double now : t)
    for (const double later : ahead) {
      const scene::Placed placed = scene::placed_at(obstacle, {now, later});
      const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(placed.pose.R());
      position.insert(position.end(), placed.pose.p().begin(), placed.pose.p().end());
      quaternion.insert(quaternion.end(), wxyz.begin(), wxyz.end());
      turns = turns || (placed.pose.R() - first).norm() > 1e-6;
      if (now == t.front()) nearer.push_back(placed.nearer_m);
    }
  constexpr double position_step = 2e-4, quaternion_step = 1e-4;
  return {
      {"type", scene::to_string(obstacle.prediction)},
      {"ahead_s", ahead},
      {"nearer_m", std::move(nearer)},
      {"t", container.exact(t)},
      {"position_m", container.centred(position, position_step)},
      {"quaternion_wxyz", turns ? container.centred(quaternion, quaternion_step) : Json(nullptr)}};
}

// @return whether there are any
bool leave_out_carried(scene::Scene& scene) {
  bool any = false;
  for (const scene::Event& event : scene.events)
    for (scene::Obstacle& obstacle : scene.obstacles) {
      if (event.obstacle.empty() || obstacle.name != event.obstacle) continue;
      obstacle.appears_s = std::numeric_limits<double>::infinity();
      any = true;
    }
  return any;
}

Json obstacle_json(const scene::Obstacle& obstacle, double duration_s, Container& container) {
  Json json{{"name", obstacle.name}, {"shape", scene::to_string(obstacle.shape)}};
  if (obstacle.shape == scene::Shape::box) {
    json["size_m"] = array(obstacle.size_m);
  } else {
    json["radius_m"] = obstacle.radius_m;
  }
  if (obstacle.shape == scene::Shape::cylinder || obstacle.shape == scene::Shape::capsule)
    json["length_m"] = obstacle.length_m;
  const bool sampled = is_sampled(obstacle);
  const bool in_world = !obstacle.parent && !sampled;
  json.update(pose_json(in_world ? obstacle.pose : scene::motion_at(obstacle, 0.0).pose));
  json["motion"] = nullptr;
  if (in_world && obstacle.motion) json["motion"] = scene::motion_json(*obstacle.motion);
  json["poses"] = sampled ? sampled_poses(obstacle, duration_s, container) : Json(nullptr);
  json["predicted"] = predicted_json(obstacle, duration_s, container);
  json["appears_s"] = obstacle.appears_s;
  json["judge_only"] = obstacle.judge_only;
  return json;
}

Json goal_json(const scene::Goal& goal) {
  Json json{{"type", scene::to_string(goal.type)}};
  if (goal.type == scene::GoalType::joint) {
    json["q"] = array(goal.q);
    json["tolerance_rad"] = goal.tolerance_rad;
    return json;
  }
  json["position_m"] = array(goal.pose.p());
  if (goal.type == scene::GoalType::pose) {
    json["quaternion_wxyz"] = array(geometry::quaternion_wxyz(goal.pose.R()));
    json["tolerance_rad"] = goal.tolerance_rad;
  }
  json["tolerance_m"] = goal.tolerance_m;
  return json;
}

}  // namespace

// Point p_i = r_i + B_i s_i lies on the axis of joint i, with r_i a point of the axis, B_i its
// direction (the identity for a prismatic joint) and s_i free. The sum of |p_i − p_(i−1)|² is
// smallest where B_iᵀ(2 p_i − p_(i−1) − p_(i+1)) = 0. These equations are eliminated from the base
// outwards as p_i = A_i p_(i+1) + b_i, where A_0 = 0, b_0 is the origin of the base, and
//   W_i = 2 I − A_(i−1),  A_i = B_i (B_iᵀ W_i B_i)⁻¹ B_iᵀ,  b_i = r_i + A_i (b_(i−1) − W_i r_i).
std::vector<Vector3d> skeleton(const model::Robot& robot) {
  const std::size_t n = robot.links.size();
  std::vector<Matrix3d> A(n);
  std::vector<Vector3d> points(n + 1);
  Matrix3d A_before = Matrix3d::Zero();
  Vector3d b_before = Vector3d::Zero();  // the base's origin
  for (std::size_t i = 0; i < n; ++i) {
    const model::Joint& joint = robot.links[i].joint;
    const Matrix3d W = 2.0 * Matrix3d::Identity() - A_before;
    Vector3d r = Vector3d::Zero();
    Matrix3d BK;
    if (joint.type == model::JointType::revolute) {
      const Vector3d axis = joint.screw.head<3>();
      r = axis.cross(joint.screw.tail<3>());
      BK = axis * axis.transpose() / axis.dot(W * axis);
    } else {
      BK = W.inverse();
    }
    A[i] = BK;
    points[i] = r + BK * (b_before - W * r);
    A_before = A[i];
    b_before = points[i];
  }
  points[n] = robot.tip.pose.p();
  for (std::size_t i = n; i-- > 0;) points[i] += A[i] * points[i + 1];
  return points;
}

std::string world_key(const simulation::Recorded& recorded) {
  const Json config = scene::resolved_json(recorded.scene);
  Json key;
  for (const char* part : {"robot", "base", "map", "obstacles", "goals"}) key[part] = config[part];
  key["payload"] = config["model"]["payload"];
  if (recorded.scene.map && recorded.scene.map->self_filter_padding_m)
    key["start"] = config["start"];
  const auto content = [&key](const Json::json_pointer& file) {
    if (!key.contains(file) || !key[file].is_string()) return;
    std::error_code ec;
    const std::filesystem::path path = key[file].get<std::string>();
    if (std::filesystem::is_regular_file(path, ec)) key[file] = sha256_of_file(path);
  };
  for (const char* file : {"/robot/file", "/robot/spheres", "/robot/srdf", "/map/file"})
    content(Json::json_pointer(file));
  for (std::size_t i = 0; i < key["obstacles"].size(); ++i)
    content(Json::json_pointer(fmt::format("/obstacles/{}/motion/file", i)));
  const auto& obstacles = recorded.scene.obstacles;
  if (std::any_of(obstacles.begin(), obstacles.end(), scene::moves))
    key["duration_s"] = config["duration_s"];
  return key.dump();
}

std::unique_ptr<World> make_world(const simulation::Recorded& recorded, std::string key,
                                  bool has_map, Container& container) {
  const scene::Scene& scene = recorded.scene;
  model::Model model = control::load_model(scene);
  const double influence =
      std::clamp(influence_share * model.reach(), influence_min, influence_max);
  auto world = std::make_unique<World>(
      World{std::move(key), std::move(model), scene.goals, {}, false, influence, {}, {}});
  const double reach = world->model.reach();
  scene::Scene shown = scene;
  if (!has_map) shown.map.reset();
  if (leave_out_carried(shown))
    world->notes.push_back("clearances leave out obstacles that are carried");
  world->environment = scene::make_environment(shown, world->model, influence);
  world->has_clearances = (has_map || !scene.map) && world->environment.has_obstacles() &&
                          !world->model.shapes().empty();
  if (shown.map && !shown.map->changes.empty())
    world->notes.push_back(fmt::format(
        "{}: changes during the run, from {} s on; cells and clearances are those at 0 s",
        scene.map->file.string(), scene.map->changes.front().time_s));
  if (std::any_of(scene.goals.begin(), scene.goals.end(),
                  [](const auto& goal) { return !goal.may_touch.empty(); }))
    world->notes.push_back("goals may touch obstacles: clearances are those of all obstacles");
  Json goals = Json::array(), obstacles = Json::array();
  for (const auto& goal : scene.goals)
    if (goal.type != scene::GoalType::follow)  // it has no place of its own
      for (const auto& option : scene::options_of(goal)) goals.push_back(goal_json(option));
  for (const auto& obstacle : scene.obstacles)
    if (obstacle.shape != scene::Shape::frame)
      obstacles.push_back(obstacle_json(obstacle, scene.duration_s, container));
  world->json = {
      {"robot", robot_json(world->model)},
      {"goals", std::move(goals)},
      {"map", shown.map ? map_json(shown, world->model, influence, container, world->notes)
                        : Json(nullptr)},
      {"obstacles", std::move(obstacles)},
      {"reach_m", reach}};
  return world;
}

}  // namespace hamelin::report
