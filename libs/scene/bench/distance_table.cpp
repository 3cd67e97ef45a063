// Prints, for one map and one crop, the cost of building the structure, of queries and of changes,
// beside FCL's octree and dynamicEDT3D where they are installed, and the largest errors against
// brute force: over all leaf boxes outside, over the surrounding voxels inside. All with the same
// points in the same run. `--points 100000 --capsules 10000` is the long comparison.
#include <fmt/format.h>
#include <octomap/OcTree.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <chrono>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <memory>
#include <optional>
#include <string>
#include <vector>
#ifdef HAMELIN_WITH_FCL
#include <fcl/geometry/octree/octree.h>
#include <fcl/narrowphase/distance.h>
#endif
#ifdef HAMELIN_WITH_EDT
#include <dynamicEDT3D/dynamicEDTOctomap.h>
#endif

#include "hamelin/core/error.hpp"
#include "hamelin/core/isa.hpp"
#include "hamelin/scene/map_field.hpp"
#include "hamelin/scene/map_file.hpp"
#include "hamelin/test/scene_queries.hpp"

namespace {

using namespace hamelin;
using namespace hamelin::scene;
using Eigen::Vector3d;
using Clock = std::chrono::steady_clock;

constexpr double infinity = std::numeric_limits<double>::infinity();
constexpr int passes = 15;

double seconds_since(Clock::time_point start) {
  return std::chrono::duration<double>(Clock::now() - start).count();
}

// The best of several runs [ms].
template <class F>
double least_ms(const F& f) {
  double best = infinity;
  for (int pass = 0; pass < 5; ++pass) {
    const auto start = Clock::now();
    f();
    best = std::min(best, 1e3 * seconds_since(start));
  }
  return best;
}

struct Segment {
  Vector3d a, b;
};

// ---- brute force ----

// The occupied voxels of a crop, one bit each; all others are free.
class Voxels {
 public:
  Voxels(const std::vector<Cell>& cells, double resolution) : resolution_(resolution) {
    lo_.fill(std::numeric_limits<std::int32_t>::max());
    std::array<std::int32_t, 3> hi{};
    hi.fill(std::numeric_limits<std::int32_t>::min());
    for (const Cell& cell : cells)
      for (std::size_t i = 0; i < 3; ++i) {
        lo_[i] = std::min(lo_[i], cell.lo[i]);
        hi[i] = std::max(hi[i], cell.lo[i] + cell.size);
      }
    for (std::size_t i = 0; i < 3; ++i) size_[i] = static_cast<std::size_t>(hi[i] - lo_[i]);
    bits_.resize(size_[0] * size_[1] * size_[2]);
    for (const Cell& cell : cells)
      for (std::int32_t x = cell.lo[0]; x < cell.lo[0] + cell.size; ++x)
        for (std::int32_t y = cell.lo[1]; y < cell.lo[1] + cell.size; ++y)
          for (std::int32_t z = cell.lo[2]; z < cell.lo[2] + cell.size; ++z)
            bits_[index(x, y, z)] = true;
  }

  // Distance to the nearest free voxel, by rings of voxels around that of p. The search ends once
  // it is at most `enough`.
  [[nodiscard]] double depth(const Vector3d& p, double enough = -1.0) const {
    std::array<std::int32_t, 3> at{};
    for (std::size_t i = 0; i < 3; ++i)
      at[i] = static_cast<std::int32_t>(std::floor(p[static_cast<Eigen::Index>(i)] / resolution_));
    double best = infinity;
    for (std::int32_t ring = 0; (ring - 1) * resolution_ < best && best > enough; ++ring)
      for (std::int32_t x = -ring; x <= ring; ++x)
        for (std::int32_t y = -ring; y <= ring; ++y) {
          const bool face = std::abs(x) == ring || std::abs(y) == ring;
          for (std::int32_t z = -ring; z <= ring; z += face || ring == 0 ? 1 : 2 * ring) {
            if (occupied(at[0] + x, at[1] + y, at[2] + z)) continue;
            const Box box = to_metres(Cell{{at[0] + x, at[1] + y, at[2] + z}, 1}, resolution_);
            best = std::min(best, (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).norm());
          }
        }
    return best;
  }

 private:
  [[nodiscard]] std::size_t index(std::int32_t x, std::int32_t y, std::int32_t z) const {
    return (static_cast<std::size_t>(x - lo_[0]) * size_[1] +
            static_cast<std::size_t>(y - lo_[1])) *
               size_[2] +
           static_cast<std::size_t>(z - lo_[2]);
  }
  [[nodiscard]] bool occupied(std::int32_t x, std::int32_t y, std::int32_t z) const {
    const std::array<std::int32_t, 3> at{x, y, z};
    for (std::size_t i = 0; i < 3; ++i)
      if (at[i] < lo_[i] || static_cast<std::size_t>(at[i] - lo_[i]) >= size_[i]) return false;
    return bits_[index(x, y, z)];
  }

  double resolution_;
  std::array<std::int32_t, 3> lo_{};
  std::array<std::size_t, 3> size_{};
  std::vector<bool> bits_;
};

// Distance of a segment from a union of boxes, by golden section on the convex distance from each.
double brute_force_distance(const std::vector<Box>& leaves, const Segment& c) {
  const double half = 0.5 * (c.b - c.a).norm();
  const auto distance = [&](const Box& box, double t) {
    const Vector3d p = c.a + t * (c.b - c.a);
    return (box.lo - p).cwiseMax(p - box.hi).cwiseMax(0.0).squaredNorm();
  };
  double best = infinity;
  for (const Box& box : leaves) {
    if (std::sqrt(distance(box, 0.5)) - half > std::sqrt(best)) continue;
    double left = 0.0, right = 1.0;
    for (int k = 0; k < 70; ++k) {
      const double x = left + 0.381966 * (right - left), y = left + 0.618034 * (right - left);
      (distance(box, x) < distance(box, y) ? right : left) =
          distance(box, x) < distance(box, y) ? y : x;
    }
    best = std::min({best, distance(box, left), distance(box, 0.0), distance(box, 1.0)});
  }
  return std::sqrt(best);
}

struct Errors {
  double outside = 0.0, inside = 0.0;
  std::size_t n_outside = 0, n_inside = 0;
};

Errors point_errors(const MapField& field, const std::vector<Box>& leaves, const Voxels& voxels,
                    const std::vector<Vector3d>& points) {
  Errors errors;
  for (const Vector3d& p : points) {
    BoxHit hit;
    if (!field.nearest(p, infinity, hit))
      throw Error(ErrorCode::invalid, "no nearest box of a point, expected one");
    const double truth = test::brute_force_distance(leaves, p);
    const bool inside = truth == 0.0;
    double& worst = inside ? errors.inside : errors.outside;
    worst = std::max(worst, std::abs(hit.distance - (inside ? -voxels.depth(p) : truth)));
    ++(inside ? errors.n_inside : errors.n_outside);
  }
  return errors;
}

Errors capsule_errors(const MapField& field, const std::vector<Box>& leaves, const Voxels& voxels,
                      const std::vector<Segment>& capsules) {
  Errors errors;
  for (const Segment& c : capsules) {
    SegmentHit hit;
    if (!field.nearest(c.a, c.b, infinity, hit))
      throw Error(ErrorCode::invalid, "no nearest box of a capsule, expected one");
    if (hit.distance > 0.0) {
      ++errors.n_outside;
      errors.outside =
          std::max(errors.outside, std::abs(hit.distance - brute_force_distance(leaves, c)));
      continue;
    }
    ++errors.n_inside;
    // the depth is that of the axis point, and no other point of the axis is deeper
    errors.inside = std::max(errors.inside, std::abs(-hit.distance - voxels.depth(hit.axis_point)));
    for (int k = 0; k <= 100; ++k)
      errors.inside = std::max(
          errors.inside, voxels.depth(c.a + 0.01 * k * (c.b - c.a), -hit.distance) + hit.distance);
  }
  return errors;
}

// ---- output ----

// The best of several passes over all queries [ns].
template <class Query>
double least_ns(std::size_t count, const Query& query) {
  double best = infinity;
  for (int pass = 0; pass < passes; ++pass) {
    const auto start = Clock::now();
    for (std::size_t i = 0; i < count; ++i) query(i);
    best = std::min(best, 1e9 * seconds_since(start) / static_cast<double>(count));
  }
  return best;
}

// One row: cost, and the largest errors to the unsafe (over) and to the safe side (under).
template <class Query>
void row(const std::string& method, double build_ms, const std::vector<Vector3d>& points,
         const std::vector<double>& truth, const Query& query) {
  std::vector<double> answers(truth.size());
  const double ns = least_ns(points.size(), [&](std::size_t i) { answers[i] = query(i); });
  double over = 0.0, under = 0.0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    over = std::max(over, std::max(answers[i], 0.0) - truth[i]);
    under = std::max(under, truth[i] - std::max(answers[i], 0.0));
  }
  fmt::print("{:<34} {:>10.2f} {:>12.0f} {:>12.2g} {:>12.2g}\n", method, build_ms, ns, 1e3 * over,
             1e3 * under);
}

void print_changes(const MapField& made, const std::vector<Cell>& cells, double resolution,
                   const Ball& region) {
  Rng rng(7);
  const auto timed = [&](const char* name, const auto& make) {
    MapField field(cells, resolution, region.center);
    double ms = 0.0;
    std::size_t voxels = 0;
    constexpr int rounds = 20;
    for (int round = 0; round < rounds; ++round) {
      const std::vector<VoxelBox> boxes = make();
      const bool add = round % 2 == 0;
      const auto start = Clock::now();
      const MapField::Changed changed = add ? field.change(boxes, {}) : field.change({}, boxes);
      ms += 1e3 * seconds_since(start);
      voxels += changed.added + changed.removed;
    }
    fmt::print("{:<34} {:>10.3f} ms per change of {:.0f} voxels, {:.3f} ms per 1000\n", name,
               ms / rounds, static_cast<double>(voxels) / rounds,
               1e3 * ms / static_cast<double>(voxels));
  };
  const auto voxel_of = [&](const Vector3d& p) {
    std::array<std::int32_t, 3> v{};
    for (std::size_t i = 0; i < 3; ++i)
      v[i] = static_cast<std::int32_t>(std::floor(p[static_cast<Eigen::Index>(i)] / resolution));
    return v;
  };
  const auto near_box = [&] {
    return made.boxes().boxes()[rng.below(made.boxes().boxes().size())];
  };
  timed("change: a cube of 10 x 10 x 10", [&] {
    const auto lo = voxel_of(near_box().lo);
    return std::vector<VoxelBox>{
        {{lo[0] - 5, lo[1] - 5, lo[2] - 5}, {lo[0] + 5, lo[1] + 5, lo[2] + 5}}};
  });
  timed("change: 1000 scattered voxels", [&] {
    std::vector<Cell> scattered;
    for (int i = 0; i < 1000; ++i)
      scattered.push_back(
          {voxel_of(region.center + region.radius * rng.uniform() * test::random_direction(rng)),
           1});
    return merge(scattered);
  });
}

struct Command {
  std::string file;
  Ball region;
  double scale = 1.0;
  std::size_t points = 4000, capsules = 1000;
};

std::optional<Command> command_of(int argc, char** argv) {
  std::vector<std::string> words;
  Command command;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    const auto value = [&] { return i + 1 < argc ? std::atof(argv[++i]) : 0.0; };
    if (word == "--scale")
      command.scale = value();
    else if (word == "--points")
      command.points = static_cast<std::size_t>(value());
    else if (word == "--capsules")
      command.capsules = static_cast<std::size_t>(value());
    else
      words.push_back(word);
  }
  if (words.size() != 5) return std::nullopt;
  command.file = words[0];
  command.region = {{std::stod(words[1]), std::stod(words[2]), std::stod(words[3])},
                    std::stod(words[4])};
  return command;
}

// The cropped map and the cost of building it.
struct Part {
  explicit Part(const Command& command) : region(command.region) {
    const auto start = Clock::now();
    map = read_map(command.file, {command.scale, 0.5});
    const double read_ms = 1e3 * seconds_since(start);
    crop_ms = least_ms([&] { cells = crop(map.occupied, map.resolution, region); });
    build_ms = least_ms([&] { field = MapField(cells, map.resolution, region.center); });
    if (field.empty())
      throw Error(ErrorCode::invalid,
                  fmt::format("{}: no occupied leaf in that ball", command.file));
    for (const Cell& cell : cells) leaves.push_back(to_metres(cell, map.resolution));
    fmt::print("{}: resolution {} m, {} leaves, {} in the ball, {} boxes; instruction set {}\n",
               command.file, map.resolution, map.occupied.size(), leaves.size(),
               field.boxes().boxes().size(), name_of(default_isa()));
    fmt::print("read {:.1f} ms, crop {:.2f} ms, merge and build {:.2f} ms, {:.0f} kB\n", read_ms,
               crop_ms, build_ms, 1e-3 * static_cast<double>(field.bytes()));
  }

  Ball region;
  MapData map;
  std::vector<Cell> cells;
  MapField field;
  std::vector<Box> leaves;
  double crop_ms = 0.0, build_ms = 0.0;
};

// The queries, with exact distances of the points, and the same queries shifted by 2 mm.
struct Queries {
  explicit Queries(const Part& part) {
    for (const Vector3d& p : test::points_near(part.leaves, 6000, 0.5, 1))
      (test::brute_force_distance(part.leaves, p) > 0.0 ? points : inside).push_back(p);
    Rng rng(2);
    for (const Vector3d& p : points) {
      truth.push_back(test::brute_force_distance(part.leaves, p));
      const Vector3d shift = 0.002 * test::random_direction(rng);
      moved.push_back(p + shift);
      truth_moved.push_back(test::brute_force_distance(part.leaves, moved.back()));
      const Vector3d end = p + rng.uniform(0.05, 0.4) * test::random_direction(rng);
      SegmentHit hit;
      const bool entered = part.field.nearest(p, end, infinity, hit) && hit.distance <= 0.0;
      (entered ? capsules_inside : capsules).push_back({p, end});
      if (!entered) capsules_moved.push_back({p + shift, end + shift});
    }
  }

  std::vector<Vector3d> points, moved, inside;
  std::vector<double> truth, truth_moved;
  std::vector<Segment> capsules, capsules_moved, capsules_inside;
};

void line(const char* name, double ns) {
  fmt::print("{:<34} {:>10} {:>12.0f}\n", name, "", ns);
}

void print_points(const Part& part, const Queries& queries) {
  const MapField& field = part.field;
  const auto& points = queries.points;
  const double made_ms = part.crop_ms + part.build_ms;
  BoxHit hit;
  row("hamelin, cold", made_ms, points, queries.truth, [&](std::size_t i) {
    return field.nearest(points[i], infinity, hit) ? hit.distance : infinity;
  });
  std::vector<std::int32_t> hints;
  for (const Vector3d& p : points) hints.push_back(field.nearest(p, infinity, hit) ? hit.box : -1);
  const auto& moved = queries.moved;
  row("hamelin, warm (2 mm farther)", made_ms, moved, queries.truth_moved, [&](std::size_t i) {
    return field.nearest(moved[i], infinity, hit, hints[i]) ? hit.distance : infinity;
  });
  MapField::Scratch scratch(field);
  std::array<BoxHit, MapField::points_max> hits;
  line("hamelin, 3 points within 0.1 m", least_ns(points.size(), [&](std::size_t i) {
         (void)field.nearest_distinct(points[i], 0.1, scratch, hits);
       }));
  line("hamelin, 3 points within 0.25 m", least_ns(points.size(), [&](std::size_t i) {
         (void)field.nearest_distinct(points[i], 0.25, scratch, hits);
       }));
  line("hamelin, depth of a point", least_ns(queries.inside.size(), [&](std::size_t i) {
         (void)field.nearest(queries.inside[i], infinity, hit);
       }));
  // 40 spheres at a time, each 2 mm from the position of its hint
  std::vector<double> ticks;
  for (int pass = 0; pass < passes; ++pass)
    for (std::size_t first = 0; first + 40 <= moved.size(); first += 40) {
      const auto start = Clock::now();
      for (std::size_t i = first; i < first + 40; ++i)
        (void)field.nearest(moved[i], infinity, hit, hints[i]);
      ticks.push_back(1e6 * seconds_since(start));
    }
  std::sort(ticks.begin(), ticks.end());
  fmt::print("{:<34} {:>10} p50 {:.1f} us, p99 {:.1f} us\n", "hamelin, 40 spheres, warm", "",
             ticks[ticks.size() / 2], ticks[ticks.size() * 99 / 100]);
}

void print_capsules(const MapField& field, const Queries& queries) {
  const auto& capsules = queries.capsules;
  SegmentHit hit;
  std::vector<std::int32_t> hints;
  for (const Segment& c : capsules)
    hints.push_back(field.nearest(c.a, c.b, infinity, hit) ? hit.box : -1);
  line("hamelin, capsule, cold", least_ns(capsules.size(), [&](std::size_t i) {
         (void)field.nearest(capsules[i].a, capsules[i].b, infinity, hit);
       }));
  const auto& moved = queries.capsules_moved;
  line("hamelin, capsule, warm", least_ns(moved.size(), [&](std::size_t i) {
         (void)field.nearest(moved[i].a, moved[i].b, infinity, hit, hints[i]);
       }));
  MapField::Scratch scratch(field);
  std::array<SegmentHit, MapField::points_max> hits;
  line("hamelin, capsule, 3 within 0.1 m", least_ns(capsules.size(), [&](std::size_t i) {
         (void)field.nearest_distinct(capsules[i].a, capsules[i].b, 0.1, scratch, hits);
       }));
  const auto& inside = queries.capsules_inside;
  line("hamelin, depth of a capsule", least_ns(inside.size(), [&](std::size_t i) {
         (void)field.nearest(inside[i].a, inside[i].b, infinity, hit);
       }));
}

// The cropped map as an OctoMap tree.
std::shared_ptr<octomap::OcTree> tree_of(const Part& part) {
  auto tree = std::make_shared<octomap::OcTree>(part.map.resolution);
  const auto key = [](std::int32_t i) { return static_cast<octomap::key_type>(i + (1 << 15)); };
  for (const Cell& cell : part.cells)
    for (std::int32_t x = 0; x < cell.size; ++x)
      for (std::int32_t y = 0; y < cell.size; ++y)
        for (std::int32_t z = 0; z < cell.size; ++z)
          tree->setNodeValue(
              octomap::OcTreeKey(key(cell.lo[0] + x), key(cell.lo[1] + y), key(cell.lo[2] + z)),
              3.5F, true);
  tree->updateInnerOccupancy();
  tree->prune();
  return tree;
}

#ifdef HAMELIN_WITH_FCL
void print_fcl(const std::shared_ptr<octomap::OcTree>& tree, const Queries& queries) {
  const fcl::OcTreed octree(tree);
  const double radius = 1e-3;
  const fcl::Sphered sphere(radius);
  const auto distance = [&](const auto& shape, const fcl::Transform3d& pose) {
    const fcl::DistanceRequestd request;
    fcl::DistanceResultd result;
    fcl::distance(&octree, fcl::Transform3d::Identity(), &shape, pose, request, result);
    return result.min_distance > 0.0 ? result.min_distance + radius : 0.0;
  };
  const std::vector<Vector3d> few(queries.points.begin(), queries.points.begin() + 100);
  const std::vector<double> truth(queries.truth.begin(), queries.truth.begin() + 100);
  row("FCL octree and sphere of 1 mm", 0.0, few, truth, [&](std::size_t i) {
    fcl::Transform3d pose = fcl::Transform3d::Identity();
    pose.translation() = few[i];
    return distance(sphere, pose);
  });
  line("FCL octree and capsule", least_ns(20, [&](std::size_t i) {
         const Segment& c = queries.capsules[i];
         const Vector3d axis = c.b - c.a;
         fcl::Transform3d pose = fcl::Transform3d::Identity();
         pose.translation() = 0.5 * (c.a + c.b);
         pose.linear() =
             Eigen::Quaterniond::FromTwoVectors(Vector3d::UnitZ(), axis).toRotationMatrix();
         (void)distance(fcl::Capsuled(radius, axis.norm()), pose);
       }));
}
#else
void print_fcl(const std::shared_ptr<octomap::OcTree>&, const Queries&) {
  fmt::print("FCL was not found when this program was built\n");
}
#endif

#ifdef HAMELIN_WITH_EDT
void print_edt(const std::shared_ptr<octomap::OcTree>& tree, const Ball& region,
               const Queries& queries) {
  const auto start = Clock::now();
  const Vector3d lo = region.center.array() - region.radius - 0.5,
                 hi = region.center.array() + region.radius + 0.5;
  const auto point = [](const Vector3d& p) {
    return octomap::point3d(static_cast<float>(p.x()), static_cast<float>(p.y()),
                            static_cast<float>(p.z()));
  };
  DynamicEDTOctomap edt(1.0F, tree.get(), point(lo), point(hi), false);
  edt.update();
  // Its largest distance is one metre, which covers the points.
  row("dynamicEDT3D", 1e3 * seconds_since(start), queries.points, queries.truth,
      [&](std::size_t i) {
        return static_cast<double>(edt.getDistance(point(queries.points[i])));
      });
}
#else
void print_edt(const std::shared_ptr<octomap::OcTree>&, const Ball&, const Queries&) {
  fmt::print("dynamicEDT3D was not found when this program was built\n");
}
#endif

void print_errors(const Part& part, const Command& command) {
  const auto print = [](const char* name, const Errors& errors) {
    fmt::print("{:<34} largest error outside {:.2g} m ({}), inside {:.2g} m ({})\n", name,
               errors.outside, errors.n_outside, errors.inside, errors.n_inside);
  };
  const Voxels voxels(part.cells, part.map.resolution);
  print("brute force, points",
        point_errors(part.field, part.leaves, voxels,
                     test::points_near(part.leaves, command.points, 0.5, 3)));
  Rng rng(2);
  std::vector<Segment> capsules;
  for (const Vector3d& p : test::points_near(part.leaves, command.capsules, 0.5, 4))
    capsules.push_back({p, p + rng.uniform(0.05, 0.4) * test::random_direction(rng)});
  print("brute force, capsules", capsule_errors(part.field, part.leaves, voxels, capsules));
}

int run(int argc, char** argv) {
  const auto command = command_of(argc, argv);
  if (!command) {
    fmt::print(stderr,
               "usage: {} MAP X Y Z RADIUS [--scale S] [--points N] [--capsules N]   (crop in the "
               "map's frame, m)\n"
               "example: {} map.bt 0.5 0 1 1.35\n",
               argv[0], argv[0]);
    return 2;
  }
  const Part part(*command);
  const Queries queries(part);
  fmt::print("{:<34} {:>10} {:>12} {:>12} {:>12}\n", "method", "build ms", "ns per query",
             "over mm", "under mm");
  print_points(part, queries);
  print_capsules(part.field, queries);
  print_changes(part.field, part.cells, part.map.resolution, part.region);
  const auto tree = tree_of(part);
  print_fcl(tree, queries);
  print_edt(tree, part.region, queries);
  print_errors(part, *command);
  return 0;
}

}  // namespace

int main(int argc, char** argv) {
  try {
    return run(argc, argv);
  } catch (const std::exception& e) {
    fmt::print(stderr, "{}\n", e.what());
    return 2;
  }
}
