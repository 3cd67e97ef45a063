#include <fmt/format.h>
#include <pybind11/stl.h>

#include <cstring>
#include <memory>
#include <string>

#include "planner_arguments.hpp"

namespace hamelin::python {

namespace {

void copy_channel(const char* name, const py::array_t<double>& from, planning::VectorMap to) {
  if (from.size() != to.size())
    refuse("Command", name, fmt::format("{} numbers, expected {}", from.size(), to.size()));
  std::memcpy(to.data(), from.data(), sizeof(double) * static_cast<std::size_t>(to.size()));
}

void assign(py::array_t<double>& to, const char* name, py::handle from) {
  const Eigen::VectorXd x = python::vector_of("Command", name, from, to.size());
  std::memcpy(to.mutable_data(), x.data(), sizeof(double) * static_cast<std::size_t>(x.size()));
}

void add_gyroscopic(PyCommand& c, int link, py::handle point, py::handle w) {
  const Eigen::Vector3d p = vector3_of("Command", "point", point);
  const Eigen::Vector3d axis = vector3_of("Command", "w", w);
  if (link < 0 || link >= c.damping.size())
    refuse("Command", "link", fmt::format("{}, expected 0 to {}", link, c.damping.size() - 1));
  const hamelin_command& raw = c.get().raw();
  if (raw.gyroscopic_count >= raw.gyroscopic_capacity)
    refuse("Command", "add_gyroscopic",
           fmt::format("{} terms, expected no more", raw.gyroscopic_count));
  c.get().add_gyroscopic(link, p, axis);
}

void set_series(PyCommand& c, int series, double value) {
  if (series < 0 || static_cast<std::size_t>(series) >= c.get().raw().series_count)
    refuse("Command", "series",
           fmt::format("{}, expected a number that declare_series returned", series));
  c.get().set_series(series, value);
}

template <py::array_t<double> PyCommand::*member>
void add_channel(py::class_<PyCommand, std::shared_ptr<PyCommand>>& type, const char* name,
                 const char* text) {
  type.def_property(
      name, [](const PyCommand& c) -> py::object { return c.*member; },
      [name](PyCommand& c, py::handle x) { assign(c.*member, name, x); }, text);
}

template <class T, T hamelin_command::*member>
void add_number(py::class_<PyCommand, std::shared_ptr<PyCommand>>& type, const char* name,
                const char* text) {
  type.def_property(
      name, [](const PyCommand& c) { return c.get().raw().*member; },
      [](PyCommand& c, T value) { c.get().raw().*member = value; }, text);
}

}  // namespace

PyCommand::PyCommand(std::size_t n) {
  for (auto* x : {&potential_gradient, &damping, &held_torque})
    *x = new_array({static_cast<py::ssize_t>(n)});
}

void PyCommand::clear() {
  for (auto* array : {&potential_gradient, &damping, &held_torque})
    std::memset(array->mutable_data(), 0, sizeof(double) * static_cast<std::size_t>(array->size()));
  node_velocity.reset();
}

void PyCommand::copy_to(planning::Command& host) const {
  copy_channel("potential_gradient", potential_gradient, host.potential_gradient());
  copy_channel("damping", damping, host.damping());
  copy_channel("held_torque", held_torque, host.held_torque());
  if (node_velocity) host.node_velocity() = *node_velocity;
}

void add_command(py::module_& module) {
  using py::arg;
  py::class_<PyCommand, std::shared_ptr<PyCommand>> type(
      module, "Command",
      "The answer of one tick of a planner, in channels that are zero at\n"
      "first. Valid during the call of tick().");
  add_channel<&PyCommand::potential_gradient>(
      type, "potential_gradient",
      "Gradient of a potential, shape (n,) [Nm or N]: the arm feels -g.");
  add_channel<&PyCommand::damping>(type, "damping",
                                   "Coefficients of damping, shape (n,), not negative [Nms/rad].");
  add_channel<&PyCommand::held_torque>(type, "held_torque",
                                       "Torque that is held over the step, shape (n,) [Nm or N].");
  type.def_property(
          "node_velocity",
          [](const PyCommand& c) -> py::object {
            if (!c.node_velocity) return py::none();
            return to_array(*c.node_velocity);
          },
          [](PyCommand& c, py::handle v) {
            if (v.is_none())
              c.node_velocity.reset();
            else
              c.node_velocity = python::vector_of("Command", "node_velocity", v, c.damping.size());
          },
          "Joint velocity that is set at the node, shape (n,) [rad/s or m/s]; None: not set.")
      .def("add_gyroscopic", &add_gyroscopic, arg("link"), arg("point"), arg("w"),
           "Adds the force w x (velocity of the point). link: index; point: shape (3,), in the "
           "link's\n"
           "centre-of-mass frame [m]; w: shape (3,), world axes [N s/m].")
      .def(
          "give_up", [](PyCommand& c, const std::string& cause) { c.get().give_up(cause); },
          arg("cause"), "Ends the run: the planner sees no way to the goal.")
      .def("set_series", &set_series, arg("series"), arg("value"),
           "Sets a number of a declared series, for log and report.")
      .def("__repr__", [](const PyCommand&) { return "<hamelin.Command>"; });
  add_number<double, &hamelin_command::potential_J>(type, "potential_J",
                                                    "The potential at this node [J].");
  add_number<double, &hamelin_command::filter_work_J>(
      type, "filter_work_J", "Work of node velocities by constraints that admit rest [J].");
  add_number<double, &hamelin_command::recovery_work_J>(
      type, "recovery_work_J", "Work of node velocities by constraints that demand motion [J].");
}

}  // namespace hamelin::python
