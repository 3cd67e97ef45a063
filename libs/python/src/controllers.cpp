#include <fmt/format.h>
#include <pybind11/stl.h>

#include <cmath>
#include <memory>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/control/controller.hpp"
#include "hamelin/core/error.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "planner_object.hpp"

namespace hamelin::python {

namespace {

using control::Controller;

const char* name_of(control::ControlState state) {
  switch (state) {
    case control::ControlState::running:
      return "running";
    case control::ControlState::reached:
      return "reached";
    case control::ControlState::stalled:
      return "stalled";
    case control::ControlState::gave_up:
      return "gave_up";
    case control::ControlState::stopping:
      return "stopping";
  }
  return "unknown";
}

// What a tick answered.
struct AnswerCopy {
  control::ControlState state;
  bool saturated, stopping;
  std::uint64_t goals_number, snapshot, load, refused_load;
  std::size_t goal_index;
  std::string cause, load_refusal;
  Eigen::VectorXd torque, q_next, v_next;
};

AnswerCopy copy_of(const control::Answer& a) {
  return {a.state,  a.saturated,    a.stopping,   a.goals_number,       a.snapshot,
          a.load,   a.refused_load, a.goal_index, std::string(a.cause), std::string(a.load_refusal),
          a.torque, a.q_next,       a.v_next};
}

using PyAnswer = Boxed<AnswerCopy>;  // hamelin.Answer

// hamelin.Controller. Ticks hold Python's lock; calls that lock, or take longer, release it.
struct BoundController : Whole {
  BoundController(SharedScene from, py::object planner, const py::list& plugins,
                  const control::ControllerOptions& options)
      : scene(std::move(from)), object(std::move(planner)) {
    scene::Scene chosen = scene->scene;
    const auto folders = plugin_path(paths_of(plugins));
    const PlannerObjectScope scope(object, chosen);
    const py::gil_scoped_release unlocked;
    controller = std::make_unique<Controller>(chosen, folders, options);
  }

  SharedScene scene;
  py::object object;  // the planner, where it is one of Python
  std::unique_ptr<Controller> controller;
  Eigen::VectorXd q, v;
  bool busy = false;
  InterruptCheck interrupts;
};

using SharedController = std::shared_ptr<BoundController>;

// hamelin.World: a part of a controller.
struct BoundWorld : Whole {
  explicit BoundWorld(SharedController controller) : owner(std::move(controller)) {}
  SharedController owner;
  [[nodiscard]] control::World& get() const { return owner->controller->world(); }
};

// The scene's document with other values of some keys, as a scene: it is read and checked as any.
scene::Scene variant(const BoundScene& scene, const char* key, const Json& value) {
  Json document = scene.document;
  document.erase("events");
  document[key] = value;
  return scene::scene_from_json(document, scene.folder, key);
}

std::vector<scene::Goal> goals_of(const BoundScene& scene, py::handle goals) {
  Json list = to_json(goals);
  if (list.is_object()) list = Json::array({list});
  return variant(scene, "goals", list).goals;
}

void take_state(BoundController& c, py::handle q, py::handle v) {
  const auto dof = c.controller->model().dof();
  const Numbers positions("tick", "q", q), velocities("tick", "v", v);
  positions.require_vector(dof);
  velocities.require_vector(dof);
  c.q = positions.vector();
  c.v = velocities.vector();
}

std::shared_ptr<PyAnswer> tick(BoundController& c, double time_s, py::handle q, py::handle v) {
  if (c.busy)
    throw Error(ErrorCode::usage, "Controller: tick() is called by its planner, expected a loop");
  take_state(c, q, v);
  c.busy = true;
  const struct Done {
    bool& busy;
    ~Done() { busy = false; }
  } done{c.busy};
  if (c.object.is_none()) return boxed(copy_of(c.controller->tick(time_s, c.q, c.v)));
  const InterruptScope scope(c.interrupts);
  AnswerCopy answer = copy_of(c.controller->tick(time_s, c.q, c.v));
  c.interrupts.rethrow();
  return boxed(std::move(answer));
}

std::optional<Eigen::Vector3d> optional_vector3(const char* function, const char* argument,
                                                py::handle given) {
  if (given.is_none()) return std::nullopt;
  return vector3_of(function, argument, given);
}

control::Observation observation_of(const char* function, double time_s, py::handle pose,
                                    py::handle velocity, py::handle acceleration,
                                    py::handle angular_velocity) {
  return {time_s, pose_of(function, "pose", pose), optional_vector3(function, "velocity", velocity),
          optional_vector3(function, "acceleration", acceleration),
          optional_vector3(function, "angular_velocity", angular_velocity)};
}

std::uint64_t set_goals(BoundController& c, py::handle goals) {
  auto all = goals_of(*c.scene, goals);
  const py::gil_scoped_release unlocked;
  return c.controller->set_goals(std::move(all));
}

std::uint64_t attach(BoundController& c, py::handle payload, py::handle q) {
  const Eigen::VectorXd at = vector_of("attach", "q", q, c.controller->model().dof());
  Json model = c.scene->document.value("model", Json::object());
  if (!model.is_object()) model = Json::object();
  model["payload"] = to_json(payload);
  const scene::Scene read = variant(*c.scene, "model", model);
  if (!read.model.payload) refuse("attach", "payload", "is null, expected a payload");
  const PlannerObjectScope scope(c.object);
  const py::gil_scoped_release unlocked;
  return c.controller->attach(*read.model.payload, at);
}

std::uint64_t detach(BoundController& c, const std::string& name, py::handle q) {
  const Eigen::VectorXd at = vector_of("detach", "q", q, c.controller->model().dof());
  const PlannerObjectScope scope(c.object);
  const py::gil_scoped_release unlocked;
  return c.controller->detach(name, at);
}

// Refuses calls for the thread of tick() while a planner in Python answers one.
Controller& idle(const BoundController& c) {
  if (c.busy)
    throw Error(ErrorCode::usage, "Controller: a tick uses it, expected a call between two ticks");
  return *c.controller;
}

py::object verdict(const BoundController& c) {
  const auto& verdict = idle(c).verdict();
  if (!verdict) return py::none();
  py::dict out;
  out["certified"] = verdict->certified;
  out["margin_m"] = verdict->margin_m;
  out["contact"] = verdict->contact;
  return out;
}

SharedController make_controller(py::handle scene, py::object planner, py::handle plugins,
                                 const std::optional<double>& period, bool position, bool certify,
                                 std::size_t obstacles_max,
                                 const std::vector<double>& acceleration_max,
                                 const std::vector<double>& jerk_max) {
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
  if (obstacles_max > 100'000)
    refuse("Controller", "obstacles_max", fmt::format("{}, expected 0 to 100000", obstacles_max));
  options.obstacles_max = obstacles_max;
  options.acceleration_max = acceleration_max;
  options.jerk_max = jerk_max;
  py::list folders;
  for (const auto& folder : paths_of(plugins)) folders.append(folder.string());
  return std::make_shared<BoundController>(scene_of(scene, overrides), std::move(object), folders,
                                           options);
}

void add_answer(py::module_& module) {
  py::class_<PyAnswer, std::shared_ptr<PyAnswer>>(module, "Answer",
                                                  "The answer of a tick of a Controller; a copy.")
      .def_property_readonly(
          "state", [](const PyAnswer& a) { return name_of(a.state); },
          "'running', 'reached', 'stalled', 'gave_up' or 'stopping'.")
      .def_readonly("cause", &AnswerCopy::cause, "Why it gave up or stops; one line, or empty.")
      .def_property_readonly(
          "torque", [](const PyAnswer& a) { return to_array(a.torque); },
          "Joint torques to send to the arm, shape (n,) [Nm or N].")
      .def_property_readonly(
          "q_next", [](const PyAnswer& a) { return to_array(a.q_next); },
          "Joint positions one period ahead, shape (n,), with position=True.")
      .def_property_readonly(
          "v_next", [](const PyAnswer& a) { return to_array(a.v_next); },
          "Joint velocities one period ahead, shape (n,), with position=True.")
      .def_readonly("saturated", &AnswerCopy::saturated, "Whether a limit reduced the torque.")
      .def_readonly("stopping", &AnswerCopy::stopping,
                    "Whether the shield refused the planner's answer.")
      .def_readonly("goals_number", &AnswerCopy::goals_number,
                    "Number of the list of goals: 0 for the scene's, or of set_goals().")
      .def_readonly("goal_index", &AnswerCopy::goal_index, "Index of the current goal in it.")
      .def_readonly("snapshot", &AnswerCopy::snapshot, "Number of the world's snapshot.")
      .def_readonly("load", &AnswerCopy::load, "Number of what the arm carries.")
      .def_readonly("refused_load", &AnswerCopy::refused_load, "Number of the last refused load.")
      .def_readonly("load_refusal", &AnswerCopy::load_refusal, "Why it was refused.")
      .def("__repr__", [](const PyAnswer& a) {
        return fmt::format("<hamelin.Answer {}, goal {}{}>", name_of(a.state), a.goal_index,
                           a.cause.empty() ? "" : ": " + a.cause);
      });
}

void add_world(py::module_& module) {
  using py::arg;
  py::class_<BoundWorld, std::shared_ptr<BoundWorld>>(
      module, "World",
      "The surroundings of a controller. Any thread may update them; an update\n"
      "takes effect at the next tick and returns the number of its snapshot.")
      .def(
          "set_obstacle",
          [](const BoundWorld& w, py::handle obstacle) {
            const auto read =
                variant(*w.owner->scene, "obstacles", Json::array({to_json(obstacle)})).obstacles;
            const py::gil_scoped_release unlocked;
            return w.get().set_obstacle(read.front());
          },
          arg("obstacle"),
          "Adds an obstacle, a dict as in a scene, or replaces the one of the same name.")
      .def(
          "move_obstacle",
          [](const BoundWorld& w, const std::string& name, py::handle pose, py::handle velocity,
             double time_s) {
            const auto at = pose_of("move_obstacle", "pose", pose);
            const auto v = optional_vector3("move_obstacle", "velocity", velocity)
                               .value_or(Eigen::Vector3d::Zero());
            const py::gil_scoped_release unlocked;
            return w.get().move_obstacle(name, at, v, time_s);
          },
          arg("name"), arg("pose"), py::kw_only(), arg("velocity") = py::none(), arg("time"),
          "Moves an obstacle: at `time` [s] it is at the pose, shape (4, 4), from where it goes "
          "on\n"
          "with the velocity, shape (3,) [m/s].")
      .def(
          "observe_obstacle",
          [](const BoundWorld& w, const std::string& name, py::handle pose, double time_s,
             py::handle velocity, py::handle acceleration, py::handle angular_velocity) {
            const auto seen = observation_of("observe_obstacle", time_s, pose, velocity,
                                             acceleration, angular_velocity);
            const py::gil_scoped_release unlocked;
            return w.get().observe_obstacle(name, seen);
          },
          arg("name"), arg("pose"), py::kw_only(), arg("time"), arg("velocity") = py::none(),
          arg("acceleration") = py::none(), arg("angular_velocity") = py::none(),
          "Takes a pose, shape (4, 4), of a stream of poses. Motion that is not given, shape (3,)\n"
          "each, is estimated.")
      .def(
          "remove_obstacle",
          [](const BoundWorld& w, const std::string& name) {
            const py::gil_scoped_release unlocked;
            return w.get().remove_obstacle(name);
          },
          arg("name"), "Removes an obstacle.")
      .def(
          "last_observed",
          [](const BoundWorld& w, const std::string& name) {
            const py::gil_scoped_release unlocked;
            return w.get().last_observed(name);
          },
          arg("name"), "Time of the last observation [s]; None without one.")
      .def(
          "set_map",
          [](const BoundWorld& w, py::handle map, py::handle q) {
            const auto read = variant(*w.owner->scene, "map", to_json(map)).map;
            const Eigen::VectorXd at =
                optional_vector("set_map", "q", q, w.owner->controller->model().dof());
            const py::gil_scoped_release unlocked;
            return w.get().set_map(read, at);
          },
          arg("map"), arg("q") = py::none(),
          "Replaces the map by that of a dict as in a scene; None removes it. q: configuration in\n"
          "which a self-filter finds the arm, shape (n,); None: the scene's start.")
      .def_property_readonly(
          "number",
          [](const BoundWorld& w) {
            const py::gil_scoped_release unlocked;
            return w.get().latest()->number;
          },
          "Number of the newest snapshot.")
      .def("__repr__", [](const BoundWorld& w) {
        const py::gil_scoped_release unlocked;
        const auto latest = w.get().latest();
        return fmt::format("<hamelin.World snapshot {}, {} obstacles>", latest->number,
                           latest->environment.obstacles().size());
      });
}

void add_controller(py::module_& module) {
  using py::arg;
  py::class_<BoundController, SharedController>(module, "Controller",
                                                "The control loop of an arm, without a plant. One "
                                                "thread calls tick(); any thread may update\n"
                                                "world, goals and parameters.")
      .def(
          py::init(&make_controller), arg("scene"), py::kw_only(), arg("planner") = py::none(),
          arg("plugin_path") = py::none(), arg("period") = py::none(), arg("position") = false,
          arg("certify") = true, arg("obstacles_max") = 64,
          arg("acceleration_max") = std::vector<double>{15.0},
          arg("jerk_max") = std::vector<double>{5000.0},
          "scene: a Scene, a dict or a file. planner: a name, an object with tick(tick, command),\n"
          "or None: the scene's. period: time between two ticks [s]; None: the scene's.\n"
          "position: whether answers have q_next and v_next. certify: prove that the motion since "
          "the last tick was\n"
          "clear. acceleration_max, jerk_max: of the positions, one value or one per joint.")
      .def("tick", &tick, arg("time"), arg("q"), arg("v"),
           "Answers the measured state of the arm: time [s], increasing; q, v of shape (n,).")
      .def_property_readonly(
          "world", [](const SharedController& c) { return std::make_shared<BoundWorld>(c); },
          "The surroundings.")
      .def("set_goals", &set_goals, arg("goals"),
           "Replaces the goals by dicts as in a scene, from the next tick on. Returns the number "
           "of\n"
           "the list, see Answer.goals_number.")
      .def(
          "set_target",
          [](BoundController& c, double time_s, py::handle pose, py::handle velocity,
             py::handle angular_velocity) {
            const auto target =
                observation_of("set_target", time_s, pose, velocity, py::none(), angular_velocity);
            const py::gil_scoped_release unlocked;
            c.controller->set_target(target);
          },
          arg("time"), arg("pose"), py::kw_only(), arg("velocity") = py::none(),
          arg("angular_velocity") = py::none(),
          "Moves the target of a follow goal to a pose, shape (4, 4). Velocities, shape (3,), "
          "that\n"
          "are not given are estimated.")
      .def(
          "set_target_twist",
          [](BoundController& c, double time_s, py::handle velocity, py::handle angular_velocity) {
            const control::TargetTwist twist{
                time_s,
                optional_vector3("set_target_twist", "velocity", velocity)
                    .value_or(Eigen::Vector3d::Zero()),
                optional_vector3("set_target_twist", "angular_velocity", angular_velocity)
                    .value_or(Eigen::Vector3d::Zero())};
            const py::gil_scoped_release unlocked;
            c.controller->set_target(twist);
          },
          arg("time"), py::kw_only(), arg("velocity") = py::none(),
          arg("angular_velocity") = py::none(),
          "Commands the target of a follow goal by a twist, shape (3,) each, in world axes.")
      .def(
          "set_planner_params",
          [](BoundController& c, py::handle changes) {
            const Json json = to_json(changes);
            const py::gil_scoped_release unlocked;
            c.controller->set_planner_params(json);
          },
          arg("changes"), "Changes parameters of the planner, from the next tick on.")
      .def(
          "planner_params",
          [](BoundController& c) {
            Json params;
            {
              const py::gil_scoped_release unlocked;
              params = c.controller->planner_params();
            }
            return to_python(params);
          },
          "All parameters of the planner, as a dict.")
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
      .def(
          "reset", [](BoundController& c) { idle(c).reset(); },
          "Forgets goals that were reached and the last motion, for a new start.")
      .def(
          "run_guide", [](BoundController& c) { idle(c).run_guide(); },
          "Searches the path that the last tick asked for, where the guide has no thread.")
      .def_property_readonly("verdict", &verdict,
                             "The proof for the motion between the last two ticks: a dict with\n"
                             "certified, margin_m, contact; None after the first tick.")
      .def_property_readonly(
          "period_s", [](const BoundController& c) { return c.controller->period_s(); },
          "Time between two ticks [s].")
      .def_property_readonly(
          "dof", [](const BoundController& c) { return c.controller->model().dof(); },
          "Number of joints n.")
      .def_property_readonly(
          "tip", [](const BoundController& c) { return to_array(idle(c).tip()); },
          "Pose of the tip at the last tick, shape (4, 4).")
      .def("__repr__", [](const BoundController& c) {
        return fmt::format("<hamelin.Controller '{}': planner {}, period {:g} s>", c.scene->name,
                           c.controller->plugin().name(), c.controller->period_s());
      });
}

}  // namespace

void add_controllers(py::module_& module) {
  add_answer(module);
  add_world(module);
  add_controller(module);
}

}  // namespace hamelin::python
