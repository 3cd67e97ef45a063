#include "c/c_interface.hpp"

using namespace hamelin;
using namespace hamelin::control;

namespace {

void write_target(const control::Controller& controller, hamelin_answer& out) {
  const control::TargetState* const target = controller.answer().target;
  if (target == nullptr) return;
  out.target = target->waiting ? HAMELIN_TARGET_WAITING
               : target->lost  ? HAMELIN_TARGET_LOST
                               : HAMELIN_TARGET_FOLLOWED;
  std::copy_n(target->pose.p().data(), 3, out.target_position_m);
  out.target_error_m = (controller.tip().p() - target->pose.p()).norm();
}

std::int32_t verdict_of(const std::optional<Certificate::Verdict>& verdict) {
  if (!verdict) return HAMELIN_VERDICT_NONE;
  if (verdict->contact) return HAMELIN_VERDICT_CONTACT;
  return verdict->certified ? HAMELIN_VERDICT_CERTIFIED : HAMELIN_VERDICT_OPEN;
}

hamelin_answer answer_of(hamelin_controller& of, const control::Answer& answer) {
  const auto& verdict = of.controller.verdict();
  hamelin_answer full{};
  full.state = static_cast<std::int32_t>(answer.state);
  write_line(answer.cause, of.cause.data(), of.cause.size());
  full.cause = of.cause.data();
  full.torque = answer.torque.data();
  full.q_next = answer.q_next.data();
  full.v_next = answer.v_next.data();
  full.goal_index = answer.goal_index;
  full.snapshot = answer.snapshot;
  full.clearance_m = of.controller.view().clearance_m();
  full.certified = !verdict || verdict->certified ? 1 : 0;
  full.margin_m = verdict ? verdict->margin_m : full.clearance_m;
  full.saturated = answer.saturated ? 1 : 0;
  full.goals = answer.goals_number;
  full.planner_s = answer.planner_s;
  full.overruns = answer.overruns;
  full.load = answer.load;
  full.refused_load = answer.refused_load;
  write_line(answer.load_refusal, of.load_refusal.data(), of.load_refusal.size());
  full.load_refusal = of.load_refusal.data();
  write_target(of.controller, full);
  full.reason = static_cast<std::int32_t>(answer.reason);
  full.shield_stopping = answer.stopping ? 1 : 0;
  full.verdict = verdict_of(verdict);
  if (answer.reference != nullptr) {
    full.reference_q = answer.reference->q.data();
    full.reference_v = answer.reference->v.data();
  }
  const geometry::SE3 tip = of.controller.tip();
  std::copy_n(tip.p().data(), 3, full.tip_position_m);
  const Eigen::Vector4d wxyz = geometry::quaternion_wxyz(tip.R());
  std::copy_n(wxyz.data(), 4, full.tip_quaternion_wxyz);
  full.series = answer.series.data();
  full.series_count = answer.series.size();
  full.may_touch = answer.may_touch != nullptr ? 1 : 0;
  return full;
}

static_assert(sizeof(hamelin_shield::causes) / sizeof(std::int64_t) == stop_causes);
static_assert(sizeof(hamelin_shield::proofs) / sizeof(std::int64_t) == mover_proofs);

void write_counts(const ShieldCounts& counts, hamelin_shield& out) {
  out.steps = counts.steps;
  out.refused = counts.refused;
  out.at_rest = counts.at_rest;
  out.stops = counts.stops;
  out.longest = counts.longest;
  std::copy(counts.causes.begin(), counts.causes.end(), out.causes);
  out.strayed = counts.strayed;
  out.strayed_share = counts.strayed_share;
  out.strayed_joint = counts.strayed_joint;
  out.overtaken = counts.overtaken;
  out.evasions = counts.evasions;
  std::copy(counts.proofs.begin(), counts.proofs.end(), out.proofs);
}

hamelin_shield shield_of(hamelin_controller& of) {
  hamelin_shield full{};
  LineBuffer line;
  if (const auto report = of.controller.shield_report()) {
    full.active = 1;
    full.stopping = report->stopping ? 1 : 0;
    full.cause = report->cause ? static_cast<std::int32_t>(*report->cause) : -1;
    full.proof = report->proof ? static_cast<std::int32_t>(*report->proof) : -1;
    of.controller.describe_refusal(line);
    write_counts(report->counts, full);
  }
  write_line(line.view(), of.shield_line.data(), of.shield_line.size());
  full.line = of.shield_line.data();
  return full;
}

}  // namespace

extern "C" {

std::int32_t hamelin_controller_tick(hamelin_controller* controller, double time_s, const double* q,
                                     const double* v, hamelin_answer* out) {
  constexpr std::size_t first_size = offsetof(hamelin_answer, goals);
  if (out == nullptr || out->struct_size < first_size) return 1;
  hamelin_controller::Line line{};
  hamelin_answer full{};
  const std::int32_t failed =
      guarded(controller, line.data(), line.size(), [&](hamelin_controller& of) {
        of.q = joints(of, q, "q");
        of.v = joints(of, v, "v");
        full = answer_of(of, of.controller.tick(time_s, of.q, of.v));
      });
  if (failed != 0) {
    full = {};
    full.state = HAMELIN_CONTROL_STOPPING;
    full.cause = full.load_refusal = "";
    if (controller != nullptr) {
      controller->cause = line;
      full.cause = controller->cause.data();
    }
  }
  write_struct(full, out);
  return failed;
}

std::int32_t hamelin_controller_shield(hamelin_controller* controller, hamelin_shield* out,
                                       char* error, std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    if (out == nullptr || out->struct_size < sizeof(hamelin_shield)) refuse_size("shield");
    write_struct(shield_of(of), out);
  });
}

std::int32_t hamelin_controller_guide(hamelin_controller* controller, hamelin_guide* out,
                                      char* error, std::size_t error_size) {
  return guarded(controller, error, error_size, [&](hamelin_controller& of) {
    if (out == nullptr || out->struct_size < sizeof(hamelin_guide)) refuse_size("guide");
    hamelin_guide full{};
    if (const GuideFigures* figures = of.controller.guide_figures(); figures != nullptr)
      full = {0,
              1,
              figures->searches,
              figures->found,
              figures->kept,
              figures->checks,
              figures->waited_s,
              figures->length};
    write_struct(full, out);
  });
}

}  // extern "C"
