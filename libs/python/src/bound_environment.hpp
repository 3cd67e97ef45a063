#pragma once
#include <pybind11/pybind11.h>

#include <memory>
#include <utility>

#include "bound_model.hpp"
#include "bound_scene.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::python {

namespace py = pybind11;

/// Everything that an arm can hit, with the arm. Queries release Python's lock and have scratch
/// memory of their own.
struct BoundEnvironment : Whole {
  BoundEnvironment(SharedModel given, scene::Environment surroundings, double influence)
      : model(std::move(given)),
        environment(std::move(surroundings)),
        self(model->model),
        influence_m(influence) {
    environment.prepare();
  }

  const SharedModel model;
  scene::Environment environment;
  const scene::SelfField self;
  const double influence_m;
};

using SharedEnvironment = std::shared_ptr<BoundEnvironment>;

[[nodiscard]] SharedEnvironment make_environment(BoundScene& scene, double influence);
void add_environment(py::module_& module);

}  // namespace hamelin::python
