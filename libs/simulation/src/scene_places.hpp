#pragma once
#include <string>

#include "hamelin/model/model.hpp"

namespace hamelin::simulation {

/// By how much the time of a step may miss a time that a scene names, because it is a sum [s].
inline constexpr double time_rounding_s = 1e-9;

/// Index into Model::frames() of a frame that a scene names.
/// @param place of the name in the scene, to be shown in errors
/// @throws Error invalid for a name that no frame has
[[nodiscard]] int named_frame(const model::Model& model, const std::string& name,
                              const std::string& place);

}  // namespace hamelin::simulation
