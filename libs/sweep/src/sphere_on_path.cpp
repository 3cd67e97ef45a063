#include "sphere_on_path.hpp"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <optional>

#include "hamelin/control/plan_paths.hpp"
#include "hamelin/core/numbers.hpp"
#include "hamelin/core/rng.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/sweep/judge.hpp"

namespace hamelin::sweep {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

// Depends on the seed and the name of the problem.
Rng random_of(std::uint64_t seed, const std::string& name) {
  constexpr std::size_t digits = 15;  // hexadecimal digits that fit into 64 bits
  return Rng(seed + std::stoull(sha256_hex(name).substr(0, digits), nullptr, 16));
}

// The moving balls of the arm, in random order.
std::vector<std::size_t> moving_balls(const JudgedArm& arm, Rng& rng) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < arm.balls().size(); ++k)
    if (arm.balls()[k].link >= 0) order.push_back(k);
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[rng.below(k)]);
  return order;
}

// Indices 0 … count − 1, the middle one first and the ends last.
std::vector<std::size_t> order_from_middle(std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto offset = [&](std::size_t i) { return 2 * i > count ? 2 * i - count : count - 2 * i; };
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return offset(a) < offset(b); });
  return order;
}

/// A place for the sphere.
struct Candidate {
  std::size_t node, ball;
  Vector3d center;
};

std::optional<Candidate> sphere_position(const JudgedArm& arm, const std::vector<VectorXd>& path,
                                         const std::vector<std::size_t>& order,
                                         const SphereOnPath& options) {
  std::vector<Vector3d> at_start, at_goal, centers;
  arm.place(path.front(), at_start);
  arm.place(path.back(), at_goal);
  const auto clear = [&](const std::vector<Vector3d>& balls, const Vector3d& center) {
    for (std::size_t k = 0; k < balls.size(); ++k)
      if ((balls[k] - center).norm() <
          arm.balls()[k].radius + options.radius_m + options.clearance_m)
        return false;
    return true;
  };
  for (const std::size_t i : order_from_middle(path.size())) {
    arm.place(path[i], centers);
    for (const std::size_t k : order)
      if (clear(at_start, centers[k]) && clear(at_goal, centers[k]))
        return Candidate{i, k, centers[k]};
  }
  return std::nullopt;
}

// The unit direction in which the sphere swings: the first drawn that leaves enough room, else the
// one that leaves most; none if the sphere hits a part of the arm that cannot evade it in any.
std::optional<Vector3d> swing_direction(const JudgedArm& arm, const std::vector<VectorXd>& path,
                                        const Candidate& place, const SphereOnPath& options,
                                        Rng& rng) {
  constexpr int draws = 60, last_rooted_link = 1, samples = 10;
  constexpr double room_m = 0.06;
  std::vector<Vector3d> before, after;
  arm.place(path[place.node > 0 ? place.node - 1 : 0], before);
  arm.place(path[std::min(place.node + 1, path.size() - 1)], after);
  const Vector3d way = after[place.ball] - before[place.ball];
  const auto room = [&](const Vector3d& direction) {
    double least = infinity;
    for (std::size_t k = 0; k < before.size(); ++k) {
      if (arm.balls()[k].link > last_rooted_link) continue;
      for (int i = -samples; i <= samples; ++i)
        least = std::min(
            least, (place.center + options.swing_m * i / samples * direction - before[k]).norm() -
                       arm.balls()[k].radius - options.radius_m);
    }
    return least;
  };
  Vector3d best = way.unitOrthogonal();
  double most = -infinity;
  for (int draw = 0; draw < draws && most < room_m; ++draw) {
    // one after another: the order in which arguments are evaluated depends on the compiler
    const double z = rng.uniform(-1.0, 1.0), y = rng.uniform(-1.0, 1.0), x = rng.uniform(-1.0, 1.0);
    Vector3d direction(x, y, z);
    direction -= direction.dot(way) / std::max(way.squaredNorm(), 1e-12) * way;
    if (direction.norm() < 0.1) continue;
    direction.normalize();
    if (const double left = room(direction); left > most) {
      most = left;
      best = direction;
    }
  }
  if (most < 0.0) return std::nullopt;
  return best;
}

// Many configurations along a polyline.
std::vector<VectorXd> nodes_on(const Eigen::MatrixXd& points) {
  constexpr double step_rad = 0.005;
  std::vector<VectorXd> nodes;
  for (Eigen::Index i = 0; i + 1 < points.cols(); ++i) {
    const VectorXd line = points.col(i + 1) - points.col(i);
    const double steps = std::ceil(line.lpNorm<Eigen::Infinity>() / step_rad);
    for (double k = 0.0; k < steps; ++k) nodes.emplace_back(points.col(i) + k / steps * line);
  }
  nodes.emplace_back(points.rightCols(1));
  return nodes;
}

}  // namespace

// docs/theory.md (13.26)
std::vector<VectorXd> thin_path(const std::vector<VectorXd>& nodes, double spacing) {
  std::vector<VectorXd> kept;
  for (std::size_t i = 0; i < nodes.size();) {
    kept.push_back(nodes[i]);
    if (i + 1 == nodes.size()) break;
    std::size_t next = nodes.size() - 1;
    while (next > i + 1 && (nodes[next] - nodes[i]).lpNorm<Eigen::Infinity>() > spacing) --next;
    i = next;
  }
  return kept;
}

PathWithSphere place_sphere_on_path(const std::filesystem::path& scene_file,
                                    const SphereOnPath& options) {
  scene::Scene scene = scene::read_scene(scene_file);
  PathWithSphere found;
  if (const auto feasible = feasibility(scene, {}); !feasible.feasible) {
    found.reason = feasible.reason;
    return found;
  }
  scene.guide.type = scene::GuideType::rrt_connect;
  scene.seed = options.seed;
  const control::PathPlan plan = control::plan_paths(scene);
  if (!plan.found()) {
    found.reason = "no path: " + plan.goals.back().path.cause;
    return found;
  }
  const auto nodes = nodes_on(plan.goals.front().path.points);
  found.path = thin_path(nodes, options.spacing_rad);
  const JudgedArm arm(scene);
  Rng rng = random_of(options.seed, scene_file.stem().string());
  const auto place = sphere_position(arm, found.path, moving_balls(arm, rng), options);
  if (!place) {
    found.reason = fmt::format("no position on the path leaves start and goal a clearance of {} m",
                               options.clearance_m);
  } else {
    found.center = place->center;
    if (options.swing_m > 0.0) {
      const auto direction = swing_direction(arm, found.path, *place, options, rng);
      if (direction)
        found.swing = options.swing_m * *direction;
      else
        found.reason = "the sphere would hit the foot of the arm in all directions";
    }
  }
  found.path.erase(found.path.begin());  // the start is not a waypoint
  return found;
}

}  // namespace hamelin::sweep
