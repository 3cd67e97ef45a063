#include "recorder.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <utility>

#include "hamelin/core/error.hpp"

namespace hamelin::simulation {

namespace {

// Raises `largest` to the magnitude of v, number by number.
void raise_to_magnitude(Eigen::VectorXd& largest, const Eigen::VectorXd& v) {
  if (largest.size() == 0) largest.setZero(v.size());
  largest = largest.cwiseMax(v.cwiseAbs());
}

}  // namespace

Recorder::Recorder(log::Result& result, const Watch& watch, std::string integrator,
                   std::string criterion, double tolerance)
    : result_(result), watch_(watch) {
  result_.integrator = std::move(integrator);
  result_.solver.criterion = std::move(criterion);
  result_.solver.tolerance = tolerance;
}

void Recorder::header(Json fields, const model::Robot& robot, long steps) {
  if (watch_.log == nullptr) return;
  fields["every"] = watch_.every;
  fields["joints"] = Json::array();
  for (const auto& link : robot.links)
    fields["joints"].push_back(
        {{"name", link.joint.name},
         {"type", link.joint.type == model::JointType::revolute ? "revolute" : "prismatic"}});
  watch_.log->write("header", fields);
  if (watch_.announce)
    watch_.announce(std::ceil(static_cast<double>(steps) / static_cast<double>(watch_.every)),
                    robot.dof());
}

void Recorder::node(const Ledger& ledger) {
  last_node_ = ledger;
  if (first_) {
    first_ = false;
    first_balance_ = ledger.balance();
    result_.energy_initial_J = ledger.kinetic + ledger.potential + ledger.control;
  }
  energy_error_ = std::abs(ledger.balance() - first_balance_);
  result_.energy_error_max_J = std::max(result_.energy_error_max_J, energy_error_);
  since_.energy_error_J = std::max(since_.energy_error_J, energy_error_);
}

void Recorder::observe(double clearance_m, bool certified, const Eigen::VectorXd& v, double h) {
  raise_to_magnitude(result_.v_abs_max, v);
  if (observed_ == 0) {
    result_.a_abs_max.setZero(v.size());
    result_.jerk_abs_max.setZero(v.size());
    a_.setZero(v.size());
  } else {
    a_ = (v - v_last_) / h;
    raise_to_magnitude(result_.a_abs_max, a_);
    if (observed_ > 1)
      result_.jerk_abs_max = result_.jerk_abs_max.cwiseMax(((a_ - a_last_) / h).cwiseAbs());
  }
  v_last_ = v;
  a_last_ = a_;
  ++observed_;
  if (!logging()) return;
  since_.clearance_m = std::min(since_.clearance_m, clearance_m);
  since_.certified = since_.certified && certified;
  raise_to_magnitude(since_.v_abs, v);
}

void Recorder::step(const integration::StepReport& report) {
  auto& sums = result_.solver;
  ++sums.steps;
  sums.updates += report.updates;
  sums.factorizations += report.factorizations;
  sums.evaluations += report.evaluations;
  sums.halvings += report.halvings;
  sums.rejected += report.rejected;
  sums.updates_max = std::max(sums.updates_max, report.updates);
  sums.residual_max = std::max(sums.residual_max, report.residual);
  since_.updates = std::max(since_.updates, report.updates);
  since_.residual = std::max(since_.residual, report.residual);
  since_.halvings += report.halvings;
}

void Recorder::tick_time(double seconds) {
  const double tick_us = 1e6 * seconds;
  tick_us_.add(tick_us);
  since_.tick_us = std::max(since_.tick_us, tick_us);
  if (waiting_) {
    (*waiting_)["timing"]["tick_us"] = tick_us;
    write_waiting_tick();
  }
}

void Recorder::tick(long k, Json fields) {
  if (k == last_logged_) return;
  last_logged_ = k;
  if (watch_.every > 1 && k > 0) {
    fields["extrema"] = {
        {"clearance_m", nullptr},         {"energy_error_J", since_.energy_error_J},
        {"v_abs", to_json(since_.v_abs)}, {"updates", since_.updates},
        {"residual", since_.residual},    {"halvings", since_.halvings},
        {"certified", since_.certified}};
    if (std::isfinite(since_.clearance_m)) fields["extrema"]["clearance_m"] = since_.clearance_m;
    if (since_.tick_us > 0.0) fields["timing"]["tick_us_max"] = since_.tick_us;
  }
  since_ = {};
  waiting_ = std::move(fields);
}

void Recorder::write_waiting_tick() {
  if (!waiting_) return;
  watch_.log->write("tick", *waiting_);
  waiting_.reset();
}

void Recorder::event(double time_s, const std::string& text, const Json& more) {
  write_waiting_tick();
  if (watch_.log == nullptr) return;
  Json fields{{"time_s", time_s}, {"text", text}};
  fields.update(more);
  watch_.log->write("event", fields);
}

void Recorder::close(const Ledger& ledger) {
  result_.energy_final_J = ledger.kinetic + ledger.potential + ledger.control;
  result_.gyroscopic_work_J = ledger.gyroscopic;
  result_.held_work_J = ledger.held;
  result_.dissipated_J = ledger.dissipated;
  result_.external_work_J = ledger.external;
  result_.node_work_J = ledger.node;
  result_.filter_work_J = ledger.filter;
  result_.recovery_work_J = ledger.recovery;
  write_waiting_tick();
  result_.cpu_s = thread_cpu_s() - started_cpu_s_;
  const auto times = [](const TimeHistogram& us) -> std::optional<log::Result::TickTime> {
    if (us.count() == 0) return std::nullopt;
    return log::Result::TickTime{us.quantile(0.5), us.quantile(0.99), us.largest()};
  };
  result_.tick_us = times(tick_us_);
  result_.controller_us = times(controller_us_);
  result_.planner_us = times(planner_us_);
  if (watch_.log != nullptr) watch_.log->write("result", log::to_json(result_));
}

Json to_json(const Eigen::VectorXd& x) {
  Json array = Json::array();
  for (const double value : x) array.push_back(value);
  return array;
}

Json energy_json(const Ledger& ledger) {
  Json out{{"kinetic_J", ledger.kinetic},       {"potential_J", ledger.potential},
           {"control_J", ledger.control},       {"gyroscopic_work_J", ledger.gyroscopic},
           {"filter_work_J", ledger.filter},    {"recovery_work_J", ledger.recovery},
           {"dissipated_J", ledger.dissipated}, {"held_work_J", ledger.held},
           {"node_work_J", ledger.node}};
  if (ledger.stop != 0.0) out["stop_work_J"] = ledger.stop;
  if (ledger.load != 0.0) out["load_energy_J"] = ledger.load;
  if (ledger.external != 0.0) out["external_work_J"] = ledger.external;
  return out;
}

Json solver_json(const integration::StepReport& report) {
  return {
      {"updates", report.updates}, {"residual", report.residual}, {"halvings", report.halvings}};
}

long step_count(double duration_s, double step_s) {
  const double steps = duration_s / step_s;
  const double whole = std::round(steps);
  if (!(step_s > 0.0) || !(duration_s > 0.0) || !std::isfinite(steps))
    throw Error(ErrorCode::usage,
                fmt::format("step {} s and duration {} s: both must be positive and finite", step_s,
                            duration_s));
  if (whole > 1e10)
    throw Error(ErrorCode::usage,
                fmt::format("{:.3g} steps are too many, expected at most 1e10", whole));
  if (std::abs(steps - whole) > 1e-9 * std::max(1.0, whole) || whole < 1.0)
    throw Error(ErrorCode::usage,
                fmt::format("duration {} s is not an integer multiple of the step {} s (ratio {})",
                            duration_s, step_s, steps));
  return static_cast<long>(whole);
}

}  // namespace hamelin::simulation
