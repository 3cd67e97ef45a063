#include <fmt/format.h>

#include "hamelin/bench/draw.hpp"
#include "hamelin/bench/moving_scene.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "sampler.hpp"

namespace hamelin::bench {

using Eigen::MatrixXd;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr double way_min_m = 5.0;  // see way_length()
constexpr int goals_max = 200;     // for one start

class MovingDrawer {
 public:
  explicit MovingDrawer(const DrawOptions& options)
      : options_(options),
        judged_(judged_arm(options.robot)),
        empty_(empty_scene()),
        model_(control::load_model(empty_)),
        ws_(model_) {}

  /// A candidate, or none if it is not taken.
  std::optional<Problem> candidate(const Cell& cell, std::uint64_t seed, DrawCounts& counts) {
    ++counts.candidates;
    const auto ends = draw_ends(seed);
    if (!ends) {
      ++counts.no_start_or_goal;
      return std::nullopt;
    }
    Problem problem;
    problem.family = cell.family;
    problem.seed = seed;
    problem.path = *ends;
    problem.obstacles = cell.obstacles;
    problem.speed_max_m_s = cell.speed_max_m_s;
    try {
      problem.sha256 = sha256_hex(moving_problem_text(problem, judged_));
    } catch (const Error& error) {
      // No room for the obstacles: another start and goal may leave some.
      if (error.code() != ErrorCode::invalid) throw;
      ++counts.no_room;
      return std::nullopt;
    }
    return problem;
  }

 private:
  // The arm above the ground.
  [[nodiscard]] scene::Scene empty_scene() const {
    Problem nothing;
    nothing.family = moving_families().front();
    nothing.path = MatrixXd::Zero(static_cast<Eigen::Index>(judged_.dof()), 2);
    Json document = Json::parse(moving_problem_text(nothing, judged_));
    document["robot"] = {{"file", options_.robot.robot.string()}};
    if (!options_.robot.spheres.empty())
      document["robot"]["spheres"] = options_.robot.spheres.string();
    if (!options_.robot.tip.empty()) document["robot"]["tip"] = options_.robot.tip;
    return scene::scene_from_json(document, ".", options_.robot.robot.string());
  }

  [[nodiscard]] std::optional<MatrixXd> draw_ends(std::uint64_t seed) {
    control::WorldView view(empty_, model_, 2.0 * options_.clearance_m);
    Sampler sampler(model_, options_, seed);
    const auto any = [](const dynamics::Workspace&) { return true; };
    const auto start = sampler.draw(view, any);
    if (!start) return std::nullopt;
    for (int i = 0; i < goals_max; ++i) {
      const auto goal = sampler.draw(view, any);
      if (!goal) return std::nullopt;
      if (way_length(*start, *goal) < way_min_m) continue;
      MatrixXd ends(model_.dof(), 2);
      ends << *start, *goal;
      return ends;
    }
    return std::nullopt;
  }

  // Sum over the origins of the links and the tip of the distances from the start to the middle of
  // the straight joint motion, and from there to the goal.
  [[nodiscard]] double way_length(const VectorXd& start, const VectorXd& goal) {
    const auto from = points(start), middle = points(0.5 * (start + goal)), to = points(goal);
    double sum = 0.0;
    for (std::size_t i = 0; i < from.size(); ++i)
      sum += (middle[i] - from[i]).norm() + (to[i] - middle[i]).norm();
    return sum;
  }

  [[nodiscard]] std::vector<Vector3d> points(const VectorXd& q) {
    dynamics::forward_kinematics(model_, ws_, q);
    std::vector<Vector3d> out;
    out.reserve(static_cast<std::size_t>(model_.dof()) + 1);
    for (int i = 0; i < model_.dof(); ++i) out.push_back(dynamics::link_pose(model_, ws_, i).p());
    out.push_back(dynamics::tip_pose(model_, ws_).p());
    return out;
  }

  const DrawOptions& options_;
  sweep::JudgedArm judged_;
  scene::Scene empty_;
  model::Model model_;
  dynamics::Workspace ws_;
};

Problem draw_one(MovingDrawer& drawer, const Cell& cell, std::uint64_t first_seed,
                 const DrawOptions& options, DrawCounts& counts) {
  for (std::size_t i = 0; i < options.max_candidates; ++i)
    if (auto problem = drawer.candidate(cell, first_seed + i, counts)) return std::move(*problem);
  throw Error(ErrorCode::invalid,
              fmt::format("family '{}' with {} obstacles: none of {} candidates is a problem, "
                          "expected one",
                          cell.family, cell.obstacles, options.max_candidates));
}

}  // namespace

ProblemSet draw_moving_set(const DrawOptions& options) {
  ProblemSet set;
  set.name = options.name;
  set.robot = options.robot;
  set.resolution_m = 0.0;
  set.clearance_m = options.clearance_m;
  set.self_clearance_m = options.self_clearance_m;
  std::vector<Cell> all;
  for (const auto& family : options.families.empty() ? moving_families() : options.families)
    for (const auto& cell : cells(family)) all.push_back(cell);
  MovingDrawer drawer(options);
  constexpr std::uint64_t per_set = 10'000'000, per_cell = 100'000, per_problem = 100;
  for (std::size_t c = 0; c < all.size(); ++c)
    for (std::size_t k = 0; k < options.per_family; ++k) {
      const std::uint64_t seed = options.seed * per_set + c * per_cell + k * per_problem;
      Problem problem = draw_one(drawer, all[c], seed, options, set.drawn);
      problem.name = fmt::format("{}-{}-{:03.0f}-{:02}", all[c].family, all[c].obstacles,
                                 100.0 * all[c].speed_max_m_s, k + 1);
      set.problems.push_back(std::move(problem));
      if (options.on_problem)
        options.on_problem(set.problems.size(), all.size() * options.per_family);
    }
  return set;
}

}  // namespace hamelin::bench
