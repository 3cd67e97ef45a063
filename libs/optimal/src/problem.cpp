#include "hamelin/optimal/problem.hpp"

#include <fmt/format.h>

#include <cmath>
#include <limits>

#include "hamelin/dynamics/dynamics.hpp"
#include "refuse.hpp"

namespace hamelin::optimal {

using Eigen::Index;

Limits Limits::of(const model::Model& model) {
  constexpr double none = std::numeric_limits<double>::infinity();
  const Index n = model.dof();
  Limits out;
  out.position_min = VectorXd::Constant(n, -none);
  out.position_max = out.velocity = out.torque = VectorXd::Constant(n, none);
  for (Index j = 0; j < n; ++j) {
    const model::Joint& joint = model.robot().links[static_cast<std::size_t>(j)].joint;
    out.position_min[j] = joint.lower.value_or(-none);
    out.position_max[j] = joint.upper.value_or(none);
    out.velocity[j] = joint.velocity_max.value_or(none);
    out.torque[j] = joint.effort_max.value_or(none);
  }
  return out;
}

void NearDistances::add(Index row, double distance, const VectorXd& gradient) {
  const Index i = size();
  if (gradients_.cols() <= i) gradients_.conservativeResize(gradient.size(), 2 * i + 8);
  rows_.push_back(row);
  distances_.push_back(distance);
  gradients_.col(i) = gradient;
}

void Clearance::evaluate_all(const VectorXd& q, VectorXd& distances, MatrixXd& gradients) {
  NearDistances near;
  evaluate(q, near);
  distances = far();
  gradients = MatrixXd::Zero(q.size(), rows());
  for (Index i = 0; i < near.size(); ++i) {
    distances[near.row(i)] = near.distance(i);
    gradients.col(near.row(i)) = near.gradient(i);
  }
}

namespace {

void check_size(const char* what, const VectorXd& x, Index n, bool may_be_empty) {
  if (x.size() != n && !(may_be_empty && x.size() == 0))
    refuse(fmt::format("{}: {} numbers given, expected {} (one per joint)", what, x.size(), n));
}

void check_bounds(const char* what, const VectorXd& bound, Index n) {
  check_size(what, bound, n, true);
  for (Index j = 0; j < bound.size(); ++j)
    if (!(bound[j] > 0.0))
      refuse(fmt::format("{}: {} given for joint {}, expected a positive number", what, bound[j],
                         j + 1));
}

void check_not_negative(const char* what, double x) {
  if (!(x >= 0.0) || !std::isfinite(x))
    refuse(fmt::format("{}: {} given, expected a finite number that is not negative", what, x));
}

void check_torque_reserve(const Problem& problem) {
  const MatrixXd& reserve = problem.torque_reserve;
  const VectorXd& limit = problem.limits.torque;
  if (reserve.size() == 0) return;
  if (reserve.rows() != limit.size() || reserve.cols() != problem.intervals + 1)
    refuse(
        fmt::format("reserve of torques: {} × {} numbers given, expected {} × {} (torque limits "
                    "× knots)",
                    reserve.rows(), reserve.cols(), limit.size(), problem.intervals + 1));
  for (Index k = 0; k < reserve.cols(); ++k)
    for (Index j = 0; j < reserve.rows(); ++j)
      if (!(reserve(j, k) >= 0.0 && reserve(j, k) < limit[j]))
        refuse(
            fmt::format("reserve of torques: {} given for joint {}, expected 0 or more, and less "
                        "than the limit {:.6g}",
                        reserve(j, k), j + 1, limit[j]));
}

// One end of the motion.
struct End {
  const char* name;
  const VectorXd &q, &v;
};

void check_end(const Problem& problem, const End& end) {
  const Limits& limits = problem.limits;
  const Index n = problem.model->dof();
  check_size(fmt::format("{}, position", end.name).c_str(), end.q, n, false);
  check_size(fmt::format("{}, velocity", end.name).c_str(), end.v, n, false);
  if (!end.q.allFinite() || !end.v.allFinite())
    refuse(fmt::format("{}: a number is not finite, expected finite numbers", end.name));
  for (Index j = 0; j < limits.position_min.size(); ++j)
    if (!(end.q[j] >= limits.position_min[j] && end.q[j] <= limits.position_max[j]))
      refuse(fmt::format("{}: the position of joint {} is {:.6g}, expected {:.6g} to {:.6g}",
                         end.name, j + 1, end.q[j], limits.position_min[j],
                         limits.position_max[j]));
  for (Index j = 0; j < limits.velocity.size(); ++j)
    if (std::abs(end.v[j]) > limits.velocity[j])
      refuse(fmt::format("{}: the velocity of joint {} is {:.6g}, expected at most {:.6g}",
                         end.name, j + 1, end.v[j], limits.velocity[j]));
  if (limits.torque.size() == 0) return;
  dynamics::Workspace ws(*problem.model);
  VectorXd hold(n);
  dynamics::gravity_torque(*problem.model, ws, end.q, hold);
  for (Index j = 0; j < n; ++j)
    if (!(std::abs(hold[j]) < limits.torque[j]))
      refuse(
          fmt::format("{}: joint {} needs a torque of {:.6g} to hold the arm, expected less than "
                      "its limit {:.6g}",
                      end.name, j + 1, std::abs(hold[j]), limits.torque[j]));
}

void check_clearance(const Problem& problem, const End& end) {
  if (problem.clearance == nullptr || problem.clearance->rows() == 0) return;
  VectorXd distances(problem.clearance->rows());
  MatrixXd gradients(end.q.size(), distances.size());
  problem.clearance->evaluate_all(end.q, distances, gradients);
  if (!distances.allFinite())
    refuse(fmt::format("{}: a clearance is not finite, expected finite numbers", end.name));
  if (const double least = distances.minCoeff(); least < problem.margin_m)
    refuse(fmt::format("{}: the clearance is {:.6g} m, expected at least the margin {:.6g} m",
                       end.name, least, problem.margin_m));
}

}  // namespace

void check(const Problem& problem) {
  if (problem.model == nullptr) refuse("model: none given, expected one");
  const Limits& limits = problem.limits;
  const Index n = problem.model->dof();
  if (problem.intervals < least_intervals || problem.intervals > most_intervals)
    refuse(fmt::format("{} intervals between knots given, expected {} to {}", problem.intervals,
                       least_intervals, most_intervals));
  if (!(problem.duration_s > 0.0) || !std::isfinite(problem.duration_s))
    refuse(fmt::format("a duration of {} s given, expected a positive number", problem.duration_s));
  if (problem.objective == Objective::time && problem.duration_s < least_duration_s)
    refuse(fmt::format("a duration of {} s given for the first guess, expected at least {} s",
                       problem.duration_s, least_duration_s));
  check_not_negative("margin", problem.margin_m);
  check_not_negative("reserve of the margin", problem.reserve_m);
  check_not_negative("weight of the effort beside the time", problem.time_effort_weight);
  if (!std::isfinite(problem.begin_s))
    refuse(fmt::format("begins at {} s, expected a finite time", problem.begin_s));
  if (problem.clearance_points < 1)
    refuse(fmt::format("{} points of clearance per interval given, expected at least 1",
                       problem.clearance_points));
  check_size("lower position limits", limits.position_min, n, true);
  check_size("upper position limits", limits.position_max, limits.position_min.size(), false);
  check_bounds("velocity limits", limits.velocity, n);
  check_bounds("acceleration limits", limits.acceleration, n);
  check_bounds("jerk limits", limits.jerk, n);
  check_bounds("torque limits", limits.torque, n);
  check_torque_reserve(problem);
  check_bounds("weights of the effort", problem.effort_weights, n);
  for (const End& end : {End{"start", problem.q_start, problem.v_start},
                         End{"goal", problem.q_goal, problem.v_goal}}) {
    check_end(problem, end);
    check_clearance(problem, end);
  }
}

}  // namespace hamelin::optimal
