#pragma once
#include <pybind11/pybind11.h>

#include "hamelin/scene/scene.hpp"

namespace hamelin::python {

namespace py = pybind11;

/// Makes an object the planner of a scene, as long as the scope lives: the planner `python` that
/// this thread makes calls it. The scene names the object's class and file, so that a log of the
/// run can be replayed.
class PlannerObjectScope {
 public:
  /// @param object None: the scene's own planner @throws py::type_error if it has no tick()
  PlannerObjectScope(py::handle object, scene::Scene& scene);
  /// Makes a shallow copy of the object the planner, as its scene already names it.
  explicit PlannerObjectScope(const py::object& object);
  PlannerObjectScope(const PlannerObjectScope&) = delete;
  PlannerObjectScope& operator=(const PlannerObjectScope&) = delete;
  ~PlannerObjectScope();

 private:
  void use(py::object object);

  bool set_ = false;
  py::object object_;
  PyObject* before_ = nullptr;
};

}  // namespace hamelin::python
