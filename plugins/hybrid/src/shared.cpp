#include "shared.hpp"

#include <string>

namespace hamelin::hybrid {

Shared::Shared(const planning::Host& host_of_planner, const planning::Setup& setup_of_run,
               const Json& params)
    : host(host_of_planner),
      setup(setup_of_run),
      model(setup.model()),
      tuning(setup, params),
      law(setup, model, tuning.law),
      drive(setup, model, params["contact_radius_m"], params["horizon_s"]),
      surroundings(host, setup),
      margins(setup, tuning.margins),
      evader(host, setup, model, law, margins),
      stall(tuning.stall_time_s),
      asks(params["escape"] == "search"),
      path(setup.dof(), static_cast<Eigen::Index>(setup.path_points_max())),
      via(Eigen::VectorXd::Zero(setup.dof())),
      u(via),
      lower(via),
      upper(via),
      follower(setup, model) {
  if (params["steering"].get<bool>()) {
    steering =
        std::make_unique<Steering>(host, setup, model, tuning.law, margins,
                                   SteeringParams{turn_kinds(params["turns"].get<std::string>())});
  }
  set_tuning(tuning);
}

void Shared::set_tuning(const Tuning& new_tuning) {
  tuning = new_tuning;
  law.set_params(tuning.law);
  if (steering) steering->set_params(tuning.law);
  margins.set_params(tuning.margins);
  follower.set_params(tuning.follow);
  stall.set_stall_time(tuning.stall_time_s);
  drive.set_filter_passes(tuning.filter_passes);
  evader.set_params({tuning.velocity_gain, tuning.follow_gain, tuning.drive_acceleration,
                     tuning.acceleration_max, tuning.approach_rate},
                    tuning.look_budget, tuning.look_steps);
}

void Shared::take_path() {
  clear_path();
  const auto points = setup.path(*goal);
  for (Eigen::Index i = 0; i < points.cols(); ++i) path.add(points.col(i));
}

void Shared::choose_target() {
  target = {goal};
  if (path.empty()) return;
  path_position = path.carrot(path_position, drive.q(), path_ahead, via);
  target = {goal, &via, path_position < path.length()};
}

double Shared::remaining() {
  double length = distance(target);
  if (!path.empty()) length += path.length() - path_position;
  return length;
}

double Shared::attract(const planning::Tick& tick) {
  const double closing_speed = law.attract(model, drive.ws(), drive.q(), target, u);
  if (tick.speed_scale() < 1.0) u *= tick.speed_scale();
  return closing_speed;
}

void Shared::look_for_turns(const planning::Tick& tick, double distance) {
  steering->advance(tick.time_s(), drive.q(), distance, *goal, tick.moving_count() > 0);
}

}  // namespace hamelin::hybrid
