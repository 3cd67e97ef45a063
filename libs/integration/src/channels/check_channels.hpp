#pragma once
#include "hamelin/integration/integrator.hpp"

namespace hamelin::integration {

/// @throws Error usage for channels that do not fit the model, and for negative damping or dry
///         friction
void check_channels(const char* function, const Model& model, const Channels& channels);
/// @throws Error usage if an argument does not have one number per joint
void check_size(const char* function, const char* argument, const Model& model, Eigen::Index given);
/// @throws Error usage if a number is not finite
void check_finite(const char* function, const char* argument, const ConstVectorRef& x);

}  // namespace hamelin::integration
