#include "hamelin/reactive/rollout.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::reactive {

namespace {

constexpr double step_s = 0.06;        // long steps are possible without dynamics
constexpr double radius_m = 0.07;      // obstacles beyond this distance are ignored
constexpr double rate = 8.0;           // speed per distance from obstacles and joint limits [1/s]
constexpr int passes = 12;             // of the filter
constexpr int idle_steps = 6;          // more steps without progress end the rollout
constexpr double progress = 0.01;      // smallest new best of the distance
constexpr double touching_m = -0.002;  // configurations with a smaller distance are discarded
constexpr double goal_share = 0.8;     // share of the goal's tolerances for arrival

}  // namespace

Rollout::Rollout(const planning::Setup& setup, const model::Model& model, const LawParams& law,
                 const Margins& margins, Surroundings& surroundings)
    : setup_(setup),
      model_(model),
      margins_(margins),
      surroundings_(surroundings),
      ws_(model),
      law_(setup, model, law),
      params_(law),
      obstacles_(setup, radius_m),
      filter_(setup.dof(), Obstacles::max_points),
      identity_(Eigen::MatrixXd::Identity(setup.dof(), setup.dof())) {
  for (auto* x : {&q_, &to_, &u_, &lower_, &upper_}) *x = Eigen::VectorXd::Zero(setup.dof());
}

void Rollout::start(const Eigen::VectorXd& q, int steps) {
  q_ = q;
  steps_left_ = steps;
  idle_ = 0;
  best_ = std::numeric_limits<double>::infinity();
}

void Rollout::begin(const Eigen::VectorXd& q, const Eigen::VectorXd& to, int steps,
                    double tolerance) {
  start(q, steps);
  to_ = to;
  to_goal_ = false;
  tolerance_ = tolerance;
}

void Rollout::begin(const Eigen::VectorXd& q, int steps) {
  start(q, steps);
  to_goal_ = true;
}

double Rollout::goal_distance(const Eigen::VectorXd& q) {
  dynamics::forward_kinematics(model_, ws_, q);
  return law_.distance(model_, ws_, q, {goal_, nullptr});
}

bool Rollout::arrived(const Target& target) const {
  if (target.via != nullptr) return (*target.via - q_).lpNorm<Eigen::Infinity>() < tolerance_;
  return law_.within(model_, ws_, q_, *goal_, goal_share);
}

Rollout::Step Rollout::step() {
  dynamics::forward_kinematics(model_, ws_, q_);
  surroundings_.query(q_, radius_m, Obstacles::self_radius_m);
  obstacles_.update(model_, ws_, surroundings_.contacts(), surroundings_.self_contacts());
  if (obstacles_.clearance() < touching_m) return Step::touched;
  const Target target{goal_, to_goal_ ? nullptr : &to_};
  distance_ = law_.distance(model_, ws_, q_, target);
  if (arrived(target)) return Step::arrived;
  if (distance_ < best_ - progress) {
    best_ = distance_;
    idle_ = 0;
  } else if (++idle_ > idle_steps) {
    return Step::ended;
  }
  if (steps_left_-- == 0) return Step::ended;
  margins_.set(obstacles_.points(), law_.margin_weight(model_, ws_, q_, *goal_));
  if (to_goal_ && goal_->type != HAMELIN_GOAL_JOINT) {
    law_.attract(model_, ws_, q_, target, u_);
  } else {
    u_ = to_ - q_;
    if (to_goal_) u_ = planning::ConstVectorMap(goal_->q, q_.size()) - q_;
    const double error = u_.norm();
    u_ *= std::min(params_.cruise_speed, error / step_s) / std::max(error, 1e-9);
  }
  filter();
  q_ += step_s * u_;
  return Step::moved;
}

void Rollout::filter() {
  filter_.begin(identity_, identity_);
  for (const auto& point : obstacles_.points()) {
    const double x = point.distance - point.margin;
    (void)filter_.add_row(point.row, -rate * x,
                          -rate * std::max(1e-9, point.distance - 0.5 * point.margin));
  }
  lower_.setConstant(-std::numeric_limits<double>::infinity());
  upper_ = -lower_;
  if (const auto limit = setup_.velocity_max()) {
    double excess = 1.0;
    for (Eigen::Index k = 0; k < u_.size(); ++k)
      excess = std::max(excess, std::abs(u_[k]) / (*limit)[k]);
    u_ /= excess;
    lower_ = -*limit;
    upper_ = *limit;
  }
  if (const auto limit = setup_.q_lower())
    lower_ = lower_.cwiseMax(rate * (*limit - q_).cwiseMin(0.0));
  if (const auto limit = setup_.q_upper())
    upper_ = upper_.cwiseMin(rate * (*limit - q_).cwiseMax(0.0));
  filter_.set_box(lower_, upper_);
  (void)filter_.project(u_, passes);
}

}  // namespace hamelin::reactive
