#include "loop/stop.hpp"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "hamelin/control/preparation.hpp"

namespace hamelin::control {

using Eigen::Index;
using Eigen::VectorXd;

namespace {

// Feedback that is faster than the steps would oscillate [1/s].
constexpr double usual_feedback_rate = 50.0, feedback_per_step = 0.2;

}  // namespace

double Stop::feedback_rate(double period_s) noexcept {
  return std::min(usual_feedback_rate, feedback_per_step / period_s);
}

Stop::Stop(const scene::Scene& scene, const model::Model& model, double period_s,
           const ChangeBounds& changes, StopFinder& finder, Straying* straying)
    : model_(model),
      finder_(finder),
      straying_(straying),
      sampled_(scene.actuation.type != scene::ActuationType::ideal),
      period_s_(period_s),
      feedback_rate_(feedback_rate(period_s)),
      torque_rate_(changes.torque_rate),
      effort_max_(modelled_limits(scene, model.robot()).effort_max),
      damping_(joint_numbers(scene, scene.model.joint_damping, "joint_damping", model.robot(),
                             &model::Joint::damping)),
      friction_(joint_numbers(scene, scene.model.friction, "friction", model.robot(),
                              &model::Joint::friction)),
      friction_speed_(scene.model.friction_speed),
      unknown_friction_(unknown_friction(scene, model.robot())),
      motion_(model.dof()),
      other_(model.dof()),
      ws_(model) {
  for (auto* x : {&integral_, &reference_q_, &reference_v_, &q_, &v_, &rate_, &acceleration_})
    x->setZero(model.dof());
  stray_ = VectorXd::Constant(model.dof(), std::numeric_limits<double>::infinity());
  if (straying_ != nullptr) bounds_ = straying_->bounds();
}

void Stop::begin(FailSafe& motion, const Straying::Bounds& bounds) {
  std::swap(motion_, motion);
  bounds_ = bounds;
  stray_ = bounds_.tracking + bounds_.errors;
  time_s_ = 0.0;
}

void Stop::begin(const StopFinder::Start& start) {
  if (!finder_.find(start, BrakingRate::usual_utilisation, motion_)) finder_.force(start, motion_);
  time_s_ = 0.0;
}

void Stop::turn_to(FailSafe& motion, double from_s, const Straying::Bounds& more) {
  std::swap(motion_, motion);
  bounds_.include(more);
  stray_ = bounds_.tracking + bounds_.errors;
  time_s_ = from_s;
}

// Whether the bounds that the scene states hold can be seen by what a stop does.
void Stop::note_straying(Index joint, double strayed) {
  strayed_.most = std::max(strayed_.most, strayed);
  const double bound = stray_[joint];
  if (!(strayed > strayed_.share * bound)) return;
  strayed_.share = strayed / bound;
  strayed_.joint = static_cast<int>(joint);
}

void Stop::torque(const Node& node, const VectorXd& disturbance, const VectorXd& last,
                  VectorXd& torque) {
  follow(node, disturbance, torque);
  if (is_lost(node, torque, last)) {
    begin_again(node, disturbance, last);
    follow(node, disturbance, torque);
  }
  time_s_ += period_s_;
}

void Stop::follow(const Node& node, const VectorXd& disturbance, VectorXd& torque) {
  const double middle = time_s_ + 0.5 * period_s_, end = time_s_ + period_s_;
  motion_.at(time_s_, reference_q_, reference_v_);
  for (Index j = 0; straying_ != nullptr && j < node.q.size(); ++j)
    note_straying(j, std::abs(node.q[j] - reference_q_[j]));
  feed_back(node);
  motion_.at(end, q_, v_);
  rate_ += (v_ - reference_v_) / period_s_;
  if (!at_rest()) rate_ -= disturbance;
  motion_.at(middle, q_, v_);
  dynamics::inverse_dynamics(model_, ws_, q_, v_, rate_, torque);
  if (at_rest()) resist(disturbance, torque);
  if (damping_.size() > 0) torque += damping_.cwiseProduct(v_);
  if (friction_.size() > 0)
    torque.array() += friction_.array() * (v_ / friction_speed_).array().tanh();
  if (effort_max_.size() > 0) torque = torque.cwiseMin(effort_max_).cwiseMax(-effort_max_);
}

// docs/theory.md (14.15): friction holds an arm that rests, so what may be friction is left to it.
// An integral against it would make the arm swing slowly.
void Stop::resist(const VectorXd& disturbance, VectorXd& torque) {
  dynamics::momentum(model_, ws_, q_, disturbance, rate_);
  torque -= rate_ - rate_.cwiseMin(unknown_friction_).cwiseMax(-unknown_friction_);
}

// docs/theory.md (14.14): ideal actuation has no estimate of what the model does not explain, but
// an integral.
void Stop::feed_back(const Node& node) {
  const double w = feedback_rate_;
  if (sampled_) {
    rate_ = w * (w * (reference_q_ - node.q) + 2.0 * (reference_v_ - node.v));
    return;
  }
  if (time_s_ == 0.0) integral_.setZero();
  integral_ += w * period_s_ * (reference_q_ - node.q);
  rate_ = w * (w * (3.0 * (reference_q_ - node.q) + integral_) + 3.0 * (reference_v_ - node.v));
}

bool Stop::is_lost(const Node& node, const VectorXd& torque, const VectorXd& last) const {
  return torque_rate_ > 0.0 &&
         (torque - last).lpNorm<Eigen::Infinity>() > torque_rate_ / feedback_rate_ &&
         ((node.q - reference_q_).cwiseAbs().array() > stray_.array()).any();
}

// Feedback that asks for more than the drives can follow makes the arm swing, docs/theory.md
// (14.23). Where the stop ends now is as far from the verified one as the arm has strayed.
void Stop::begin_again(const Node& node, const VectorXd& disturbance, const VectorXd& last) {
  dynamics::forward_dynamics(model_, ws_, node.q, node.v, last, acceleration_);
  acceleration_ += disturbance;
  if (!finder_.find({node.q, node.v, acceleration_, last, disturbance},
                    BrakingRate::usual_utilisation, other_))
    return;
  for (Index j = 0; j < node.q.size(); ++j)
    note_straying(j, std::abs(other_.end()[j] - motion_.end()[j]));
  std::swap(motion_, other_);
  straying_->bound(motion_.stop());
  bounds_ = straying_->bounds();
  time_s_ = 0.0;
}

void Stop::point(VectorXd& q, VectorXd& v) {
  time_s_ += period_s_;
  motion_.at(time_s_, q, v);
}

}  // namespace hamelin::control
