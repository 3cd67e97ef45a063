#pragma once
#include "hamelin/planning/plugin.hpp"
#include "hamelin/reactive/field_drive.hpp"
#include "hamelin/reactive/rest_rule.hpp"

namespace hamelin::apf {

/// Khatib's potential field for arms with limits: a short repulsion from obstacles and from the
/// arm's own parts, in the field of a FieldDrive.
class ArmField final : public planning::Planner {
 public:
  ArmField(const planning::Setup& setup, const Json& params);
  void tick(const planning::Tick& tick, planning::Command& command) override;

 private:
  reactive::FieldDrive drive_;
  reactive::RestRule rest_;
  reactive::Repulsion repulsion_;
};

}  // namespace hamelin::apf
