#pragma once
#include <memory>
#include <optional>
#include <utility>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/core/error.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "planner_object.hpp"

namespace hamelin::python {

/// hamelin.Controller. Ticks hold Python's lock; calls that lock, or take longer, release it.
struct BoundController : Whole {
  BoundController(SharedScene from, py::object planner, const py::list& plugins,
                  const control::ControllerOptions& options)
      : scene(std::move(from)), object(std::move(planner)) {
    scene::Scene chosen = scene->scene;
    const auto folders = plugin_path(paths_of(plugins));
    const PlannerObjectScope scope(object, chosen);
    const py::gil_scoped_release unlocked;
    controller = std::make_unique<control::Controller>(chosen, folders, options);
  }

  SharedScene scene;
  py::object object;  ///< the planner, where it is one of Python
  std::unique_ptr<control::Controller> controller;
  Eigen::VectorXd q, v;
  bool busy = false;
  InterruptCheck interrupts;
};

using SharedController = std::shared_ptr<BoundController>;

/// hamelin.World: a part of a controller.
struct BoundWorld : Whole {
  explicit BoundWorld(SharedController controller) : owner(std::move(controller)) {}
  SharedController owner;
  [[nodiscard]] control::World& get() const { return owner->controller->world(); }
};

/// Refuses calls for the thread of tick() while a planner in Python answers one.
inline control::Controller& idle(const BoundController& c) {
  if (c.busy)
    throw Error(ErrorCode::usage, "Controller: a tick uses it, expected a call between two ticks");
  return *c.controller;
}

inline std::optional<Eigen::Vector3d> optional_vector3(const char* function, const char* argument,
                                                       py::handle given) {
  if (given.is_none()) return std::nullopt;
  return vector3_of(function, argument, given);
}

inline control::Observation observation_of(const char* function, double time_s, py::handle pose,
                                           py::handle velocity, py::handle acceleration,
                                           py::handle angular_velocity) {
  return {time_s, pose_of(function, "pose", pose), optional_vector3(function, "velocity", velocity),
          optional_vector3(function, "acceleration", acceleration),
          optional_vector3(function, "angular_velocity", angular_velocity)};
}

/// Answers of ticks, and what a controller counts.
void add_answer(py::module_& module);
[[nodiscard]] py::object make_answer(const control::Answer& answer);
[[nodiscard]] py::object shield_counts(control::Controller& controller);
[[nodiscard]] py::object guide_counts(control::Controller& controller);
[[nodiscard]] py::object verdict_of(control::Controller& controller);
void add_world(py::module_& module);

}  // namespace hamelin::python
