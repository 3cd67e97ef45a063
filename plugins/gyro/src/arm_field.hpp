#pragma once
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/field_drive.hpp"
#include "hamelin/reactive/rest_rule.hpp"
#include "turning.hpp"

namespace hamelin::gyro {

/// Gyroscopic forces for arms with limits: in the field of a FieldDrive they turn the arm away from
/// obstacles, and a repulsion acts only within a short distance, which they do not secure.
class ArmField final : public planning::Planner {
 public:
  ArmField(const planning::Setup& setup, const Json& params);
  void tick(const planning::Tick& tick, planning::Command& command) override;

 private:
  /// Turns the velocity of a point that approaches.
  /// @return whether it does
  [[nodiscard]] bool turn(const reactive::NearPoint& point, planning::Command& command);

  reactive::FieldDrive drive_;
  reactive::RestRule rest_;
  Turning turning_;
  reactive::Repulsion hold_;  ///< from obstacles
  reactive::Repulsion self_;  ///< between parts of the arm
};

}  // namespace hamelin::gyro
