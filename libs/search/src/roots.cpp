#include "roots.hpp"

#include <Eigen/Geometry>
#include <algorithm>

#include "hamelin/dynamics/inverse_kinematics.hpp"

namespace hamelin::search {

using Eigen::Index;
using Eigen::Vector3d;
using Eigen::VectorXd;

namespace {

constexpr int attempts_max = 60, attempts_for_one = 600;  // for several roots, and for any
constexpr std::size_t roots_max = 6;
// Share of the tolerance of a joint goal within which other places are drawn.
constexpr double joint_tolerance_share = 0.9;
// Share of a tip goal's tolerances within which other poses are drawn. Inverse kinematics takes the
// rest.
constexpr double tip_tolerance_share = 0.6;

// Another pose within the tolerances of the goal, since the goal itself is often near an obstacle.
dynamics::TipTarget draw_near(const dynamics::TipTarget& target, Rng& rng) {
  const auto draw = [&](double radius) -> Vector3d {
    Vector3d out;
    for (int i = 0; i < 3; ++i) out[i] = rng.uniform(-1.0, 1.0);
    return out * (radius / std::max(1.0, out.norm()));
  };
  dynamics::TipTarget out = target;
  out.position += draw(tip_tolerance_share * target.tolerance_m);
  const Vector3d turn = draw(tip_tolerance_share * target.tolerance_rad);
  out.rotation =
      Eigen::AngleAxisd(turn.norm(), turn.stableNormalized()).toRotationMatrix() * target.rotation;
  return out;
}

std::vector<Root> joint_roots(const Settings& settings, const Problem& problem, Query& query,
                              Rng& rng) {
  VectorXd q = problem.goal.q;
  for (int attempt = 0; attempt < attempts_for_one; ++attempt) {
    if (attempt > 0)  // the goal itself is not clear, but a place within its tolerance may be
      for (Index i = 0; i < q.size(); ++i)
        q[i] = problem.goal.q[i] +
               joint_tolerance_share * problem.goal.tolerance_rad * rng.uniform(-1.0, 1.0);
    const double clearance = query.clearance(q, settings.least_m);
    if (clearance > 0.0 && clearance >= settings.least_m) return {{q, clearance}};
  }
  return {};
}

// Most attempts look for places with all the clearance that is asked for, the last quarter for any
// that a path may end at.
double clearance_of_attempt(const Settings& settings, int attempt) {
  const int quarter = 4 * attempt / attempts_max;
  if (quarter < 2) return settings.root_clearance_m;
  return quarter == 2 ? 0.5 * (settings.root_clearance_m + settings.least_m) : settings.least_m;
}

std::vector<Root> tip_roots(const model::Model& model, const dynamics::JointBox& box,
                            const Settings& settings, const Problem& problem, Query& query,
                            Rng& rng) {
  dynamics::InverseKinematics kinematics(model, box);
  dynamics::TipTarget goal;
  goal.position = problem.goal.pose.p();
  goal.rotation = problem.goal.pose.R();
  goal.turns = problem.goal.type == scene::GoalType::pose;
  goal.tolerance_m = problem.goal.tolerance_m;
  if (goal.turns) goal.tolerance_rad = problem.goal.tolerance_rad;
  std::vector<Root> roots;
  VectorXd q = problem.start;
  for (int attempt = 0; roots.size() < roots_max; ++attempt) {
    if (attempt >= (roots.empty() ? attempts_for_one : attempts_max)) break;
    if (kinematics.solve(attempt > 0 ? draw_near(goal, rng) : goal, q)) {
      const double least = std::max(1e-6, clearance_of_attempt(settings, attempt));
      if (const double clearance = query.clearance(q, least); clearance >= least)
        roots.push_back({q, clearance});
    }
    box.draw(rng, q);
  }
  return roots;
}

}  // namespace

std::vector<Root> find_roots(const model::Model& model, const dynamics::JointBox& box,
                             const Settings& settings, const Problem& problem, Query& query,
                             Rng& rng) {
  std::vector<Root> roots = problem.goal.type == scene::GoalType::joint
                                ? joint_roots(settings, problem, query, rng)
                                : tip_roots(model, box, settings, problem, query, rng);
  std::stable_sort(roots.begin(), roots.end(), [&](const Root& a, const Root& b) {
    return (a.q - problem.start).squaredNorm() < (b.q - problem.start).squaredNorm();
  });
  return roots;
}

}  // namespace hamelin::search
