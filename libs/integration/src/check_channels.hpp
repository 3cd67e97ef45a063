#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// @throws Error usage for channels that do not fit the model
void check_channels(const char* function, const Model& model, const Channels& channels);
/// @throws Error usage if an argument does not have one number per joint
void check_size(const char* function, const char* argument, const Model& model, Eigen::Index given);

}  // namespace hamelin::integration
