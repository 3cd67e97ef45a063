#pragma once
#include "hamelin/model/robot.hpp"

namespace hamelin::fuzz {

/// Aborts unless an accepted robot gives a Model and is unchanged after writing it to JSON and
/// reading it back.
void require_round_trip(const model::Robot& robot);

}  // namespace hamelin::fuzz
