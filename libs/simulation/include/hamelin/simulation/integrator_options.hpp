#pragma once
#include <string>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/io/json.hpp"

namespace hamelin::simulation {

/// The parameters of an integrator from a scene's `/integrator/params`,
/// docs/schema/integrator.schema.json.
/// @param where file and place, the prefix of error messages
/// @throws Error invalid, naming `where` and the key
[[nodiscard]] integration::Parameters integrator_options(const Json& params,
                                                         const std::string& where);

}  // namespace hamelin::simulation
