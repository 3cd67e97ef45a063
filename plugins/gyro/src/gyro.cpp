#include <memory>

#include "arm_field.hpp"
#include "hamelin/reactive/replace_nulls.hpp"
#include "params_schema.hpp"
#include "predicted_turn.hpp"
#include "published.hpp"

namespace hamelin::gyro {
namespace {

bool is_arm(const Json& params) {
  return params.at("algorithm") == "arm";
}

bool is_predicted(const Json& params) {
  return params.at("variant") == "predicted";
}

/// The values of parameters that are null.
Json completed(const Json& params) {
  return reactive::replace_nulls(params, is_arm(params) ? Json{{"k_obs", 0.3},
                                                               {"rho0_m", 0.06},
                                                               {"distance_min_m", 5e-3},
                                                               {"variant", "chang-marsden"}}
                                                        : Json{{"k_obs", 3.0},
                                                               {"rho0_m", 0.5},
                                                               {"distance_min_m", 1e-3},
                                                               {"variant", "energy-neutral"}});
}

/// The planner: one of its algorithms.
class Gyro final : public planning::Planner {
 public:
  static double influence_m(const Json& params) {
    if (is_predicted(params)) return PredictedTurn::radius_m;
    const auto range = completed(params).at("rho0_m").get<double>();
    return is_arm(params) ? reactive::FieldDrive::contact_range_m(range) : range;
  }

  Gyro(const planning::Host& host, const planning::Setup& setup, const Json& given) {
    const Json params = completed(given);
    if (params.at("distance_min_m") > params.at("rho0_m"))
      throw Error(ErrorCode::invalid, "/distance_min_m: above rho0_m, expected at most rho0_m");
    if (is_predicted(params) && !is_arm(params))
      throw Error(ErrorCode::invalid,
                  "/variant: predicted needs algorithm arm, expected another variant");
    if (is_predicted(params))
      algorithm_ = std::make_unique<PredictedTurn>(host, setup, params);
    else if (is_arm(params))
      algorithm_ = std::make_unique<ArmField>(setup, params);
    else
      algorithm_ = std::make_unique<Published>(setup, params);
  }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    algorithm_->tick(tick, command);
  }

 private:
  std::unique_ptr<planning::Planner> algorithm_;
};

}  // namespace
}  // namespace hamelin::gyro

HAMELIN_PLANNER_PLUGIN(hamelin::gyro::Gyro, "gyro", "0.2.0",
                       "The goal attracts, gyroscopic forces turn the motion away from obstacles",
                       params_schema);
