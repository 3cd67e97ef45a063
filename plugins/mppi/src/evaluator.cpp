#include "evaluator.hpp"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "cost_to_go.hpp"

namespace hamelin::mppi {

namespace {

using Eigen::Index;

constexpr double torque_share = 0.95;     // of the torque limits, for rollouts
constexpr double torque_weight_s = 20.0;  // of the mean square excess
constexpr double collision_s = 50.0;      // cost of a collision at the horizon's end; twice at once
constexpr Index progress_stride = 3;      // knots at which the time to go is evaluated
// Speeds that convert errors of the tip to times [m/s, rad/s].
constexpr double tip_speed = 0.6, tip_turn = 1.5;
// Distance kept from moving obstacles, in addition to the margin [m].
constexpr double mover_margin_m = 0.02;
constexpr std::size_t splits = 3;  // how often a part is divided that is not proved clear

// The largest travel of a joint from zero [m].
double travel(const planning::Setup& setup, Index j) {
  const auto lower = setup.q_lower(), upper = setup.q_upper();
  if (!lower || !upper) return std::numeric_limits<double>::infinity();
  return std::max(std::abs((*lower)[j]), std::abs((*upper)[j]));
}

// For each joint, an upper bound of how far it moves any point of the arm's shapes or its tip per
// radian, or 1 for a prismatic joint [m].
Eigen::VectorXd levers(const planning::Setup& setup, const model::Model& model) {
  const int n = model.dof();
  dynamics::Workspace ws(model);
  dynamics::forward_kinematics(model, ws, Eigen::VectorXd::Zero(n));
  const auto origin = [&](int j) { return ws.frames[static_cast<std::size_t>(j)].p; };
  Eigen::VectorXd lever = Eigen::VectorXd::Zero(n);
  double reach = 0.0;  // the largest distance of any point beyond from the joint's origin
  for (int j = n - 1; j >= 0; --j) {
    reach = j + 1 < n ? reach + (origin(j + 1) - origin(j)).norm()
                      : (dynamics::tip_pose(model, ws).p() - origin(j)).norm();
    for (const auto& shape : model.shapes())
      if (shape.link == j)
        reach = std::max(reach, std::max((shape.center - shape.half_axis).norm(),
                                         (shape.center + shape.half_axis).norm()) +
                                    shape.radius);
    const bool prismatic =
        model.robot().links[static_cast<std::size_t>(j)].joint.type == model::JointType::prismatic;
    lever[j] = prismatic ? 1.0 : reach;
    if (prismatic) reach += travel(setup, j);
  }
  return lever;
}

}  // namespace

Evaluator::Evaluator(const planning::Host& host, const planning::Setup& setup,
                     const model::Model& model, Index point_count)
    : setup_(setup),
      model_(model),
      ws_(model),
      batch_(model),
      query_(host),
      levers_(levers(setup, model)),
      dof_(model.dof()),
      segments_(point_count - 3),
      halves_(lane_count, dof_ * (2 * segments_ + 1)),
      paths_(lane_count, 2 * segments_ + 1),
      at_(Eigen::VectorXd::Zero(dof_)),
      from_(at_),
      middles_(splits, JointState(dof_)),
      single_(dof_, point_count) {
  for (auto* x : {&q_, &v_, &a_, &torque_})
    *x = dynamics::StatesXd::Zero(dof_, (segments_ + 1) * lane_count);
}

void Evaluator::begin(const Task& task, Rollouts& rollouts) {
  rollouts.cost.setZero();
  rollouts.clearance_m.setConstant(setup_.influence_m());
  place(rollouts, task.spacing_s);
  add_torques(task, rollouts);
}

void Evaluator::evaluate(const Task& task, Rollouts& rollouts, Index lane) {
  add_progress(task, rollouts, lane);
  add_clearance(task, rollouts, lane);
}

// States at the knots and places between them, docs/theory.md (15.1).
void Evaluator::place(const Rollouts& rollouts, double spacing_s) {
  spacing_s_ = spacing_s;
  const Index halves = 2 * segments_ + 1;
  paths_.setZero();
  for (Index j = 0; j < dof_; ++j) {
    for (Index i = 0; i <= segments_; ++i) {
      const Lanes p0 = rollouts.point(j, i), p1 = rollouts.point(j, i + 1),
                  p2 = rollouts.point(j, i + 2), q = (p0 + 4.0 * p1 + p2) / 6.0;
      q_.row(j).segment<lane_count>(i * lane_count) = q.matrix().transpose();
      v_.row(j).segment<lane_count>(i * lane_count) =
          ((p2 - p0) / (2.0 * spacing_s)).matrix().transpose();
      a_.row(j).segment<lane_count>(i * lane_count) =
          ((p0 - 2.0 * p1 + p2) / (spacing_s * spacing_s)).matrix().transpose();
      halves_.col(j * halves + 2 * i) = q;
      if (i < segments_)
        halves_.col(j * halves + 2 * i + 1) =
            (p0 + 23.0 * p1 + 23.0 * p2 + rollouts.point(j, i + 3)) / 48.0;
    }
    for (Index h = 1; h < halves; ++h)
      paths_.col(h) +=
          levers_[j] * (halves_.col(j * halves + h) - halves_.col(j * halves + h - 1)).abs();
  }
}

// docs/theory.md (15.9), (15.10)
void Evaluator::add_torques(const Task& task, Rollouts& rollouts) {
  const double share = 1.0 / static_cast<double>(segments_ + 1);
  const auto effort = setup_.effort_max();
  if (effort) dynamics::inverse_dynamics(model_, batch_, q_, v_, a_, torque_);
  for (Index j = 0; j < dof_; ++j) {
    const double a_max = task.limits.change[j] / (task.spacing_s * task.spacing_s);
    for (Index i = 0; i <= segments_; ++i) {
      const Lanes a = a_.row(j).segment<lane_count>(i * lane_count).transpose().array() / a_max;
      rollouts.cost += task.cost.smoothness_s * share * a.square();
      if (!effort || !std::isfinite((*effort)[j])) continue;
      const Lanes excess =
          (torque_.row(j).segment<lane_count>(i * lane_count).transpose().array().abs() /
               (torque_share * (*effort)[j]) -
           1.0)
              .max(0.0);
      rollouts.cost += torque_weight_s * share * excess.square();
    }
  }
}

double Evaluator::time_to_go(const Task& task, const Eigen::VectorXd& q) {
  if (!task.tip_cost)
    return cost_to_go(task.path, q, task.path_from, task.path_to).cost / task.cruise_speed;
  dynamics::forward_kinematics(model_, ws_, q);
  const geometry::SE3 tip = dynamics::tip_pose(model_, ws_);
  const double error = (task.goal.position - tip.p()).norm() / tip_speed;
  if (task.goal.type != HAMELIN_GOAL_POSE) return error;
  return error + Eigen::AngleAxisd(task.goal.rotation * tip.R().transpose()).angle() / tip_turn;
}

// docs/theory.md (15.6)
void Evaluator::add_progress(const Task& task, Rollouts& rollouts, Index lane) {
  double sum = 0.0, last = 0.0;
  int count = 0;
  for (Index i = segments_; i > 0; i -= progress_stride, ++count) {
    get_place(2 * i, lane);
    const double time = time_to_go(task, at_);
    if (count == 0) last = time;
    sum += time;
  }
  rollouts.cost[lane] += last + sum / count;
}

void Evaluator::get_place(Index half, Index lane) {
  for (Index j = 0; j < dof_; ++j) at_[j] = halves_(lane, j * (2 * segments_ + 1) + half);
}

double Evaluator::clearance(const Eigen::VectorXd& q, double time_ahead_s, double at_least_m) {
  return query_.clearance({q.data(), static_cast<std::size_t>(q.size())}, time_ahead_s, at_least_m);
}

// docs/theory.md (15.8), (15.11). Where nothing moves, places that a larger clearance before them
// covers are not queried.
void Evaluator::add_clearance(const Task& task, Rollouts& rollouts, Index lane) {
  const double half_s = 0.5 * task.spacing_s;
  const double horizon = static_cast<double>(2 * segments_);
  double known = task.start_clearance_m, travelled = 0.0;
  rollouts.collides[static_cast<std::size_t>(lane)] = false;
  if (task.moving) return add_mover_clearance(task, rollouts, lane);
  for (Index h = 1; h <= 2 * segments_; ++h) {
    travelled += paths_(lane, h);
    if (paths_(lane, h) == 0.0 || travelled <= known - task.margins.range()) continue;
    get_place(h, lane);
    const auto required = task.margins.required(at_);
    const double margin = required.margin_m;
    const double distance =
        clearance(at_, task.spacing_s + static_cast<double>(h) * half_s, margin);
    rollouts.clearance_m[lane] = std::min(rollouts.clearance_m[lane], distance);
    if (distance < margin) {
      rollouts.collides[static_cast<std::size_t>(lane)] = true;
      rollouts.cost[lane] += collision_s * (2.0 - static_cast<double>(h) / horizon);
      return;
    }
    if (distance < required.range_m) {
      const double lack = (required.range_m - distance) / std::max(1e-3, required.range_m - margin);
      rollouts.cost[lane] += task.cost.clearance_s * lack * lack / horizon;
    }
    known = distance;
    travelled = 0.0;
  }
}

// Obstacles that move may leave no rollout its margins, so all lacks count, at all knots:
// docs/theory.md (15.17).
void Evaluator::add_mover_clearance(const Task& task, Rollouts& rollouts, Index lane) {
  const double share = 1.0 / static_cast<double>(segments_);
  for (Index i = 1; i <= segments_; ++i) {
    get_place(2 * i, lane);
    const auto required = task.margins.required(at_);
    const double margin =
        std::min(required.margin_m + mover_margin_m, std::max(required.margin_m, required.range_m));
    const double time_s = static_cast<double>(i + 1) * task.spacing_s;
    const double distance = clearance(at_, time_s, -mover_margin_m);
    rollouts.clearance_m[lane] = std::min(rollouts.clearance_m[lane], distance);
    if (distance < required.margin_m) rollouts.collides[static_cast<std::size_t>(lane)] = true;
    const double lack = std::clamp((margin - distance) / margin, 0.0, 2.0);
    rollouts.cost[lane] += share * 2.0 * collision_s * lack;
  }
}

// The first three knots are those of the plan before.
bool Evaluator::within_torques() {
  const auto effort = setup_.effort_max();
  if (!effort) return true;
  dynamics::inverse_dynamics(model_, batch_, q_, v_, a_, torque_);
  for (Index j = 0; j < dof_; ++j)
    for (Index i = 3; i <= segments_; ++i)
      if (std::abs(torque_(j, i * lane_count)) > (*effort)[j]) return false;
  return true;
}

// Whether a part of a segment is proved clear: its chord, with room for the difference between
// spline and chord. If it is not, both halves may be.
bool Evaluator::proved_clear(const Eigen::MatrixXd& points, Index segment, Part part,
                             const Eigen::VectorXd& from, const Eigen::VectorXd& to,
                             std::size_t depth) {
  const std::size_t n = static_cast<std::size_t>(dof_);
  const double duration_s = (part.to - part.from) * spacing_s_;
  double bend = 0.0, proved = 0.0;
  for (Index j = 0; j < dof_; ++j)
    bend += levers_[j] *
            std::max(std::abs(a_(j, segment * lane_count)),
                     std::abs(a_(j, (segment + 1) * lane_count))) *
            duration_s * duration_s / 8.0;
  const auto time_s = [&](double u) {
    return (1.0 + static_cast<double>(segment) + u) * spacing_s_;
  };
  if (query_.motion_clear({from.data(), n}, {to.data(), n}, time_s(part.from), time_s(part.to),
                          &proved) &&
      proved >= bend)
    return true;
  if (depth == 0) return false;
  JointState& middle = middles_[depth - 1];
  const double u = 0.5 * (part.from + part.to);
  mppi::evaluate(points, segment, u, spacing_s_, middle);
  return proved_clear(points, segment, {part.from, u}, from, middle.q, depth - 1) &&
         proved_clear(points, segment, {u, part.to}, middle.q, to, depth - 1);
}

bool Evaluator::verify(const Task& task, const Eigen::MatrixXd& points) {
  single_.set_lane(0, points);
  place(single_, task.spacing_s);
  if (!within_torques()) return false;
  const double half_s = 0.5 * task.spacing_s;
  get_place(0, 0);
  from_ = at_;
  double before = task.start_clearance_m;
  for (Index h = 1; h <= 2 * segments_; ++h) {
    if (!task.moving && paths_(0, h) == 0.0) continue;
    get_place(h, 0);
    const double time_s = task.spacing_s + static_cast<double>(h) * half_s;
    const double margin = task.margins.required(at_).margin_m;
    const double distance = clearance(at_, time_s, margin);
    if (distance < margin) return false;
    // The balls of both clearances cover the way between, or else a certificate proves it.
    const double u = 0.5 * static_cast<double>((h - 1) % 2);
    if ((task.moving || before + distance <= paths_(0, h)) &&
        !proved_clear(points, (h - 1) / 2, {u, u + 0.5}, from_, at_, splits))
      return false;
    before = distance;
    from_ = at_;
  }
  return true;
}

}  // namespace hamelin::mppi
