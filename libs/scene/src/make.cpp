#include "hamelin/scene/make.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numeric>

#include "bt_writer.hpp"
#include "hamelin/core/error.hpp"
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

// Tells which cells of a map the primitives mark.
class Marker {
 public:
  Marker(const MakeMapOptions& options, const std::vector<Obstacle>& primitives)
      : options_(options), primitives_(primitives) {
    const double resolution = options.resolution_m;
    if (options.free_bounds) free_ = voxel_range(*options.free_bounds, resolution, 0.5);
    for (const Obstacle& o : primitives) {
      check(o, fmt::format("primitive '{}'", o.name));
      const Eigen::Vector3d center = o.pose.p();
      Eigen::Vector3d reach;
      for (int axis = 0; axis < 3; ++axis)
        reach[axis] = half_extent(o, Eigen::Vector3d::Unit(axis));
      if (options.mark == Mark::touch) reach.array() += 0.5 * resolution;
      ranges_.push_back(voxel_range({center - reach, center + reach}, resolution, 0.5));
    }
  }

  // @param above the primitives that may overlap the cell
  // @param here receives those that do
  BtNode state_of(const Cell& cell, const std::vector<std::size_t>& above,
                  std::vector<std::size_t>& here) {
    if (++examined_ > examined_max)
      throw Error(ErrorCode::invalid,
                  fmt::format("more than {} cells to examine: the resolution {} m is too fine for "
                              "the primitives and free bounds",
                              examined_max, options_.resolution_m));
    const Box cube = to_metres(cell, options_.resolution_m);
    // By rounding, a primitive may just touch a voxel, but not the wide cell around it: wide cells
    // are enlarged by this.
    const double margin = 1e-3 * options_.resolution_m;
    for (const std::size_t i : above) {
      const Obstacle& o = primitives_[i];
      if (!overlaps(ranges_[i], cell)) continue;
      if (cell.size == 1) {
        const bool marked = options_.mark == Mark::touch
                                ? touches(o, cube)
                                : closest_on(o, o.pose, 0.5 * (cube.lo + cube.hi)).distance <= 0.0;
        if (marked) return BtNode::occupied;
      } else if (touches(o, {cube.lo.array() - margin, cube.hi.array() + margin})) {
        if (contains(ranges_[i], cell) && contains(o, cube)) return BtNode::occupied;
        here.push_back(i);
      }
    }
    if (!here.empty()) return BtNode::parts;
    return !overlaps(free_, cell)  ? BtNode::unknown
           : contains(free_, cell) ? BtNode::free
                                   : BtNode::parts;
  }

 private:
  const MakeMapOptions& options_;
  const std::vector<Obstacle>& primitives_;
  VoxelBox free_;
  std::vector<VoxelBox> ranges_;
  std::size_t examined_ = 0;
};

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
  Marker marker(options, primitives);
  // From wide cells to narrow ones, each with the primitives that may overlap it.
  std::vector<std::size_t> all(primitives.size());
  std::iota(all.begin(), all.end(), std::size_t{0});
  const BtWriter writer(
      all, [&](const Cell& cell, const std::vector<std::size_t>& above,
               std::vector<std::size_t>& here) { return marker.state_of(cell, above, here); });
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

}  // namespace hamelin::scene
