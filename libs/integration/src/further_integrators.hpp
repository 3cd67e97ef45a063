#pragma once
#include <memory>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/integration/options.hpp"

namespace hamelin::integration {

/// Makes an integrator of the schemes that a build may leave out (HAMELIN_FURTHER_SOURCES).
/// @param options were checked
/// @throws Error usage if this build is without them
[[nodiscard]] std::unique_ptr<Integrator> make_further(const Model& model, const Options& options);

}  // namespace hamelin::integration
