#include "hamelin/reactive/rollout.hpp"

#include <algorithm>
#include <cmath>
#include <limits>

namespace hamelin::reactive {

namespace {

constexpr int idle_steps = 6;       // more steps without progress end the rollout
constexpr double progress = 0.01;   // smallest new best of the distance
constexpr double goal_share = 0.8;  // share of the goal's tolerances for arrival

}  // namespace

Rollout::Rollout(const planning::Setup& setup, const model::Model& model, const LawParams& law,
                 const Margins& margins, Surroundings& surroundings)
    : model_(model),
      ws_(model),
      law_(setup, model, law),
      params_(law),
      glide_(setup, model, margins, surroundings),
      identity_(Eigen::MatrixXd::Identity(setup.dof(), setup.dof())) {
  for (auto* x : {&q_, &to_, &u_}) *x = Eigen::VectorXd::Zero(setup.dof());
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
  return law_.within(model_, glide_.ws(), q_, *goal_, goal_share);
}

Rollout::Step Rollout::step() {
  if (!glide_.place(q_, -1.0, Obstacles::self_radius_m)) return Step::touched;
  const Target target{goal_, to_goal_ ? nullptr : &to_};
  distance_ = law_.distance(model_, glide_.ws(), q_, target);
  if (arrived(target)) return Step::arrived;
  if (distance_ < best_ - progress) {
    best_ = distance_;
    idle_ = 0;
  } else if (++idle_ > idle_steps) {
    return Step::ended;
  }
  if (steps_left_-- == 0) return Step::ended;
  if (to_goal_ && goal_->type != HAMELIN_GOAL_JOINT) {
    law_.attract(model_, glide_.ws(), q_, target, u_);
  } else {
    u_ = to_ - q_;
    if (to_goal_) u_ = planning::ConstVectorMap(goal_->q, q_.size()) - q_;
    const double error = u_.norm();
    u_ *= std::min(params_.cruise_speed, error / Glide::step_s) / std::max(error, 1e-9);
  }
  glide_.filter(law_.margin_weight(model_, glide_.ws(), q_, *goal_), identity_, identity_, u_);
  q_ += Glide::step_s * u_;
  return Step::moved;
}

}  // namespace hamelin::reactive
