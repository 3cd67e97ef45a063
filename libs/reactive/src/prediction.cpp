#include "hamelin/reactive/prediction.hpp"

#include <Eigen/Geometry>
#include <algorithm>

namespace hamelin::reactive {

namespace {

constexpr int steps_max = 80;                 // of a prediction: 4.8 s
constexpr int predicted_idle_steps = 6;       // more steps without progress are a stall
constexpr double predicted_progress = 0.01;   // smallest new best of the distance
constexpr double predicted_goal_share = 0.8;  // share of the goal's tolerances for arrival
constexpr double self_radius_m = 0.05;
constexpr double foreseen_s = 1.0;  // what moves is not predicted farther ahead

// Steps are long, and the arm need not slow down before the goal.
LawParams ahead(LawParams law) {
  law.joint_gain = 1.0 / Glide::step_s;
  law.tip_gain = 0.5 / Glide::step_s;
  return law;
}

}  // namespace

Prediction::Prediction(const planning::Setup& setup, const model::Model& model,
                       const LawParams& law, const PointMargins& margins,
                       Surroundings& surroundings)
    : model_(model),
      law_(setup, model, ahead(law)),
      params_(law),
      glide_(setup, model, margins, surroundings),
      turner_(setup.dof()),
      ws_(model),
      inertia_(setup.dof()) {
  const int n = setup.dof();
  q_ = u_ = end_ = Jt_ = turn_.direction = Eigen::VectorXd::Zero(n);
  J_.setZero(3, n);
}

void Prediction::set_params(const LawParams& law) noexcept {
  law_.set_params(ahead(law));
  params_ = law;
}

void Prediction::begin(const Eigen::VectorXd& q, const hamelin_goal& goal, const Turn& turn,
                       bool moving) {
  q_ = q;
  goal_ = &goal;
  turn_ = turn;
  moving_ = moving;
  arrives_ = false;
  step_ = idle_ = 0;
  best_ = infinity;
}

bool Prediction::step() {
  const double ahead_s = moving_ && time_s() < foreseen_s ? time_s() : -1.0;
  if (!glide_.place(q_, ahead_s, self_radius_m)) return finish(false);
  if (law_.within(model_, glide_.ws(), q_, *goal_, predicted_goal_share)) return finish(true);
  const double distance = law_.distance(model_, glide_.ws(), q_, {goal_});
  if (!turn_.on()) note_distance(distance);
  inertia_.update(model_, ws_, q_);
  set_velocity();
  law_.repel(glide_.points(), std::min(1.0, distance), u_);
  glide_.filter(law_.margin_weight(model_, glide_.ws(), q_, *goal_), inertia_.M(), inertia_.W(),
                u_);
  if (idle_ > predicted_idle_steps || ++step_ == steps_max) return finish(false);
  q_ += Glide::step_s * u_;
  turn_.left_s -= Glide::step_s;
  return true;
}

void Prediction::note_distance(double distance) {
  if (distance < best_ - predicted_progress) {
    best_ = distance;
    end_ = q_;
    idle_ = 0;
  } else {
    ++idle_;
  }
}

void Prediction::set_velocity() {
  law_.attract(model_, glide_.ws(), q_, {goal_}, u_);
  if (!turn_.on()) return;
  turner_.apply(turn_, inertia_.M(), params_.cruise_speed, u_);
}

int Prediction::sideways(Eigen::MatrixXd& directions) {
  const auto points = glide_.points();
  int count = 0, first = -1;
  for (int pick = 0; pick < 2; ++pick) {
    int worst = -1;
    for (int i = 0; i < static_cast<int>(points.size()); ++i) {
      const double held = glide_.multiplier(static_cast<std::size_t>(i));
      if (i == first || held <= 0.0) continue;
      if (worst < 0 || held > glide_.multiplier(static_cast<std::size_t>(worst))) worst = i;
    }
    if (worst < 0) return count;
    first = worst;
    const NearPoint& point = points[static_cast<std::size_t>(worst)];
    const Eigen::Vector3d t = point.direction.unitOrthogonal();
    dynamics::point_jacobian(model_, glide_.ws(), point.link, point.arm_point, J_);
    Jt_.noalias() = J_.transpose() * t;
    directions.col(count++).noalias() = inertia_.W() * Jt_;
    Jt_.noalias() = J_.transpose() * point.direction.cross(t);
    directions.col(count++).noalias() = inertia_.W() * Jt_;
  }
  return count;
}

}  // namespace hamelin::reactive
