#pragma once
#include <cstdint>
#include <optional>

#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/filter_drive.hpp"
#include "hamelin/reactive/law.hpp"
#include "hamelin/reactive/point_margins.hpp"
#include "hamelin/reactive/rest_rule.hpp"
#include "hamelin/reactive/steering.hpp"

namespace hamelin::gyro {

/// The gyroscopic force in joint space: the attraction is turned without work in planes that
/// predictions choose, docs/theory.md (10.8), (10.40). A safety filter keeps the arm from
/// obstacles.
class PredictedTurn final : public planning::Planner {
 public:
  /// Obstacles beyond this distance are ignored [m].
  static constexpr double radius_m = 0.1;

  PredictedTurn(const planning::Host& host, const planning::Setup& setup, const Json& params);
  void tick(const planning::Tick& tick, planning::Command& command) override;

 private:
  void start(const planning::Tick& tick);
  void check_end(const planning::Tick& tick, planning::Command& command);
  void steer(const planning::Tick& tick, planning::Command& command);

  planning::Setup setup_;
  model::Model model_;
  reactive::Law law_;
  reactive::FilterDrive drive_;
  reactive::Surroundings surroundings_;
  reactive::PointMargins margins_;
  std::optional<reactive::Steering> steering_;  ///< none with turns none
  reactive::RestRule rest_;                     ///< without steering
  Eigen::VectorXd u_;
  std::int32_t series_ = -1;
  std::optional<std::uint64_t> goal_number_;  ///< none before the first tick
};

}  // namespace hamelin::gyro
