#include "sphere_on_path.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <numeric>
#include <optional>

#include "hamelin/core/rng.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/judge.hpp"

namespace hamelin::sweep {

namespace {

using Eigen::Vector3d;
using Eigen::VectorXd;

// The balls of the arm that move, in an order that differs from problem to problem.
std::vector<std::size_t> moving_balls(const JudgedArm& arm, std::uint64_t seed, const std::string& name) {
  std::vector<std::size_t> order;
  for (std::size_t k = 0; k < arm.balls().size(); ++k)
    if (arm.balls()[k].link >= 0) order.push_back(k);
  constexpr std::size_t digits = 15;  // what fits into 64 bits
  Rng rng(seed + std::stoull(sha256_hex(name).substr(0, digits), nullptr, 16));
  for (std::size_t k = order.size(); k > 1; --k) std::swap(order[k - 1], order[rng.below(k)]);
  return order;
}

// Indices 0 … count − 1, the middle one first and the ends last.
std::vector<std::size_t> from_the_middle(std::size_t count) {
  std::vector<std::size_t> order(count);
  std::iota(order.begin(), order.end(), std::size_t{0});
  const auto off = [&](std::size_t i) { return 2 * i > count ? 2 * i - count : count - 2 * i; };
  std::stable_sort(order.begin(), order.end(), [&](std::size_t a, std::size_t b) { return off(a) < off(b); });
  return order;
}

std::optional<Vector3d> place_for_sphere(const JudgedArm& arm, const std::vector<VectorXd>& path,
                                         const std::vector<std::size_t>& order, const SphereOnPath& wanted) {
  std::vector<Vector3d> at_start, at_goal, centers;
  arm.place(path.front(), at_start);
  arm.place(path.back(), at_goal);
  const auto clear = [&](const std::vector<Vector3d>& balls, const Vector3d& center) {
    for (std::size_t k = 0; k < balls.size(); ++k)
      if ((balls[k] - center).norm() < arm.balls()[k].radius + wanted.radius_m + wanted.clearance_m) return false;
    return true;
  };
  for (const std::size_t i : from_the_middle(path.size())) {
    arm.place(path[i], centers);
    for (const std::size_t k : order)
      if (clear(at_start, centers[k]) && clear(at_goal, centers[k])) return centers[k];
  }
  return std::nullopt;
}

}  // namespace

std::vector<VectorXd> thinned(const std::vector<VectorXd>& nodes, double spacing) {
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

PathWithSphere put_sphere_on_path(const std::filesystem::path& scene_file, const SphereOnPath& wanted,
                                  const std::vector<std::filesystem::path>& plugin_directories) {
  scene::Scene scene = scene::read_scene(scene_file);
  PathWithSphere found;
  if (const auto feasible = feasibility(scene, {}); !feasible.feasible) {
    found.reason = feasible.reason;
    return found;
  }
  scene.planner = scene::Choice{"hybrid", {{"escape", "tree"}}};
  scene.seed = wanted.seed;
  std::vector<VectorXd> nodes;
  simulation::Watch watch;
  watch.at_node = [&nodes](double, const VectorXd& q) { nodes.push_back(q); };
  const log::Result result = simulation::run(scene, plugin_directories, watch);
  if (result.outcome != log::Outcome::reached) {
    found.reason = fmt::format("hybrid finds no path: {}{}", log::to_string(result.outcome),
                               result.cause.empty() ? "" : ", " + result.cause);
    return found;
  }
  nodes.push_back(scene.goals.front().q);
  found.path = thinned(nodes, wanted.spacing_rad);
  const JudgedArm arm(scene);
  const auto order = moving_balls(arm, wanted.seed, scene_file.stem().string());
  const auto center = place_for_sphere(arm, found.path, order, wanted);
  if (!center)
    found.reason = fmt::format("no place on the path keeps start and goal {} m clear", wanted.clearance_m);
  else
    found.center = *center;
  found.path.erase(found.path.begin());  // the arm is there
  return found;
}

}  // namespace hamelin::sweep
