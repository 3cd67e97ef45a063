#pragma once
#include "hamelin/model/robot.hpp"

namespace hamelin::fuzz {

/// That an accepted robot makes a Model, and survives its JSON form unchanged.
void promise_round_trip(const model::Robot& robot);

}  // namespace hamelin::fuzz
