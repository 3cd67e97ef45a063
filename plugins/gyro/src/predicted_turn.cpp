#include "predicted_turn.hpp"

#include <string>

namespace hamelin::gyro {

namespace {

// Gain with which the velocity follows the attraction [1/s], and its largest joint acceleration
// [rad/s² or m/s²]. The difference from that of the drive is a reserve for obstacles.
constexpr double velocity_gain = 10.0, drive_acceleration = 6.0;
// A horizon under sampled actuation lowers the gain for delay and noise [s].
constexpr double horizon_s = 0.01;

reactive::LawParams law_params(const Json& params) {
  return {.cruise_speed = params.at("cruise_speed")};
}

}  // namespace

PredictedTurn::PredictedTurn(const planning::Host& host, const planning::Setup& setup,
                             const Json& params)
    : setup_(setup),
      model_(setup.model()),
      law_(setup, model_, law_params(params)),
      drive_(setup, model_, radius_m, horizon_s),
      surroundings_(host, setup),
      margins_(setup, reactive::margins_in_scene(setup, {})),
      rest_(setup),
      u_(Eigen::VectorXd::Zero(setup.dof())) {
  const std::string turns = params.at("turns");
  if (turns == "none") return;
  steering_.emplace(host, setup_, model_, law_params(params), margins_,
                    reactive::SteeringParams{reactive::turn_kinds(turns)});
  series_ = host.declare_series("turn", "s");
}

void PredictedTurn::start(const planning::Tick& tick) {
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
  if (goal_number_ != tick.goal_number()) start(tick);
  drive_.update(tick);
  const hamelin_goal& goal = tick.goal();
  margins_.set(drive_.points(), law_.margin_weight(model_, drive_.ws(), drive_.q(), goal));
  law_.attract(model_, drive_.ws(), drive_.q(), {&goal}, u_);
  u_ *= tick.speed_scale();
  if (steering_) steer(tick, command);
  drive_.accelerate(u_, drive_.coasting_velocity(), velocity_gain, drive_acceleration);
  drive_.begin_filter({}, [](const reactive::NearPoint&) { return 0.0; });
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
