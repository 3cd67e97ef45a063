#pragma once
#include <string_view>
#include <vector>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "hamelin/dynamics/wrenches.hpp"
#include "whole.hpp"

/// Frames and wrenches as arguments of calls.
namespace hamelin::python {

/// hamelin.Wrench
using PyWrench = Boxed<dynamics::ExternalWrench>;

/// A frame by its name or index; None: the tip. @throws Error usage, naming function and argument
[[nodiscard]] int frame_index(const char* function, const model::Model& model, py::handle frame);
[[nodiscard]] dynamics::Reference reference_of(const char* function, std::string_view name);

/// A sequence of hamelin.Wrench. @throws py::type_error for anything else
[[nodiscard]] std::vector<dynamics::ExternalWrench> wrenches_of(const char* function,
                                                                py::handle given);

}  // namespace hamelin::python
