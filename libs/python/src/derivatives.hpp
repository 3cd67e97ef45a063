#pragma once
#include <pybind11/pybind11.h>

#include "bound_model.hpp"

namespace hamelin::python {

/// The methods of hamelin.Model that differentiate its dynamics, also by masses and inertias.
void add_derivatives(pybind11::class_<BoundModel, SharedModel>& type);

}  // namespace hamelin::python
