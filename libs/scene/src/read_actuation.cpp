#include <fmt/format.h>

#include <cmath>
#include <utility>

#include "read_scene.hpp"

namespace hamelin::scene {

namespace {

// One number, or a list of them.
std::vector<double> read_numbers(const Reader& in, const char* key,
                                 std::vector<double> fallback = {}) {
  const Json* given = in.find(key);
  if (given == nullptr) return fallback;
  return given->is_number() ? std::vector{given->get<double>()} : given->get<std::vector<double>>();
}

void read_servo(const Reader& in, Actuation& actuation) {
  const bool position = actuation.type == ActuationType::position;
  if (position != (in.find("servo") != nullptr))
    in.fail("servo", position ? "is missing, expected the gains kp and kv of the position servos"
                              : "is not allowed, expected position actuation");
  if (!position) return;
  const Reader servo = in.child("servo");
  actuation.servo.kp = read_numbers(servo, "kp");
  actuation.servo.kv = read_numbers(servo, "kv");
  if (servo.get<std::string>("feedforward", "dynamics") == "gravity")
    actuation.servo.feedforward = Feedforward::gravity;
  for (auto [key, values] : {std::pair("acceleration_max", &actuation.servo.acceleration_max),
                             std::pair("jerk_max", &actuation.servo.jerk_max)})
    *values = read_numbers(servo, key, *values);
}

}  // namespace

Actuation read_actuation(const Reader& in, double step_s) {
  Actuation actuation;
  const auto type = in.get<std::string>("type", "ideal");
  if (type == "sampled") actuation.type = ActuationType::sampled;
  if (type == "position") actuation.type = ActuationType::position;
  actuation.control_period_s = in.get("control_period_s", step_s);
  actuation.delay_s = in.get("delay_s", 0.0);
  actuation.joint_noise_rad = in.get("joint_noise_rad", 0.0);
  actuation.estimates_velocity = in.get<std::string>("joint_velocity", "measured") == "estimated";
  actuation.estimator_bandwidth = in.get("estimator_bandwidth", actuation.estimator_bandwidth);
  actuation.planner_mass_scale = in.get("planner_mass_scale", 1.0);
  actuation.torque_rate_max_Nm_s = in.maybe<double>("torque_rate_max_Nm_s");
  actuation.coulomb_friction_share = in.get("coulomb_friction_share", 0.0);
  actuation.deadline_s = in.maybe<double>("deadline_s");
  const double steps = actuation.control_period_s / step_s;
  if (!(std::round(steps) >= 1.0 && std::abs(steps - std::round(steps)) <= 1e-9 * steps))
    in.fail("control_period_s", fmt::format("{} s is not an integer multiple of the step {} s",
                                            actuation.control_period_s, step_s));
  if (actuation.type == ActuationType::ideal && std::round(steps) != 1.0)
    in.fail("control_period_s",
            fmt::format("{} s is not allowed, ideal actuation has one tick per step ({} s)",
                        actuation.control_period_s, step_s));
  if (actuation.type == ActuationType::ideal && actuation.delay_s > 0.0)
    in.fail("delay_s",
            fmt::format("{} s is not allowed, ideal actuation has no delay", actuation.delay_s));
  if (actuation.type != ActuationType::sampled && actuation.estimates_velocity)
    in.fail("joint_velocity", "'estimated' is not allowed, expected sampled actuation");
  if (actuation.type != ActuationType::sampled && actuation.torque_rate_max_Nm_s)
    in.fail("torque_rate_max_Nm_s",
            "is not allowed, expected sampled actuation, whose torques change from tick to tick");
  read_servo(in, actuation);
  return actuation;
}

PlantType read_plant(const Reader& in, const Reader& plant, ActuationType actuation) {
  if (plant.get<std::string>("type", "hamelin") == "hamelin") return PlantType::hamelin;
  if (actuation == ActuationType::ideal)
    in.fail("actuation/type",
            "is ideal, expected sampled or position because the joints of MuJoCo take torques");
  return PlantType::mujoco;
}

Safety read_safety(const Reader& in) {
  Safety safety;
  if (const auto type = in.maybe<std::string>("type"))
    safety.type = *type == "shield"        ? SafetyType::shield
                  : *type == "certificate" ? SafetyType::certificate
                                           : SafetyType::none;
  safety.margin_m = in.get("margin_m", safety.margin_m);
  safety.torque_share = in.get("torque_share", unstated);
  safety.tracking_rad = in.get("tracking_rad", unstated);
  safety.mass_error = in.get("mass_error", safety.mass_error);
  safety.friction_share = in.get("friction_share", safety.friction_share);
  safety.joint_noise_rad = in.get("joint_noise_rad", unstated);
  return safety;
}

}  // namespace hamelin::scene
