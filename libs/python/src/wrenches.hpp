#pragma once
#include <pybind11/pybind11.h>

#include "bound_model.hpp"

namespace hamelin::python {

/// hamelin.Wrench, and the methods of hamelin.Model that make and sum wrenches.
void add_wrenches(pybind11::module_& module, pybind11::class_<BoundModel, SharedModel>& type);

}  // namespace hamelin::python
