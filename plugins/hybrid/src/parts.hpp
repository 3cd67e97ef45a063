#pragma once
#include "hamelin/reactive/filter_drive.hpp"
#include "hamelin/reactive/law.hpp"
#include "hamelin/reactive/movers.hpp"
#include "hamelin/reactive/obstacles.hpp"
#include "hamelin/reactive/point_margins.hpp"
#include "hamelin/reactive/safety_filter.hpp"
#include "hamelin/reactive/steering.hpp"
#include "hamelin/reactive/surroundings.hpp"

namespace hamelin::hybrid {

// The planner is made of the parts of libs/reactive.
using namespace hamelin::reactive;

}  // namespace hamelin::hybrid
