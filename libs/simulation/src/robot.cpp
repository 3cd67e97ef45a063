#include "hamelin/simulation/robot.hpp"

#include <fmt/format.h>

#include <utility>

#include "actuation.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "judge.hpp"
#include "plants.hpp"

namespace hamelin::simulation {

using Eigen::VectorXd;

namespace {

const scene::Scene& checked(const scene::Scene& scene) {
  if (scene.actuation.type == scene::ActuationType::ideal)
    throw Error(
        ErrorCode::usage,
        fmt::format("{}: /actuation/type: is ideal, expected sampled or position, because a "
                    "robot is sent torques or positions",
                    scene.name));
  if (!scene.events.empty())
    throw Error(ErrorCode::usage,
                fmt::format("{}: /events: has {} events, expected none, because only `hamelin run` "
                            "simulates them",
                            scene.name, scene.events.size()));
  if (!scene.wrenches.empty())
    throw Error(ErrorCode::usage,
                fmt::format("{}: /wrenches: has {} wrenches, expected none, because only `hamelin "
                            "run` and `hamelin integrate` simulate them",
                            scene.name, scene.wrenches.size()));
  return scene;
}

}  // namespace

Robot::Robot(const scene::Scene& scene, const PlantFactory& plant_factory)
    : scene_(checked(scene)),
      model_(control::load_model(scene)),
      period_s_(static_cast<double>(steps_per_tick(scene)) * scene.step_s),
      steps_per_period_(steps_per_tick(scene)) {
  control::check_numbers(scene_, model_);
  plant_ = make_plant(scene_, model_, plant_factory);
  actuation_ = make_sampled_actuation(scene_, model_, *plant_);
  judge_ = std::make_unique<Judge>(scene_, model_, *plant_, nullptr);
  observe_node();
}

Robot::~Robot() = default;

double Robot::time_s() const noexcept {
  return plant_->node().time_s;
}

void Robot::measure(VectorXd& q, VectorXd& v) {
  actuation_->observe(q, v);
}

bool Robot::move(const control::Answer& setpoint) {
  judge_->allow(setpoint.may_touch, setpoint.goal_index);
  for (long i = 0; i < steps_per_period_ && cause_.empty(); ++i) {
    actuation_->take(setpoint, i == 0);
    judge_->depart(actuation_->departure_velocity());
    if (!actuation_->step(scene_.step_s)) {
      finish(log::Outcome::diverged, fmt::format("step {} of {} s {}", plant_->node().k + 1,
                                                 scene_.step_s, plant_->description().failure));
      return false;
    }
    observe_node();
  }
  return cause_.empty();
}

void Robot::observe_node() {
  judge_->observe_node();
  if (const std::string change = judge_->advance_map(); !change.empty()) judge_->look_again();
  judge_->count_contacts(counts_);
  if (judge_->in_contact())
    finish(plant_->node().k > 0 ? log::Outcome::collision : log::Outcome::refused,
           judge_->describe_contact());
  else if (!judge_->contact_on_the_way().empty())
    finish(log::Outcome::collision, judge_->contact_on_the_way());
}

void Robot::finish(log::Outcome outcome, std::string cause) {
  outcome_ = outcome;
  cause_ = std::move(cause);
}

void Robot::fill(log::Result& result) const {
  result.plant = counts_.plant;
  judge_->fill(result);
  result.scene = scene_.name;
  result.time_s = plant_->node().time_s;
  result.steps = plant_->node().k;
  result.q = plant_->node().q;
  result.v = plant_->node().v;
}

}  // namespace hamelin::simulation
