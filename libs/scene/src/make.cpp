#include "hamelin/scene/make.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numbers>
#include <numeric>

#include "bt_writer.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/scene.hpp"

namespace hamelin::scene {

namespace {

constexpr std::int32_t half_key = BtWriter::half;
constexpr std::size_t examined_max = std::size_t{1} << 25U;

// Half the extent along a unit direction, docs/theory.md (11.32): the support function from the
// centre.
double half_extent(const Obstacle& o, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d local = o.pose.R().transpose() * direction;
  switch (o.shape) {
    case Shape::sphere:
      return o.radius_m;
    case Shape::box:
      return 0.5 * o.size_m.dot(local.cwiseAbs());
    case Shape::cylinder:
      return 0.5 * o.length_m * std::abs(local.z()) + o.radius_m * std::hypot(local.x(), local.y());
    case Shape::capsule:
      return 0.5 * o.length_m * std::abs(local.z()) + o.radius_m;
    case Shape::frame:
      break;
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
      throw Error(
          ErrorCode::invalid,
          fmt::format("an OctoMap of resolution {} m ends at ±{} m, expected nothing beyond",
                      resolution, half_key * resolution));
    range.lo[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(lo);
    range.hi[static_cast<std::size_t>(axis)] = static_cast<std::int32_t>(std::max(lo, hi));
  }
  return range;
}

bool overlaps(const VoxelBox& range, const Cell& cell) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (cell.lo[axis] + cell.size <= range.lo[axis] || cell.lo[axis] >= range.hi[axis])
      return false;
  return true;
}

bool contains(const VoxelBox& range, const Cell& cell) {
  for (std::size_t axis = 0; axis < 3; ++axis)
    if (cell.lo[axis] < range.lo[axis] || cell.lo[axis] + cell.size > range.hi[axis]) return false;
  return true;
}

// A convex body contains a box if it contains its corners.
bool contains(const Obstacle& o, const Box& box) {
  for (unsigned corner = 0; corner < 8; ++corner) {
    const Eigen::Vector3d p((corner & 1U) != 0 ? box.hi.x() : box.lo.x(),
                            (corner & 2U) != 0 ? box.hi.y() : box.lo.y(),
                            (corner & 4U) != 0 ? box.hi.z() : box.lo.z());
    if (closest_on(o, o.pose, p).distance > 0.0) return false;
  }
  return true;
}

Eigen::Matrix3d random_rotation(Rng& rng) {
  // Uniform quaternions: K. Shoemake, Uniform random rotations, Graphics Gems III, 1992.
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
  Box box{vector_from(value.at("min_m")), vector_from(value.at("max_m"))};
  if (!(box.lo.array() < box.hi.array()).all())
    throw Error(ErrorCode::invalid,
                fmt::format("{}: min_m is not below max_m, expected it to be on each axis", where));
  return box;
}

}  // namespace

std::string_view to_string(Mark mark) noexcept {
  return mark == Mark::touch ? "touch" : "centre";
}

Mark mark_from(std::string_view name) {
  if (name == "touch") return Mark::touch;
  if (name == "centre") return Mark::centre;
  throw Error(ErrorCode::usage,
              fmt::format("mark '{}' is not known, expected touch or centre", name));
}

std::vector<Obstacle> make_clutter(const Clutter& clutter) {
  if (!(clutter.size_min_m > 0.0 && clutter.size_min_m <= clutter.size_max_m))
    throw Error(ErrorCode::invalid,
                fmt::format("clutter sizes {} to {} m, expected 0 < size_min_m <= size_max_m",
                            clutter.size_min_m, clutter.size_max_m));
  Rng rng(clutter.seed);
  const auto size = [&] { return rng.uniform(clutter.size_min_m, clutter.size_max_m); };
  std::vector<Obstacle> made;
  const std::size_t tries_max = 1000 * (clutter.count + 1);
  for (std::size_t tries = 0; made.size() < clutter.count; ++tries) {
    if (tries == tries_max)
      throw Error(
          ErrorCode::invalid,
          fmt::format(
              "clutter: only {} of {} primitives placed in {} tries, expected more room outside "
              "the keep-out balls",
              made.size(), clutter.count, tries_max));
    Obstacle o;
    o.name = fmt::format("clutter{}", made.size());
    o.shape = static_cast<Shape>(rng.below(3));
    // Every primitive draws the same random numbers for every shape.
    const double a = size(), b = size(), c = size();
    o.size_m = {a, b, c};
    o.radius_m = 0.5 * a;
    o.length_m = b;
    Eigen::Vector3d center;
    for (Eigen::Index axis = 0; axis < 3; ++axis)
      center[axis] = rng.uniform(clutter.bounds.lo[axis], clutter.bounds.hi[axis]);
    o.pose = {random_rotation(rng), center};
    const bool clear =
        std::all_of(clutter.keep_out.begin(), clutter.keep_out.end(), [&](const Ball& ball) {
          return closest_on(o, o.pose, ball.center).distance >= ball.radius;
        });
    if (clear) made.push_back(o);
  }
  return made;
}

bool touches(const Obstacle& primitive, const Box& cube) {
  const Eigen::Vector3d center = primitive.pose.p(), middle = 0.5 * (cube.lo + cube.hi),
                        half = 0.5 * (cube.hi - cube.lo);
  if (closest_on(primitive, primitive.pose, middle).distance > half.norm()) return false;
  // Alternating projections onto the two convex bodies converge to a nearest pair. If the bodies
  // are apart, the direction of the pair becomes the normal of a separating plane,
  // docs/theory.md (11.33). As long as no plane is found, they may touch.
  Eigen::Vector3d on_cube = middle;
  for (int round = 0; round < 100; ++round) {
    const SurfacePoint hit = closest_on(primitive, primitive.pose, on_cube);
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
    throw Error(ErrorCode::invalid,
                fmt::format("resolution {} m, expected 1e-5 to 0.5", resolution));
  std::vector<Obstacle> primitives = options.primitives;
  if (options.clutter) {
    const auto clutter = make_clutter(*options.clutter);
    primitives.insert(primitives.end(), clutter.begin(), clutter.end());
  }
  MakeReport report;
  report.primitives = primitives.size();
  VoxelBox free;
  if (options.free_bounds) free = voxel_range(*options.free_bounds, resolution, 0.5);
  std::vector<VoxelBox> ranges;
  for (const Obstacle& o : primitives) {
    check(o, fmt::format("primitive '{}'", o.name));
    const Eigen::Vector3d center = o.pose.p();
    Eigen::Vector3d reach;
    for (int axis = 0; axis < 3; ++axis) reach[axis] = half_extent(o, Eigen::Vector3d::Unit(axis));
    if (options.mark == Mark::touch) reach.array() += 0.5 * resolution;
    ranges.push_back(voxel_range({center - reach, center + reach}, resolution, 0.5));
  }
  // By rounding, a primitive may just touch a voxel, but not the wide cell around it: wide cells
  // are enlarged by this.
  const double margin = 1e-3 * resolution;
  // From wide cells to narrow ones, each with the primitives that may overlap it.
  std::vector<std::size_t> all(primitives.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  std::size_t examined = 0;
  const BtWriter writer(all, [&](const Cell& cell, const std::vector<std::size_t>& above,
                                 std::vector<std::size_t>& here) {
    if (++examined > examined_max)
      throw Error(ErrorCode::invalid,
                  fmt::format("more than {} cells to examine: the resolution {} m is too fine for "
                              "the primitives and free bounds",
                              examined_max, resolution));
    const Box cube = to_metres(cell, resolution);
    for (const std::size_t i : above) {
      const Obstacle& o = primitives[i];
      if (!overlaps(ranges[i], cell)) continue;
      if (cell.size == 1) {
        const bool marked = options.mark == Mark::touch
                                ? touches(o, cube)
                                : closest_on(o, o.pose, 0.5 * (cube.lo + cube.hi)).distance <= 0.0;
        if (marked) return BtNode::occupied;
      } else if (touches(o, {cube.lo.array() - margin, cube.hi.array() + margin})) {
        if (contains(ranges[i], cell) && contains(o, cube)) return BtNode::occupied;
        here.push_back(i);
      }
    }
    if (!here.empty()) return BtNode::parts;
    return !overlaps(free, cell)  ? BtNode::unknown
           : contains(free, cell) ? BtNode::free
                                  : BtNode::parts;
  });
  if (writer.nodes() == 0)
    throw Error(ErrorCode::invalid,
                "the map would be empty, expected primitives, clutter or free bounds");
  const std::string bytes =
      writer.file(resolution, fmt::format("made by hamelin from {} primitives", primitives.size()));
  write_file_atomically(options.output, bytes);
  report.output = options.output;
  report.sha256 = sha256_hex(bytes);
  report.bytes = bytes.size();
  report.nodes = writer.nodes();
  report.occupied_voxels = writer.occupied_voxels();
  report.free_voxels = writer.free_voxels();
  return report;
}

MakeMapOptions make_options_from_json(const Json& document, const std::string& where) {
  check_shipped_schema(document, "primitives", where);
  const auto given = [&](const char* key) {
    return document.contains(key) && !document[key].is_null();
  };
  MakeMapOptions options;
  options.resolution_m = document.at("resolution_m").get<double>();
  options.mark = mark_from(document.value("mark", "touch"));
  if (given("free_bounds_m"))
    options.free_bounds = box_from(document["free_bounds_m"], where + ": /free_bounds_m");
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
        clutter.keep_out.push_back(
            {vector_from(ball.at("center_m")), ball.at("radius_m").get<double>()});
    clutter.seed = from.value("seed", std::uint64_t{1});
    options.clutter = clutter;
  }
  return options;
}

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
