#include "hamelin/bench/draw.hpp"

#include <fmt/format.h>

#include <cmath>
#include <optional>

#include "hamelin/bench/families.hpp"
#include "hamelin/control/plan_paths.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/control/world_view.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/dynamics/dynamics.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/scene/make.hpp"
#include "hamelin/sweep/judge.hpp"
#include "sampler.hpp"

namespace hamelin::bench {

namespace fs = std::filesystem;
using Eigen::MatrixXd;
using Eigen::VectorXd;

namespace {

/// The verdict of the judge on a path of straight lines.
sweep::Verdict judge(const scene::Scene& scene, const MatrixXd& path) {
  sweep::Judge judge(scene);
  for (Eigen::Index i = 0; i < path.cols(); ++i)
    judge.add_node(static_cast<double>(i), path.col(i));
  return judge.verdict();
}

class Drawer {
 public:
  explicit Drawer(const DrawOptions& options) : options_(options) {}

  /// A candidate of a family, or none if it is not taken.
  std::optional<Problem> candidate(const std::string& family, std::uint64_t seed,
                                   DrawCounts& counts) {
    ++counts.candidates;
    Problem problem;
    problem.family = family;
    problem.seed = seed;
    scene::Scene scene = make_scene(problem);
    const model::Model arm = control::load_model(scene);
    const auto ends = draw_ends(scene, arm, make_layout(family, seed), seed);
    if (!ends) {
      ++counts.no_start_or_goal;
      return std::nullopt;
    }
    if (!judge(scene, *ends).contact()) {
      ++counts.straight_is_free;
      return std::nullopt;
    }
    problem.path = *ends;
    scene = make_scene(problem);
    const auto path = search(scene, arm);
    if (!path) {
      ++counts.path_unknown;
      return std::nullopt;
    }
    problem.path = *path;
    problem.sha256 = sha256_hex(problem_text(problem));
    problem.map_sha256 = sha256_of_file(scene.map->file);
    return problem;
  }

 private:
  /// The scene of a problem that may still lack its start and goal.
  [[nodiscard]] scene::Scene make_scene(Problem problem) const {
    if (problem.path.size() == 0) problem.path = MatrixXd::Zero(dof(), 2);
    const fs::path file = options_.scratch / "problem.json";
    write_file_atomically(file, problem_text(problem));
    scene::ProblemOptions of_problem;
    of_problem.robot = options_.robot.robot;
    of_problem.spheres = options_.robot.spheres;
    of_problem.tip = options_.robot.tip;
    of_problem.resolution_m = options_.resolution_m;
    of_problem.output = options_.scratch / "scene.json";
    scene::make_scene_from_problem(file, of_problem);
    scene::Scene scene = scene::read_scene(of_problem.output);
    scene.guide.type = scene::GuideType::rrt_connect;
    return scene;
  }

  [[nodiscard]] int dof() const {
    if (dof_ == 0) {
      description::RobotOptions of_robot;
      if (!options_.robot.tip.empty()) of_robot.tip = options_.robot.tip;
      if (!options_.robot.spheres.empty()) of_robot.spheres = options_.robot.spheres;
      dof_ = static_cast<int>(description::read_robot(options_.robot.robot, of_robot).links.size());
    }
    return dof_;
  }

  /// Start and goal as columns.
  [[nodiscard]] std::optional<MatrixXd> draw_ends(const scene::Scene& scene,
                                                  const model::Model& arm, const Layout& layout,
                                                  std::uint64_t seed) const {
    control::WorldView view(scene, arm, 2.0 * options_.clearance_m);
    Sampler sampler(arm, options_, seed);
    const auto draw_in = [&](const Room& room) {
      return sampler.draw(view, [&](const dynamics::Workspace& ws) {
        return room.contains(dynamics::tip_pose(arm, ws).p());
      });
    };
    const auto start = draw_in(layout.start);
    if (!start) return std::nullopt;
    const auto goal = draw_in(layout.goal);
    if (!goal || (*goal - *start).norm() < options_.min_distance_rad) return std::nullopt;
    MatrixXd ends(arm.dof(), 2);
    ends << *start, *goal;
    return ends;
  }

  /// A path without contact, rounded.
  [[nodiscard]] static std::optional<MatrixXd> search(const scene::Scene& scene,
                                                      const model::Model& arm) {
    control::World world(scene, arm, {});
    const control::PathPlan plan = control::plan_paths(scene, arm, world);
    if (!plan.found()) return std::nullopt;
    MatrixXd path = plan.goals.front().path.points;
    for (Eigen::Index i = 0; i < path.cols(); ++i) path.col(i) = rounded_joints(path.col(i));
    // RRT-Connect ends in a configuration within the tolerance of the goal.
    path.rightCols(1) = scene.goals.front().q;
    if (judge(scene, path).contact()) return std::nullopt;
    return path;
  }

  const DrawOptions& options_;
  mutable int dof_ = 0;
};

}  // namespace

ProblemSet draw_problem_set(const DrawOptions& options) {
  ProblemSet set;
  set.name = options.name;
  set.robot = options.robot;
  set.resolution_m = options.resolution_m;
  set.clearance_m = options.clearance_m;
  set.self_clearance_m = options.self_clearance_m;
  const auto names = options.families.empty() ? families() : options.families;
  Drawer drawer(options);
  for (const auto& family : names)
    for (std::size_t k = 0; k < options.per_family; ++k) {
      std::optional<Problem> found;
      for (std::size_t i = 0; !found && i < options.max_candidates; ++i)
        found = drawer.candidate(family, options.seed * 1'000'000 + 1000 * k + i, set.drawn);
      if (!found)
        throw Error(
            ErrorCode::invalid,
            fmt::format("family '{}': none of {} candidates is a problem: {} have no start or "
                        "goal, {} a free straight motion, {} no path that was found; "
                        "expected one",
                        family, options.max_candidates, set.drawn.no_start_or_goal,
                        set.drawn.straight_is_free, set.drawn.path_unknown));
      found->name = fmt::format("{}-{:02}", family, k + 1);
      set.problems.push_back(std::move(*found));
      if (options.on_problem)
        options.on_problem(set.problems.size(), names.size() * options.per_family);
    }
  return set;
}

}  // namespace hamelin::bench
