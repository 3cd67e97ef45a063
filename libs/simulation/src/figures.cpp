// The figures of a run that are known when it has ended.
#include "closed_loop.hpp"

#include <fmt/format.h>

namespace hamelin::simulation {

namespace {

log::Result::Shield shield_figures(const control::ShieldReport& report, double work_J) {
  const control::ShieldCounts& counts = report.counts;
  log::Result::Shield out;
  out.margin_m = report.largest_margin_m;
  out.steps = counts.steps;
  out.refused = counts.refused;
  out.refused_at_rest = counts.at_rest;
  out.along_path = counts.along_path;
  out.stops = counts.stops;
  out.longest_stop_steps = counts.longest;
  for (std::size_t i = 0; i < counts.causes.size(); ++i)
    if (counts.causes[i] > 0)
      out.causes.emplace_back(to_string(static_cast<control::StopCause>(i)), counts.causes[i]);
  out.strayed_rad = counts.strayed;
  out.strayed_share = counts.strayed_share;
  out.overtaken = counts.overtaken;
  out.work_J = work_J;
  out.evasions = counts.evasions;
  for (std::size_t i = 0; i < counts.proofs.size(); ++i) {
    if (counts.proofs[i] == 0) continue;
    out.movers = to_string(static_cast<control::MoverProof>(i));
    out.mover_steps.emplace_back(*out.movers, counts.proofs[i]);
  }
  return out;
}

std::string shield_warning(const control::ShieldCounts& counts, const model::Model& model) {
  const auto joint = static_cast<std::size_t>(counts.strayed_joint);
  return fmt::format(
      "the bounds of /safety do not hold: joint '{}' strayed from the motion of a "
      "stop by {:.2g} times the bound that follows from them",
      model.robot().links[joint].joint.name, counts.strayed_share);
}

}  // namespace

void ClosedLoop::fill_result() {
  if (const auto* change = actuation_->torque_change()) result_.torque_change = *change;
  if (const auto shield = controller_->shield_report()) {
    result_.shield = shield_figures(*shield, audit_->ledger().stop);
    if (shield->counts.strayed_share > 1.0)
      result_.warnings.push_back(shield_warning(shield->counts, model_));
  }
  if (sensors_) sensors_->fill(result_);
  if (const control::GuideFigures* const guide = controller_->guide_figures())
    result_.guide = {std::string(to_string(scene_.guide.type)),
                     guide->searches,
                     guide->found,
                     guide->kept,
                     guide->checks,
                     guide->waited_s,
                     guide->found > 0 ? std::optional(guide->length) : std::nullopt};
  result_.scene = scene_.name;
  result_.planner = controller_->plugin().name();
  result_.time_s = plant_->node().time_s;
  result_.steps = plant_->node().k;
  result_.q = plant_->node().q;
  result_.v = plant_->node().v;
  result_.seed = scene_.seed;
  result_.deadline_us = 1e6 * controller_->deadline_s();
  result_.late_ticks = controller_->answer().overruns;
  if (tracking_) result_.following = tracking_->figures();
  result_.trajectory = trajectory_.figures();
  const control::GoalTracker& goals = controller_->goals();
  const control::GoalError error = goal_error();
  log::Result::Goal out;
  out.type = scene::type_name(goals.goal());
  out.index = goals.index();
  out.count = goals.size();
  out.error_m = error.metres;
  out.error_rad = error.radians;
  result_.goal = out;
  judge_->fill(result_);
  if (actuation_->limited() && plant_->node().k > 0) {
    result_.saturated_share =
        static_cast<double>(saturated_steps_) / static_cast<double>(plant_->node().k);
    if (saturated_steps_ > 0)
      result_.warnings.push_back(
          fmt::format("torque limits cut the planner's answer in {} of {} steps", saturated_steps_,
                      plant_->node().k));
  }
}

}  // namespace hamelin::simulation
