#include <memory>

#include "arm_field.hpp"
#include "hamelin/reactive/replace_nulls.hpp"
#include "params_schema.hpp"
#include "published.hpp"

namespace hamelin::apf {
namespace {

bool is_published(const Json& params) {
  return params.at("algorithm") == "published";
}

/// The values of parameters that are null.
Json completed(const Json& params) {
  return reactive::replace_nulls(
      params, is_published(params)
                  ? Json{{"eta", 13.0}, {"rho0_m", 0.5}, {"distance_min_m", 1e-3}}
                  : Json{{"eta", 1e-6}, {"rho0_m", 0.025}, {"distance_min_m", 2e-3}});
}

/// The planner: one of its algorithms.
class Apf final : public planning::Planner {
 public:
  static double influence_m(const Json& params) {
    const auto range = completed(params).at("rho0_m").get<double>();
    return is_published(params) ? range : reactive::FieldDrive::contact_range_m(range);
  }

  Apf(const planning::Host&, const planning::Setup& setup, const Json& given) {
    const Json params = completed(given);
    if (params.at("distance_min_m") > params.at("rho0_m"))
      throw Error(ErrorCode::invalid, "/distance_min_m: above rho0_m, expected at most rho0_m");
    if (is_published(params))
      algorithm_ = std::make_unique<Published>(setup, params);
    else
      algorithm_ = std::make_unique<ArmField>(setup, params);
  }

  void tick(const planning::Tick& tick, planning::Command& command) override {
    algorithm_->tick(tick, command);
  }

 private:
  std::unique_ptr<planning::Planner> algorithm_;
};

}  // namespace
}  // namespace hamelin::apf

HAMELIN_PLANNER_PLUGIN(hamelin::apf::Apf, "apf", "0.2.0",
                       "Artificial potential field: the goal attracts, obstacles repel",
                       params_schema);
