#include "hamelin/log/result.hpp"

#include <fmt/format.h>

#include "hamelin/core/error.hpp"
#include "hamelin/log/run_log.hpp"

namespace hamelin::log {

namespace {

Json array(const Eigen::VectorXd& x) {
  Json values = Json::array();
  for (const double value : x) values.push_back(value);
  return values;
}

template <typename T>
Json optional(const std::optional<T>& value) {
  return value ? Json(*value) : Json(nullptr);
}

Json goal(const std::optional<Result::Goal>& goal) {
  if (!goal) return nullptr;
  return {{"type", goal->type},
          {"error_m", optional(goal->error_m)},
          {"error_rad", optional(goal->error_rad)},
          {"index", goal->index},
          {"count", goal->count}};
}

Json errors_json(const Result::Following::Errors& errors) {
  return {{"time_s", errors.time_s},
          {"rms_m", errors.rms_m},
          {"max_m", errors.max_m},
          {"rms_rad", errors.rms_rad},
          {"max_rad", errors.max_rad}};
}

Json following_json(const Result::Following& f) {
  return {{"all", errors_json(f.all)},
          {"free", errors_json(f.free)},
          {"tracked_s", f.tracked_s},
          {"free_not_tracked_s", f.free_not_tracked_s},
          {"lost_s", f.lost_s},
          {"resumed", f.resumed},
          {"not_resumed", f.not_resumed},
          {"resume_max_s", optional(f.resume_max_s)},
          {"refused_lines", f.refused_lines}};
}

Json solver(const SolverSummary& s) {
  const auto mean = [&](long sum) {
    return s.steps > 0 ? Json(static_cast<double>(sum) / static_cast<double>(s.steps))
                       : Json(nullptr);
  };
  return {{"updates_mean", mean(s.updates)},
          {"updates_max", s.updates_max},
          {"factorizations_mean", mean(s.factorizations)},
          {"evaluations", s.evaluations},
          {"halvings", s.halvings},
          {"rejected", s.rejected},
          {"residual_max", s.residual_max},
          {"criterion", s.criterion},
          {"tolerance", s.tolerance}};
}

Json times(const std::optional<Result::TickTime>& t) {
  if (!t) return nullptr;
  return {{"p50", t->p50}, {"p99", t->p99}, {"max", t->max}};
}

Json timing(const Result& r) {
  return {{"cpu_s", r.cpu_s},
          {"tick_us", times(r.tick_us)},
          {"controller_wall_us", times(r.controller_us)},
          {"planner_wall_us", times(r.planner_us)},
          {"deadline_us", optional(r.deadline_us)},
          {"late_ticks", r.deadline_us ? Json(r.late_ticks) : Json(nullptr)}};
}

Json shield(const Result::Shield& s) {
  Json causes = Json::object();
  for (const auto& [cause, count] : s.causes) causes[cause] = count;
  Json out{{"margin_m", s.margin_m},
           {"steps", s.steps},
           {"refused", s.refused},
           {"refused_at_rest", s.refused_at_rest},
           {"along_path", s.along_path},
           {"stops", s.stops},
           {"longest_stop_steps", s.longest_stop_steps},
           {"causes", std::move(causes)},
           {"strayed_rad", s.strayed_rad},
           {"strayed_share", s.strayed_share},
           {"overtaken", s.overtaken},
           {"work_J", s.work_J}};
  if (!s.movers) return out;
  out["evasions"] = s.evasions;
  out["movers"] = *s.movers;
  for (const auto& [proof, count] : s.mover_steps) out["mover_steps"][proof] = count;
  return out;
}

Json contact_json(const Result::MoverContact& contact) {
  Json errors = Json::array();
  for (const auto& error : contact.prediction_errors)
    errors.push_back({{"ahead_s", error.ahead_s}, {"error_m", error.error_m}});
  return {{"obstacle", contact.obstacle},
          {"link", contact.link},
          {"time_s", contact.time_s},
          {"arm_speed_m_s", contact.arm_speed_m_s},
          {"obstacle_speed_m_s", contact.obstacle_speed_m_s},
          {"closing_speed_m_s", contact.closing_speed_m_s},
          {"prediction", contact.prediction},
          {"prediction_errors", std::move(errors)}};
}

Json sensors_json(const Result::Sensors& s) {
  return {{"frames", s.frames}, {"refused", s.refused},   {"points", s.points},
          {"on_arm", s.on_arm}, {"occupied", s.occupied}, {"cleared", s.cleared}};
}

Json guide_json(const Result::Guide& g) {
  return {{"type", g.type},
          {"searches", g.searches},
          {"found", g.found},
          {"kept", g.kept},
          {"checks", g.checks},
          {"waited_s", g.waited_s},
          {"length", optional(g.length)}};
}

Json trajectory_json(const Result::Trajectory& t) {
  return {{"duration_s", t.duration_s},
          {"time_s", t.time_s},
          {"error_rms", t.error_rms},
          {"error_max", t.error_max}};
}

Json constraint_json(const Result::Constraint& c) {
  return {{"goal", c.goal},
          {"constraint", c.constraint},
          {"type", c.type},
          {"excess", c.excess},
          {"time_s", c.time_s}};
}

Json plant_json(const Result::Plant& p) {
  return {{"type", p.type},
          {"version", p.version},
          {"contacts", p.contacts},
          {"judge_contacts", p.judge_contacts},
          {"deepest_m", optional(p.deepest_m)}};
}

// Members that only some runs have.
void add_optional_members(const Result& r, Json& document) {
  if (r.torque_change)
    document["torque_change"] = {{"mean", r.torque_change->mean()}, {"max", r.torque_change->max}};
  if (r.external_work_J != 0.0) document["external_work_J"] = r.external_work_J;
  if (r.position_excess) document["position_excess"] = *r.position_excess;
  if (r.speed_excess) document["speed_excess"] = *r.speed_excess;
  if (r.shield) document["shield"] = shield(*r.shield);
  if (r.sensors) document["sensors"] = sensors_json(*r.sensors);
  if (r.guide) document["guide"] = guide_json(*r.guide);
  if (r.following) document["following"] = following_json(*r.following);
  if (r.trajectory) document["trajectory"] = trajectory_json(*r.trajectory);
  for (const auto& allowed : r.may_touch)
    document["may_touch"].push_back(
        {{"goal", allowed.goal}, {"what", allowed.what}, {"clearance_m", allowed.clearance_m}});
  for (const auto& kept : r.constraints) document["constraints"].push_back(constraint_json(kept));
  if (r.mover_contact) document["mover_contact"] = contact_json(*r.mover_contact);
  if (r.plant) document["plant"] = plant_json(*r.plant);
}

}  // namespace

std::string_view to_string(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::completed:
      return "completed";
    case Outcome::reached:
      return "reached";
    case Outcome::followed:
      return "followed";
    case Outcome::target_lost:
      return "target_lost";
    case Outcome::stalled:
      return "stalled";
    case Outcome::collision:
      return "collision";
    case Outcome::timeout:
      return "timeout";
    case Outcome::diverged:
      return "diverged";
    case Outcome::defect:
      return "defect";
    case Outcome::refused:
      return "refused";
    case Outcome::interrupted:
      return "interrupted";
  }
  return "unknown";
}

int exit_code(Outcome outcome) noexcept {
  switch (outcome) {
    case Outcome::completed:
    case Outcome::reached:
    case Outcome::followed:
      return 0;
    case Outcome::target_lost:
    case Outcome::stalled:
    case Outcome::collision:
    case Outcome::timeout:
      return 1;
    case Outcome::refused:
      return 2;
    case Outcome::diverged:
    case Outcome::defect:
      return 3;
    case Outcome::interrupted:
      return 130;
  }
  return 3;
}

Json to_json(const Result& r) {
  Json document = {
      {"schema", "hamelin.result/1"},
      {"version", std::string(version())},
      {"scene", r.scene},
      {"planner", optional(r.planner)},
      {"integrator", r.integrator},
      {"outcome", std::string(to_string(r.outcome))},
      {"cause", r.cause.empty() ? Json(nullptr) : Json(r.cause)},
      {"time_s", r.time_s},
      {"steps", r.steps},
      {"q", array(r.q)},
      {"v", array(r.v)},
      {"v_abs_max", r.v_abs_max.size() > 0 ? array(r.v_abs_max) : Json(nullptr)},
      {"a_abs_max", r.a_abs_max.size() > 0 ? array(r.a_abs_max) : Json(nullptr)},
      {"jerk_abs_max", r.jerk_abs_max.size() > 0 ? array(r.jerk_abs_max) : Json(nullptr)},
      {"energy_initial_J", r.energy_initial_J},
      {"energy_final_J", r.energy_final_J},
      {"energy_error_max_J", r.energy_error_max_J},
      {"min_clearance_m", optional(r.min_clearance_m)},
      {"min_self_clearance_m", optional(r.min_self_clearance_m)},
      {"goal", goal(r.goal)},
      {"solver", solver(r.solver)},
      {"gyroscopic_work_J", r.gyroscopic_work_J},
      {"filter_work_J", r.filter_work_J},
      {"recovery_work_J", r.recovery_work_J},
      {"dissipated_J", r.dissipated_J},
      {"held_work_J", r.held_work_J},
      {"node_work_J", r.node_work_J},
      {"saturated_share", optional(r.saturated_share)},
      {"certified_share", optional(r.certified_share)},
      {"tightest_step_m", optional(r.tightest_step_m)},
      {"seed", r.seed},
      {"warnings", r.warnings},
      {"timing", timing(r)},
      {"provenance", r.provenance}};
  add_optional_members(r, document);
  for (const auto& replaced : null_non_finite(document))
    document["warnings"].push_back(fmt::format("not finite, written as null: {}", replaced));
  return document;
}

}  // namespace hamelin::log
