#pragma once
#include <pybind11/pybind11.h>

#include "bound_model.hpp"

namespace hamelin::python {

/// The methods of hamelin.Model that tell where links and frames are and how they move.
void add_kinematics(pybind11::class_<BoundModel, SharedModel>& type);

}  // namespace hamelin::python
