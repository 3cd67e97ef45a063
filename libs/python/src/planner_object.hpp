#pragma once
#include <fmt/format.h>
#include <pybind11/pybind11.h>

#include <string>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/scene/scene.hpp"

/// Objects of Python as planners.
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

/// The planner for the parameters of the planner `python`: the object of this thread's scope, or a
/// new one of the class that they name. @throws Error plugin
[[nodiscard]] py::object make_planner_object(const Json& params);
/// Its attribute influence_m [m]; negative without one. The caller holds Python's lock, as that of
/// all functions here.
[[nodiscard]] double planner_influence_m(const Json& params);

/// "planner python:FILE:CLASS", for messages.
[[nodiscard]] std::string planner_name(const Json& params);
/// "ValueError: text (mine.py, line 12)" of an exception.
[[nodiscard]] std::string describe(py::error_already_set& error);

/// Calls f; an exception of Python becomes an Error.
template <class F>
auto guarded(const std::string& where, const F& f) {
  try {
    return f();
  } catch (py::error_already_set& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, describe(error)));
  } catch (const py::cast_error& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, error.what()));
  } catch (const py::builtin_exception& error) {
    throw Error(ErrorCode::plugin, fmt::format("{}: {}", where, error.what()));
  }
}

}  // namespace hamelin::python
