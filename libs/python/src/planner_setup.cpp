#include <fmt/format.h>
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <vector>

#include "hamelin/core/text.hpp"
#include "planner_arguments.hpp"

namespace hamelin::python {

namespace {

py::object setup_clearance(PySetup& s, py::handle q, double time_ahead, double at_least) {
  const FiniteRows at("clearance", "q", q, s.model->model.dof());
  auto out = new_array({at.count()});
  s.query.get("PlannerSetup")
      .clearance(at.all(), time_ahead, at_least,
                 {out.mutable_data(), static_cast<std::size_t>(at.count())});
  return number_or_array(at.single(), out);
}

bool setup_motion_clear(PySetup& s, py::handle q0, py::handle q1) {
  const py::ssize_t dof = s.model->model.dof();
  const Eigen::VectorXd a = python::vector_of("motion_clear", "q0", q0, dof);
  const Eigen::VectorXd b = python::vector_of("motion_clear", "q1", q1, dof);
  if (!a.allFinite() || !b.allFinite()) refuse("motion_clear", "q0, q1", "are not finite");
  const auto size = static_cast<std::size_t>(dof);
  return s.query.get("PlannerSetup").motion_clear({a.data(), size}, {b.data(), size});
}

py::object setup_distance(PySetup& s, py::handle points, double time_ahead, double limit) {
  const FiniteRows at("distance", "points", points, 3);
  auto out = new_array({at.count()});
  for (py::ssize_t i = 0; i < at.count(); ++i)
    out.mutable_data()[i] =
        s.query.get("PlannerSetup").distance(Eigen::Vector3d(at[i]), time_ahead, limit);
  return number_or_array(at.single(), out);
}

void setup_draw_path(PySetup& s, py::handle points) {
  const Numbers numbers("draw_path", "points", points);
  numbers.require_rows(3);
  std::vector<Eigen::Vector3d> path;
  for (py::ssize_t i = 0; i < numbers.extent(0); ++i)
    path.emplace_back(Eigen::Map<const Eigen::Vector3d>(numbers.data() + 3 * i));
  s.services().draw_path(path);
}

py::dict facts_of(const planning::Setup& setup) {
  py::dict out;
  out["dof"] = setup.dof();
  out["q_lower"] = array_or_none(setup.q_lower());
  out["q_upper"] = array_or_none(setup.q_upper());
  out["velocity_max"] = array_or_none(setup.velocity_max());
  out["effort_max"] = array_or_none(setup.effort_max());
  out["effort_rate_max"] = array_or_none(setup.effort_rate_max());
  out["control_period_s"] = setup.control_period_s();
  out["deadline_s"] = setup.deadline_s();
  out["delay_s"] = setup.delay_s();
  out["sampled"] = setup.sampled();
  out["self_collision"] = setup.self_collision();
  out["influence_m"] = setup.influence_m();
  out["map_resolution_m"] = setup.map_resolution_m();
  out["shield_margin_m"] = setup.shield_margin_m();
  out["seed"] = setup.seed();
  py::list goals;
  for (const auto& goal : setup.goals())
    goals.append(goal_dict(goal, static_cast<std::size_t>(setup.dof())));
  out["goals"] = goals;
  return out;
}

using PlannerSetupClass = py::class_<PySetup, std::shared_ptr<PySetup>>;

void add_services(PlannerSetupClass& type) {
  using py::arg;
  type.def(
          "log",
          [](const PySetup& s, const std::string& text) { s.services().info(one_line(text)); },
          arg("text"), "Writes a line to the log.")
      .def(
          "warn",
          [](const PySetup& s, const std::string& text) { s.services().warning(one_line(text)); },
          arg("text"), "Writes a warning to the log.")
      .def(
          "declare_series",
          [](const PySetup& s, const std::string& name, const std::string& unit) {
            if (!s.starting)
              refuse("PlannerSetup", "declare_series", "called after start(), expected in start()");
            return s.services().declare_series(name, unit);
          },
          arg("name"), arg("unit") = "",
          "Declares a series of numbers for log and report; in start() only. Returns its number,\n"
          "for Command.set_series().")
      .def("draw_path", &setup_draw_path, arg("points"),
           "Draws a line of points of the world, shape (N, 3) [m], for log and report; in tick().")
      .def(
          "request_path", [](const PySetup& s) { return s.services().request_path(); },
          "Asks for a collision-free path to the current goal; in tick(). Returns whether one\n"
          "will be searched. Later ticks have another goal: at first one where the arm waits, then "
          "one\n"
          "with the path, or the goal itself if none was found; goal[\"path_search\"] says which.");
}

void add_queries(PlannerSetupClass& type) {
  using py::arg;
  type.def("clearance", &setup_clearance, arg("q"), py::kw_only(), arg("time_ahead") = 0.0,
           arg("at_least") = -1.0e9,
           "Smallest distance at q, shape (n,) or (N, n), from obstacles and of the arm from "
           "itself\n"
           "[m]; exact from `at_least` up to influence_m.")
      .def(
          "motion_clear", &setup_motion_clear, arg("q0"), arg("q1"),
          "Whether the straight joint motion from q0 to q1 is proved clear; obstacles stand still.")
      .def("distance", &setup_distance, arg("points"), py::kw_only(), arg("time_ahead") = 0.0,
           arg("limit") = 1.0, "Distances of points, shape (3,) or (N, 3), at most `limit` [m].")
      .def(
          "refresh", [](PySetup& s) { s.query.get("PlannerSetup").refresh(); },
          "Takes the newest snapshot of the world for clearance(), motion_clear(), distance().");
}

}  // namespace

PySetup::PySetup(const planning::Setup& setup, planning::Query& answers)
    : model(std::make_shared<BoundModel>(setup.model())), facts(facts_of(setup)) {
  query.set(&answers);
}

void add_setup(py::module_& module) {
  PlannerSetupClass type(
      module, "PlannerSetup",
      "What is fixed for a run, and the services of the host. A planner gets it by\n"
      "start(setup). Limits are None where the scene does not model them. The\n"
      "queries may be used until the run ends; log(), warn(), declare_series(), draw_path() and\n"
      "request_path() in calls of the planner.");
  type.def_property_readonly(
          "model", [](const PySetup& s) { return s.model; }, "The planner's model of the arm.")
      .def_property_readonly(
          "facts", [](const PySetup& s) { return s.facts; },
          "All that is fixed, as a dict: dof, q_lower, q_upper, velocity_max,\n"
          "effort_max, effort_rate_max (arrays or None), control_period_s,\n"
          "deadline_s, delay_s, sampled, self_collision, influence_m,\n"
          "map_resolution_m, shield_margin_m, seed, goals.")
      .def(
          "__getattr__",
          [](const PySetup& s, const std::string& name) -> py::object {
            if (s.facts && s.facts.contains(name.c_str())) return s.facts[name.c_str()];
            throw py::attribute_error(fmt::format("PlannerSetup has no attribute '{}'", name));
          },
          py::arg("name"), "One of the facts.");
  add_services(type);
  add_queries(type);
  type.def("__repr__", [](const PySetup& s) {
    return fmt::format("<hamelin.PlannerSetup for '{}'>",
                       s.model ? s.model->model.robot().name : "");
  });
}

}  // namespace hamelin::python
