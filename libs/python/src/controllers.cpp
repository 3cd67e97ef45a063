#include <fmt/format.h>
#include <pybind11/stl.h>

#include <memory>

#include "bound_controller.hpp"
#include "hamelin/core/text.hpp"
#include "hamelin/scene/parts.hpp"

namespace hamelin::python {

namespace {

using ControllerClass = py::class_<BoundController, SharedController>;

void take_state(BoundController& c, py::handle q, py::handle v) {
  const auto dof = c.controller->model().dof();
  const Numbers positions("tick", "q", q), velocities("tick", "v", v);
  positions.require_vector(dof);
  velocities.require_vector(dof);
  c.q = positions.vector();
  c.v = velocities.vector();
}

py::object tick(BoundController& c, double time_s, py::handle q, py::handle v) {
  if (c.busy)
    throw Error(ErrorCode::usage, "Controller: tick() is called by its planner, expected a loop");
  take_state(c, q, v);
  c.busy = true;
  const struct Done {
    bool& busy;
    ~Done() { busy = false; }
  } done{c.busy};
  if (c.object.is_none()) return make_answer(c.controller->tick(time_s, c.q, c.v));
  const InterruptScope scope(c.interrupts);
  py::object answer = make_answer(c.controller->tick(time_s, c.q, c.v));
  c.interrupts.rethrow();
  return answer;
}

void stop(BoundController& c, const std::string& cause) {
  const py::gil_scoped_release unlocked;
  c.controller->stop(cause);
}

void resume(BoundController& c) {
  const PlannerObjectScope scope(c.object);
  const py::gil_scoped_release unlocked;
  c.controller->resume();
}

std::uint64_t set_goals(BoundController& c, py::handle goals) {
  auto all = scene::goals_from_json(to_json(goals), c.scene->folder, "goals");
  const py::gil_scoped_release unlocked;
  return c.controller->set_goals(std::move(all));
}

std::uint64_t attach(BoundController& c, py::handle payload, py::handle q) {
  const Eigen::VectorXd at = vector_of("attach", "q", q, c.controller->model().dof());
  const scene::Payload read = scene::payload_from_json(to_json(payload), "payload");
  const PlannerObjectScope scope(c.object);
  const py::gil_scoped_release unlocked;
  return c.controller->attach(read, at);
}

std::uint64_t detach(BoundController& c, const std::string& name, py::handle q) {
  const Eigen::VectorXd at = vector_of("detach", "q", q, c.controller->model().dof());
  const PlannerObjectScope scope(c.object);
  const py::gil_scoped_release unlocked;
  return c.controller->detach(name, at);
}

void set_target(BoundController& c, double time_s, py::handle pose, py::handle velocity,
                py::handle angular_velocity) {
  const auto target =
      observation_of("set_target", time_s, pose, velocity, py::none(), angular_velocity);
  const py::gil_scoped_release unlocked;
  c.controller->set_target(target);
}

void set_target_twist(BoundController& c, double time_s, py::handle velocity,
                      py::handle angular_velocity) {
  const control::TargetTwist twist{
      time_s,
      optional_vector3("set_target_twist", "velocity", velocity).value_or(Eigen::Vector3d::Zero()),
      optional_vector3("set_target_twist", "angular_velocity", angular_velocity)
          .value_or(Eigen::Vector3d::Zero())};
  const py::gil_scoped_release unlocked;
  c.controller->set_target(twist);
}

void set_planner_params(BoundController& c, py::handle changes) {
  const Json json = to_json(changes);
  const py::gil_scoped_release unlocked;
  c.controller->set_planner_params(json);
}

py::object planner_params(BoundController& c) {
  Json params;
  {
    const py::gil_scoped_release unlocked;
    params = c.controller->planner_params();
  }
  return to_python(params);
}

// A number for all joints, or a sequence of them, of which the controller checks the size.
void take_per_joint(const char* argument, py::handle given, std::vector<double>& out) {
  if (given.is_none()) return;
  const Numbers numbers("Controller", argument, given);
  if (numbers.dimensions() > 1)
    refuse("Controller", argument,
           fmt::format("has shape {}, expected a number, or one per joint",
                       describe_shape(numbers.array())));
  out.assign(numbers.data(), numbers.data() + numbers.size());
}

// A size that memory is reserved for.
std::size_t bounded_size(const char* argument, std::size_t given) {
  if (given > 100'000)
    refuse("Controller", argument, fmt::format("{}, expected 0 to 100000", given));
  return given;
}

struct Bounds {
  py::object acceleration_max, jerk_max, tracking_max;
  std::optional<std::size_t> path_points_max, payload_shapes_max;
  std::optional<double> payload_reach_m;
};

void take_bounds(const Bounds& bounds, control::ControllerOptions& out) {
  take_per_joint("acceleration_max", bounds.acceleration_max, out.acceleration_max);
  take_per_joint("jerk_max", bounds.jerk_max, out.jerk_max);
  take_per_joint("tracking_max", bounds.tracking_max, out.tracking_max);
  if (bounds.path_points_max)
    out.path_points_max = bounded_size("path_points_max", *bounds.path_points_max);
  if (bounds.payload_shapes_max)
    out.payload_shapes_max = bounded_size("payload_shapes_max", *bounds.payload_shapes_max);
  out.payload_reach_m = bounds.payload_reach_m;
}

SharedController make_controller(py::handle scene, py::object planner, py::handle plugins,
                                 const std::optional<double>& period, bool position, bool certify,
                                 std::size_t obstacles_max, py::object acceleration_max,
                                 py::object jerk_max, py::object tracking_max,
                                 const std::optional<std::size_t>& path_points_max,
                                 const std::optional<double>& payload_reach,
                                 const std::optional<std::size_t>& payload_shapes_max,
                                 bool fixed_world, bool guide_thread) {
  scene::Overrides overrides;
  py::object object = py::none();
  if (PyUnicode_Check(planner.ptr()) != 0)
    overrides.planner = planner.cast<std::string>();
  else
    object = std::move(planner);
  control::ControllerOptions options;
  options.period_s = period;
  options.position = position;
  options.certify = certify;
  options.obstacles_max = bounded_size("obstacles_max", obstacles_max);
  take_bounds({std::move(acceleration_max), std::move(jerk_max), std::move(tracking_max),
               path_points_max, payload_shapes_max, payload_reach},
              options);
  options.fixed_world = fixed_world;
  options.guide_thread = guide_thread;
  py::list folders;
  for (const auto& folder : paths_of(plugins)) folders.append(folder.string());
  return std::make_shared<BoundController>(scene_of(scene, overrides), std::move(object), folders,
                                           options);
}

ControllerClass add_controller_class(py::module_& module) {
  using py::arg;
  const auto none = py::none();
  return ControllerClass(
             module, "Controller",
             "The control loop of an arm, without a plant. One thread calls tick(); any thread\n"
             "may stop the arm and update world, goals, parameters and load.")
      .def(
          py::init(&make_controller), arg("scene"), py::kw_only(), arg("planner") = none,
          arg("plugin_path") = none, arg("period") = none, arg("position") = false,
          arg("certify") = true, arg("obstacles_max") = 64, arg("acceleration_max") = none,
          arg("jerk_max") = none, arg("tracking_max") = none, arg("path_points_max") = none,
          arg("payload_reach") = none, arg("payload_shapes_max") = none, arg("fixed_world") = false,
          arg("guide_thread") = true,
          "scene: a Scene, a dict or a file. planner: a name, an object with tick(tick, command),\n"
          "or None: the scene's. period: time between two ticks [s]; None: the scene's.\n"
          "position: whether answers have q_next and v_next. certify: prove that the motion\n"
          "since the last tick was clear. acceleration_max, jerk_max: of the positions;\n"
          "tracking_max: how far the arm may be from them before it is stopped; one value or\n"
          "one per joint each, None: 15 rad/s^2, 5000 rad/s^3, 0.1 rad. path_points_max: of\n"
          "goals that are set later. payload_reach [m], payload_shapes_max: of payloads that\n"
          "are attached later; None: of the scene's events. fixed_world: nothing will be added\n"
          "to the world. guide_thread: whether a guide searches on a thread of its own.")
      .def("tick", &tick, arg("time"), arg("q"), arg("v"),
           "Answers the measured state of the arm: time [s], increasing; q, v of shape (n,).")
      .def(
          "reset", [](BoundController& c) { idle(c).reset(); },
          "Forgets goals that were reached and the last motion, for a new start.")
      .def(
          "run_guide", [](BoundController& c) { idle(c).run_guide(); },
          "Searches the path that the last tick asked for, where the guide has no thread.");
}

void add_controller_updates(ControllerClass& controller) {
  using py::arg;
  controller
      .def("stop", &stop, arg("cause"),
           "Brings the arm to rest from the next tick on, and holds it; by any thread. cause: a\n"
           "line for Answer.cause.")
      .def("resume", &resume,
           "After any stop: resumes from where the arm is measured, from the next tick on, with\n"
           "the goals where they were; by any thread. It has no effect unless the last answer has\n"
           "the state 'stopping'. The arm remains stopped if the cause is still there.")
      .def("set_goals", &set_goals, arg("goals"),
           "Replaces the goals by a dict as in a scene, or a list of them, from the next tick on.\n"
           "Returns the number of the list, see Answer.goals_number.")
      .def("set_target", &set_target, arg("time"), arg("pose"), py::kw_only(),
           arg("velocity") = py::none(), arg("angular_velocity") = py::none(),
           "Moves the target of a follow goal to a pose, shape (4, 4). Velocities, shape (3,),\n"
           "that are not given are estimated.")
      .def("set_target_twist", &set_target_twist, arg("time"), py::kw_only(),
           arg("velocity") = py::none(), arg("angular_velocity") = py::none(),
           "Commands the target of a follow goal by a twist, shape (3,) each, in world axes.")
      .def("set_planner_params", &set_planner_params, arg("changes"),
           "Changes parameters of the planner, from the next tick on.")
      .def("planner_params", &planner_params, "All parameters of the planner, as a dict.")
      .def("attach", &attach, arg("payload"), arg("q"),
           "Fixes a body to the tip: a dict as /model/payload of a scene. q: shape (n,).")
      .def("detach", &detach, arg("name"), arg("q"), "Takes it off again. q: shape (n,).")
      .def(
          "attached",
          [](BoundController& c) {
            const py::gil_scoped_release unlocked;
            return c.controller->attached();
          },
          "Names of what is attached.")
      .def_property_readonly(
          "world", [](const SharedController& c) { return std::make_shared<BoundWorld>(c); },
          "The surroundings.");
}

std::vector<std::string> series_names(const BoundController& c) {
  std::vector<std::string> out;
  for (const auto& series : idle(c).series()) out.push_back(series.name);
  return out;
}

void add_controller_properties(ControllerClass& controller) {
  using Bound = const BoundController;
  controller
      .def_property_readonly(
          "verdict", [](Bound& c) { return verdict_of(idle(c)); },
          "The proof for the motion between the last two ticks: a dict with\n"
          "certified, margin_m, contact; None after the first tick.")
      .def_property_readonly(
          "shield", [](Bound& c) { return shield_counts(idle(c)); },
          "Whether the shield refused the last step, why, and its counts since the start, as a\n"
          "dict; None if the controller has no shield.")
      .def_property_readonly(
          "guide", [](Bound& c) { return guide_counts(idle(c)); },
          "What the scene's guide did since the start, as a dict; None if it has none.")
      .def_property_readonly("series_names", &series_names,
                             "Names of the numbers in Answer.series.")
      .def_property_readonly(
          "clearance_m", [](Bound& c) { return idle(c).view().clearance_m(); },
          "Distance to obstacles at the last tick, at most the planner's influence [m].")
      .def_property_readonly(
          "period_s", [](Bound& c) { return c.controller->period_s(); },
          "Time between two ticks [s].")
      .def_property_readonly(
          "dof", [](Bound& c) { return c.controller->model().dof(); }, "Number of joints n.")
      .def_property_readonly(
          "tip", [](Bound& c) { return to_array(idle(c).tip()); },
          "Pose of the tip at the last tick, shape (4, 4).")
      .def("__repr__", [](Bound& c) {
        return fmt::format("<hamelin.Controller '{}': planner {}, period {:g} s>", c.scene->name,
                           c.controller->plugin().name(), c.controller->period_s());
      });
}

}  // namespace

void add_controllers(py::module_& module) {
  add_answer(module);
  add_world(module);
  ControllerClass controller = add_controller_class(module);
  add_controller_updates(controller);
  add_controller_properties(controller);
}

}  // namespace hamelin::python
