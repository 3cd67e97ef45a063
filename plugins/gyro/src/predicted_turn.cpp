#include "predicted_turn.hpp"

#include <algorithm>
#include <string>

namespace hamelin::gyro {

namespace {

// Attraction near a goal of the joints and of the tip [1/s], and its speeds towards one of the tip.
constexpr double joint_gain = 4.0, tip_gain = 3.0, tip_speed_m_s = 0.5, tip_turn_rad_s = 1.5;
// Gain with which the velocity follows the attraction [1/s], and its largest joint acceleration
// [rad/s² or m/s²]. The difference from acceleration_max is a reserve for obstacles.
constexpr double velocity_gain = 10.0, drive_acceleration = 6.0, acceleration_max = 15.0;
constexpr int filter_passes = 12;
// What is kept of obstacles [m]: far from the goal, at a goal of the tip, and how much less than
// the clearance there at a goal of the joints; between parts of the arm.
constexpr double full_margin_m = 0.01, goal_margin_m = 0.003, self_margin_m = 0.005,
                 beyond_shield_m = 0.002;
constexpr double voxel_at_goal = 0.4;  // share of a voxel that is kept near a tip goal
// A horizon under sampled actuation lowers the gain for delay and noise [s].
constexpr double horizon_s = 0.01;

reactive::MarginParams margin_params(const planning::Setup& setup) {
  const double voxel = setup.map_resolution_m(), full = std::max(full_margin_m, voxel);
  return {full, std::min(std::max(goal_margin_m, voxel_at_goal * voxel), full), goal_margin_m,
          std::max(self_margin_m, setup.shield_self_margin_m() + beyond_shield_m)};
}

reactive::LawParams law_params(const Json& params) {
  return {joint_gain, tip_gain, params.at("cruise_speed"), tip_speed_m_s, tip_turn_rad_s, 0.0, 0.0};
}

reactive::SteeringParams steering_params(const Json& params) {
  using reactive::TurnKinds;
  const std::string kinds = params.at("turns");
  if (kinds == "tangents") return {TurnKinds::tangents};
  return {kinds == "axes" ? TurnKinds::axes : TurnKinds::all};
}

}  // namespace

PredictedTurn::PredictedTurn(const planning::Host& host, const planning::Setup& setup,
                             const Json& params)
    : setup_(setup),
      model_(setup.model()),
      law_(setup, model_, law_params(params)),
      drive_(setup, model_, radius_m, horizon_s),
      surroundings_(host, setup, model_),
      margins_(setup, margin_params(setup)),
      rest_(setup),
      u_(Eigen::VectorXd::Zero(setup.dof())) {
  drive_.set_params({acceleration_max, filter_passes});
  if (params.at("turns") == "none") return;
  steering_.emplace(host, setup_, model_, law_params(params), margins_, steering_params(params));
  series_ = host.declare_series("turn", "s");
}

void PredictedTurn::start(const planning::Tick& tick) {
  started_ = true;
  goal_number_ = tick.goal_number();
  margins_.set_goal(surroundings_, tick.goal(), radius_m);
  if (steering_) steering_->restart();
}

void PredictedTurn::steer(const planning::Tick& tick, planning::Command& command) {
  const double distance = law_.distance(model_, drive_.ws(), drive_.q(), {&tick.goal()});
  steering_->advance(tick.time_s(), drive_.q(), distance, tick.goal(), tick.moving_count() > 0);
  steering_->apply(drive_.M(), u_);
  command.set_series(series_, steering_->turn().left_s);
}

void PredictedTurn::tick(const planning::Tick& tick, planning::Command& command) {
  if (!started_ || goal_number_ != tick.goal_number()) start(tick);
  drive_.update(tick);
  const hamelin_goal& goal = tick.goal();
  margins_.set(drive_.points(), law_.margin_weight(model_, drive_.ws(), drive_.q(), goal));
  law_.attract(model_, drive_.ws(), drive_.q(), {&goal}, u_);
  u_ *= tick.speed_scale();
  if (steering_) steer(tick, command);
  drive_.accelerate(u_, drive_.coasting_velocity(), velocity_gain, drive_acceleration);
  const reactive::Pace pace;
  drive_.begin_filter(pace);
  drive_.add_points(pace, [](const reactive::NearPoint&) { return 0.0; });
  drive_.apply(command);
  check_end(tick, command);
}

void PredictedTurn::check_end(const planning::Tick& tick, planning::Command& command) {
  if (!steering_)
    return rest_.check(tick, law_.within(model_, drive_.ws(), drive_.q(), tick.goal(), 1.0),
                       command);
  command.disable_stall_rule();
  if (steering_->looks_in_vain() >= reactive::Steering::looks_enough)
    command.give_up("force balance: no turn that was predicted leads nearer to the goal");
}

}  // namespace hamelin::gyro
