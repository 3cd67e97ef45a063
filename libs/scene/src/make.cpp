#include "hamelin/scene/make.hpp"

#include <fmt/format.h>
#include <octomap/OcTree.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <sstream>

#include "hamelin/core/error.hpp"
#include "hamelin/core/file.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/model/robot_io.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

constexpr std::int32_t half_key = 1 << 15;

// Half the extent along a unit direction: the support function from the centre.
double half_extent(const Obstacle& o, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d local = o.pose.R().transpose() * direction;
  switch (o.shape) {
    case Shape::sphere:
      return o.radius_m;
    case Shape::box:
      return 0.5 * o.size_m.dot(local.cwiseAbs());
    case Shape::cylinder:
      return 0.5 * o.length_m * std::abs(local.z()) + o.radius_m * std::hypot(local.x(), local.y());
  }
  return 0.0;
}

// Voxels i with lo ≤ (i + offset) · resolution ≤ hi on each axis, as a half-open range.
VoxelBox voxel_range(const Box& box, double resolution, double offset) {
  VoxelBox range;
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    const double lo = std::ceil(box.lo[axis] / resolution - offset),
                 hi = std::floor(box.hi[axis] / resolution - offset) + 1.0;
    if (!(lo >= -half_key && hi <= half_key))
      throw Error(ErrorCode::invalid,
                  fmt::format("an OctoMap of resolution {} m ends at ±{} m, expected nothing beyond", resolution,
                              half_key * resolution));
    range.lo[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(lo);
    range.hi[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(std::max(lo, hi));
  }
  return range;
}

void check_count(const VoxelBox& range) {
  double count = 1.0;
  for (std::size_t axis = 0; axis < 3; ++axis) count *= range.hi[axis] - range.lo[axis];
  if (count > 0x1p28)
    throw Error(ErrorCode::invalid, fmt::format("{:.3g} voxels in one region, expected at most 2^28", count));
}

template <typename Visit>
void for_each_voxel(const VoxelBox& range, const Visit& visit) {
  check_count(range);
  for (std::int32_t z = range.lo[2]; z < range.hi[2]; ++z)
    for (std::int32_t y = range.lo[1]; y < range.hi[1]; ++y)
      for (std::int32_t x = range.lo[0]; x < range.hi[0]; ++x) visit(VoxelBox{{x, y, z}, {x + 1, y + 1, z + 1}});
}

octomap::OcTreeKey key_of(const VoxelBox& voxel) {
  const auto key = [](std::int32_t i) { return static_cast<octomap::key_type>(i + half_key); };
  return {key(voxel.lo[0]), key(voxel.lo[1]), key(voxel.lo[2])};
}

Eigen::Matrix3d random_rotation(Rng& rng) {
  // Shoemake's uniform quaternions.
  const double u = rng.uniform(), a = 2.0 * std::numbers::pi * rng.uniform(),
               b = 2.0 * std::numbers::pi * rng.uniform();
  return Eigen::Quaterniond(std::sqrt(u) * std::cos(b), std::sqrt(1.0 - u) * std::sin(a),
                            std::sqrt(1.0 - u) * std::cos(a), std::sqrt(u) * std::sin(b))
      .normalized()
      .toRotationMatrix();
}

Eigen::Vector3d vector_from(const Json& value) {
  return {value.at(0).get<double>(), value.at(1).get<double>(), value.at(2).get<double>()};
}

Box box_from(const Json& value, const std::string& where) {
  const Box box{vector_from(value.at("min_m")), vector_from(value.at("max_m"))};
  if (!(box.lo.array() < box.hi.array()).all())
    throw Error(ErrorCode::invalid, fmt::format("{}: min_m must be below max_m on each axis", where));
  return box;
}

}  // namespace

std::string_view to_string(Mark mark) noexcept {
  return mark == Mark::touch ? "touch" : "centre";
}

Mark mark_from(std::string_view name) {
  if (name == "touch") return Mark::touch;
  if (name == "centre") return Mark::centre;
  throw Error(ErrorCode::usage, fmt::format("mark '{}' is not known, expected touch or centre", name));
}

std::vector<Obstacle> make_clutter(const Clutter& clutter) {
  if (!(clutter.size_min_m > 0.0 && clutter.size_min_m <= clutter.size_max_m))
    throw Error(ErrorCode::invalid, fmt::format("clutter sizes {} to {} m, expected 0 < size_min_m <= size_max_m",
                                                clutter.size_min_m, clutter.size_max_m));
  Rng rng(clutter.seed);
  const auto size = [&] { return rng.uniform(clutter.size_min_m, clutter.size_max_m); };
  std::vector<Obstacle> made;
  const std::size_t tries_max = 1000 * (clutter.count + 1);
  for (std::size_t tries = 0; made.size() < clutter.count; ++tries) {
    if (tries == tries_max)
      throw Error(ErrorCode::invalid,
                  fmt::format("clutter: only {} of {} primitives placed in {} tries, expected more room outside "
                              "the keep-outs",
                              made.size(), clutter.count, tries_max));
    Obstacle o;
    o.name = fmt::format("clutter{}", made.size());
    o.shape = static_cast<Shape>(rng.below(3));
    // Every primitive draws the same numbers, whatever its shape.
    const double a = size(), b = size(), c = size();
    o.size_m = {a, b, c};
    o.radius_m = 0.5 * a;
    o.length_m = b;
    Eigen::Vector3d center;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      center[axis] = rng.uniform(clutter.bounds.lo[axis], clutter.bounds.hi[axis]);
    o.pose = {random_rotation(rng), center};
    const bool clear = std::all_of(clutter.keep_out.begin(), clutter.keep_out.end(), [&](const Ball& ball) {
      return closest_on(o, center, ball.center).distance >= ball.radius;
    });
    if (clear) made.push_back(o);
  }
  return made;
}

bool touches(const Obstacle& primitive, const Box& cube) {
  const Eigen::Vector3d center = primitive.pose.p(), middle = 0.5 * (cube.lo + cube.hi),
                        half = 0.5 * (cube.hi - cube.lo);
  if (closest_on(primitive, center, middle).distance > half.norm()) return false;
  // Alternating projections onto the two convex bodies converge to a nearest pair. The line between the pair is the
  // normal of a separating plane if there is one; as long as no plane is found they may touch.
  Eigen::Vector3d on_cube = middle;
  for (int round = 0; round < 100; ++round) {
    const SurfacePoint hit = closest_on(primitive, center, on_cube);
    if (hit.distance <= 0.0) return true;
    const Eigen::Vector3d& n = hit.direction;
    const double gap = n.dot(middle - center) - half.dot(n.cwiseAbs()) - half_extent(primitive, n);
    if (gap > 0.0) return false;
    on_cube = hit.point.cwiseMax(cube.lo).cwiseMin(cube.hi);
    if ((on_cube - hit.point).norm() <= 1e-9) return true;
  }
  return true;
}

MakeReport make_map(const MakeMapOptions& options) {
  const double resolution = options.resolution_m;
  if (!(resolution >= 1e-5 && resolution <= 0.5))
    throw Error(ErrorCode::invalid, fmt::format("resolution {} m, expected 1e-5 to 0.5", resolution));
  std::vector<Obstacle> primitives = options.primitives;
  if (options.clutter) {
    const auto clutter = make_clutter(*options.clutter);
    primitives.insert(primitives.end(), clutter.begin(), clutter.end());
  }
  octomap::OcTree tree(resolution);
  MakeReport report;
  report.primitives = primitives.size();
  if (options.free_bounds)
    for_each_voxel(voxel_range(*options.free_bounds, resolution, 0.5), [&](const VoxelBox& voxel) {
      tree.setNodeValue(key_of(voxel), tree.getClampingThresMinLog(), true);
    });
  for (const Obstacle& o : primitives) {
    check(o, fmt::format("primitive '{}'", o.name));
    const Eigen::Vector3d center = o.pose.p();
    Eigen::Vector3d reach;
    for (int axis = 0; axis < 3; ++axis) reach[axis] = half_extent(o, Eigen::Vector3d::Unit(axis));
    if (options.mark == Mark::touch) reach.array() += 0.5 * resolution;
    for_each_voxel(voxel_range({center - reach, center + reach}, resolution, 0.5), [&](const VoxelBox& voxel) {
      const Box cube = to_metres(voxel, resolution);
      const bool marked = options.mark == Mark::touch
                              ? touches(o, cube)
                              : closest_on(o, center, 0.5 * (cube.lo + cube.hi)).distance <= 0.0;
      if (marked) tree.setNodeValue(key_of(voxel), tree.getClampingThresMaxLog(), true);
    });
  }
  if (tree.size() == 0)
    throw Error(ErrorCode::invalid, "the map would be empty, expected primitives, clutter or free bounds");
  tree.updateInnerOccupancy();
  tree.toMaxLikelihood();
  tree.prune();
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    const std::size_t voxels = std::size_t{1} << (3U * (tree.getTreeDepth() - leaf.getDepth()));
    (tree.isNodeOccupied(*leaf) ? report.occupied_voxels : report.free_voxels) += voxels;
  }
  // OctoMap's own writer of whole files prints; its body is the same.
  std::ostringstream bytes;
  bytes << fmt::format(
      "# Octomap OcTree binary file\n# made by hamelin from {} primitives\n#\nid OcTree\nsize {}\nres {}\ndata\n",
      primitives.size(), tree.size(), resolution);
  tree.writeBinaryData(bytes);
  write_file_aside(options.output, bytes.str());
  report.output = options.output;
  report.sha256 = sha256_hex(bytes.str());
  report.bytes = bytes.str().size();
  report.nodes = tree.size();
  return report;
}

MakeMapOptions make_options_from_json(const Json& document, const std::string& where) {
  check_shipped_schema(document, "primitives", where);
  const auto given = [&](const char* key) { return document.contains(key) && !document[key].is_null(); };
  MakeMapOptions options;
  options.resolution_m = document.at("resolution_m").get<double>();
  options.mark = mark_from(document.value("mark", "touch"));
  if (given("free_bounds_m")) options.free_bounds = box_from(document["free_bounds_m"], where + ": /free_bounds_m");
  if (given("obstacles"))
    for (std::size_t i = 0; i < document["obstacles"].size(); ++i)
      options.primitives.push_back(
          obstacle_from_json(document["obstacles"][i], fmt::format("{}: /obstacles/{}", where, i)));
  if (given("clutter")) {
    const Json& from = document["clutter"];
    Clutter clutter;
    clutter.count = from.at("count").get<std::size_t>();
    clutter.size_min_m = from.at("size_min_m").get<double>();
    clutter.size_max_m = from.at("size_max_m").get<double>();
    clutter.bounds = box_from(from.at("bounds_m"), where + ": /clutter/bounds_m");
    if (from.contains("keep_out"))
      for (const Json& ball : from["keep_out"])
        clutter.keep_out.push_back({vector_from(ball.at("center_m")), ball.at("radius_m").get<double>()});
    clutter.seed = from.value("seed", std::uint64_t{1});
    options.clutter = clutter;
  }
  return options;
}

namespace {

// The problem's goal as the scene shall have it.
Json goal_json(const Eigen::VectorXd& q, const ProblemOptions& options, const std::string& where) {
  if (options.goal == GoalType::joint) return {{"type", "joint"}, {"q", std::vector<double>(q.begin(), q.end())}};
  model::RobotOptions of_robot;
  if (!options.tip.empty()) of_robot.tip = options.tip;
  const model::Model model(model::read_robot(options.robot, of_robot));
  if (q.size() != model.dof())
    throw Error(ErrorCode::invalid, fmt::format("{}: /goal: {} numbers given, expected {}, one a joint of '{}'", where,
                                                q.size(), model.dof(), model.robot().name));
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, q);
  const geometry::SE3 tip = dynamics::tip_pose(model, ws);
  Json goal{{"type", to_string(options.goal)}, {"position_m", {tip.p().x(), tip.p().y(), tip.p().z()}}};
  if (options.goal == GoalType::pose) {
    const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(tip.R());
    goal["quaternion_wxyz"] = {wxyz[0], wxyz[1], wxyz[2], wxyz[3]};
  }
  return goal;
}

}  // namespace

MakeReport make_scene_from_problem(const std::filesystem::path& problem, const ProblemOptions& options) {
  const Json document = read_json(problem);
  const auto directory = options.output.parent_path();
  const auto relative = [&](const std::filesystem::path& path) {
    return std::filesystem::proximate(path, directory.empty() ? "." : directory).generic_string();
  };
  Json out{{"schema", "hamelin.scene/1"}};
  Json judged = Json::array();
  MakeMapOptions map;
  map.resolution_m = options.resolution_m;
  map.mark = options.mark;
  map.output = options.output;
  map.output.replace_extension(".bt");
  try {
    out["robot"] = {{"file", relative(options.robot)}};
    if (!options.tip.empty()) out["robot"]["tip"] = options.tip;
    if (!options.spheres.empty()) out["robot"]["spheres"] = relative(options.spheres);
    out["gravity_m_s2"] = {0.0, 0.0, -9.81};
    out["start"] = {{"q", document.at("start")}};
    const auto q = document.at("goal").get<std::vector<double>>();
    const Eigen::Map<const Eigen::VectorXd> goal(q.data(), static_cast<Eigen::Index>(q.size()));
    out["goals"] = Json::array({goal_json(goal, options, problem.string())});
    out["map"] = {{"file", map.output.filename().string()}};
    for (const Json& from : document.at("obstacles")) {
      Json obstacle{{"name", from.at("name")}, {"type", from.at("type")}};
      if (from.contains("radius")) obstacle["radius_m"] = from["radius"];
      if (from.contains("length")) obstacle["length_m"] = from["length"];
      if (from.contains("size")) obstacle["size_m"] = from["size"];
      obstacle["position_m"] = from.at("position");
      obstacle["quaternion_wxyz"] = from.at("quaternion_wxyz");
      obstacle["judge_only"] = true;
      judged.push_back(std::move(obstacle));
    }
  } catch (const nlohmann::json::exception& e) {
    throw Error(ErrorCode::invalid,
                fmt::format("{}: is no problem with start, goal and obstacles: {}", problem.string(), e.what()));
  }
  out["obstacles"] = std::move(judged);
  out["model"] = {{"joint_limits", true}, {"velocity_limits", true}, {"torque_limits", true}, {"self_collision", true}};
  out["planner"] = {{"name", "hybrid"}};
  out["step_s"] = 0.001;
  out["duration_s"] = 30.0;
  out["seed"] = 1;
  map.primitives = scene_from_json(out, directory, problem.string()).obstacles;
  MakeReport report = make_map(map);
  write_file_aside(options.output, out.dump(2) + "\n");
  return report;
}

}  // namespace hamelin::scene
