#include "guide/guide_query.hpp"

#include <algorithm>

namespace hamelin::control {

using Eigen::VectorXd;

namespace {

// The margin of planners that have no parameter of that name, and what guides keep beyond it, so
// that the planner has nothing to correct on the path [m].
constexpr double default_margin_m = 0.01, guide_reserve_m = 0.002;
// Clearance of configurations at a goal of the tip, beyond what a shield keeps [m].
constexpr double root_reserve_m = 0.003;
// What goals must have, at least: under sampled actuation the arm strays from its path [m].
constexpr double least_m = 0.001, least_sampled_m = 0.003;
// The accuracy of a proved clearance [m].
constexpr double proved_to_m = 1e-4;

}  // namespace

GuideQuery::GuideQuery(const model::Model& model, const World& world, const WorldView& view)
    : query_(model, world, view),
      lines_(model, view.self_field()),
      edges_(model, view.self_field()),
      influence_(view.influence_m()) {
  (void)refresh(0.0);
}

std::uint64_t GuideQuery::refresh(double time_s, std::uint64_t allowance) {
  time_s_ = time_s;
  const std::uint64_t number = query_.refresh(allowance);
  lines_.set_environment(query_.snapshot().environment, time_s);
  edges_.set_environment(query_.snapshot().environment, time_s);
  return number;
}

double GuideQuery::clearance(const VectorXd& q, double at_least_m) {
  poll();
  ++clearances_;
  return query_.clearance(q.data(), time_s_, at_least_m);
}

double GuideQuery::proved_clearance(const VectorXd& a, const VectorXd& b) {
  double low = 0.0, high = std::min({influence_, query_.clearance(a.data(), time_s_, -1.0),
                                     query_.clearance(b.data(), time_s_, -1.0)});
  if (high <= 0.0 || !edges_.motion_clear(a, b, 0.0)) {
    return std::min(high, 0.0);
  }
  while (high - low > proved_to_m) {
    const double middle = 0.5 * (low + high);
    (edges_.motion_clear(a, b, middle) ? low : high) = middle;
  }
  return std::max(low, 1e-12);
}

search::Settings guide_settings(const scene::Scene& scene, const model::Model& nominal,
                                const WorldView& view, const LimitReserve& reserve,
                                const Json& params) {
  search::Settings out;
  const planning::SetupData setup = planner_setup(scene, nominal, view, scene.step_s, reserve);
  out.q_lower = setup.q_lower;
  out.q_upper = setup.q_upper;
  const double shield = std::max(reserve.obstacles_m, reserve.self_m);
  const auto param = [&](const char* name, double otherwise) {
    const auto it = params.find(name);
    return it != params.end() && it->is_number() ? it->get<double>() : otherwise;
  };
  const double margin = param("margin_m", default_margin_m);
  out.margin_m = scene.guide.margin_m.value_or(
      std::max({margin, setup.map_resolution_m, shield + guide_reserve_m}) + guide_reserve_m);
  out.self_margin_m = std::min(
      out.margin_m,
      std::max(param("self_margin_m", margin), reserve.self_m + guide_reserve_m) + guide_reserve_m);
  out.least_m = std::min(out.margin_m, setup.sampled ? least_sampled_m : least_m);
  out.root_clearance_m = std::max(shield + root_reserve_m, out.margin_m + out.slack_m);
  out.seed = scene.seed;
  out.checks_max = scene.guide.checks_max;
  out.improve_checks = scene.guide.improve_checks;
  return out;
}

}  // namespace hamelin::control
