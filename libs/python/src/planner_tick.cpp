#include <fmt/format.h>
#include <pybind11/stl.h>

#include <array>
#include <cstring>
#include <memory>

#include "planner_arguments.hpp"

namespace hamelin::python {

// A contact of a tick as an element of an array of numpy.
struct TickContactRow {
  std::int32_t shape, link, obstacle;
  double distance_m;
  double arm_point_m[3], obstacle_point_m[3], direction[3], obstacle_velocity_m_s[3];
};

struct TickSelfContactRow {
  std::int32_t shape_a, shape_b;
  double distance_m;
  double point_a_m[3], point_b_m[3], direction[3];
};

namespace {

void copy_numbers(const double (&from)[3], double (&to)[3]) {
  std::memcpy(to, from, sizeof to);
}

py::array_t<double> array3(const double (&x)[3]) {
  return to_array(Eigen::Vector3d(x[0], x[1], x[2]));
}

py::array_t<double> numbers_at(const double* x, std::size_t n) {
  return to_array(
      Eigen::VectorXd(Eigen::Map<const Eigen::VectorXd>(x, static_cast<Eigen::Index>(n))));
}

py::array_t<TickContactRow> tick_contacts(const PyTick& t) {
  const auto contacts = t.get().contacts();
  py::array_t<TickContactRow> out(static_cast<py::ssize_t>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const hamelin_contact& from = contacts[i];
    TickContactRow& row = out.mutable_data()[i];
    row.shape = from.shape;
    row.link = t.links.at(static_cast<std::size_t>(from.shape));
    row.obstacle = from.obstacle;
    row.distance_m = from.distance_m;
    copy_numbers(from.arm_point_world_m, row.arm_point_m);
    copy_numbers(from.obstacle_point_world_m, row.obstacle_point_m);
    copy_numbers(from.direction_world, row.direction);
    copy_numbers(from.obstacle_velocity_world_m_s, row.obstacle_velocity_m_s);
  }
  return out;
}

py::array_t<TickSelfContactRow> tick_self_contacts(const PyTick& t) {
  const auto contacts = t.get().self_contacts();
  py::array_t<TickSelfContactRow> out(static_cast<py::ssize_t>(contacts.size()));
  for (std::size_t i = 0; i < contacts.size(); ++i) {
    const hamelin_self_contact& from = contacts[i];
    TickSelfContactRow& row = out.mutable_data()[i];
    row.shape_a = from.shape_a;
    row.shape_b = from.shape_b;
    row.distance_m = from.distance_m;
    copy_numbers(from.point_a_world_m, row.point_a_m);
    copy_numbers(from.point_b_world_m, row.point_b_m);
    copy_numbers(from.direction_world, row.direction);
  }
  return out;
}

py::object tick_reference(const PyTick& t) {
  const auto reference = t.get().reference();
  if (!reference) return py::none();
  py::dict out;
  out["q"] = to_array(Eigen::VectorXd(reference->q));
  out["v"] = to_array(Eigen::VectorXd(reference->v));
  out["a"] = to_array(Eigen::VectorXd(reference->a));
  out["time_s"] = reference->time_s;
  out["rate"] = reference->rate;
  return out;
}

using TickClass = py::class_<PyTick, std::shared_ptr<PyTick>>;

// What surrounds the arm, and what acted on it.
void add_observations(TickClass& type) {
  type.def_property_readonly("contacts", &tick_contacts,
                             "Near obstacle points, shape by shape, nearest first: a structured\n"
                             "array with shape, link, obstacle, distance_m, arm_point_m,\n"
                             "obstacle_point_m, direction, obstacle_velocity_m_s; a copy.")
      .def_property_readonly("self_contacts", &tick_self_contacts,
                             "Near pairs of parts of the arm: a structured array with shape_a,\n"
                             "shape_b, distance_m, point_a_m, point_b_m, direction; a copy.")
      .def_property_readonly(
          "torque", [](const PyTick& t) { return array_or_none(t.get().torque()); },
          "Joint torques sent to the arm last, shape (n,); None under ideal\n"
          "actuation.")
      .def_property_readonly(
          "disturbance", [](const PyTick& t) { return array_or_none(t.get().disturbance()); },
          "Joint accelerations that the model does not explain, because of friction or wrong\n"
          "masses, shape (n,); None where no torques are sent.")
      .def_property_readonly(
          "world", [](const PyTick& t) { return t.get().world(); },
          "Number of the world's snapshot; changes with obstacles and map.")
      .def_property_readonly(
          "speed_scale", [](const PyTick& t) { return t.get().speed_scale(); },
          "1, or less where the scene requires slow motion.")
      .def_property_readonly(
          "moving_count", [](const PyTick& t) { return t.get().moving_count(); },
          "Number of obstacles that move, or may move later.");
}

}  // namespace

PyTick::PyTick(const planning::Setup& setup)
    : dof(static_cast<std::size_t>(setup.dof())),
      q(new_array({setup.dof()})),
      v(new_array({setup.dof()})) {
  for (const auto& shape : setup.shapes()) links.push_back(shape.link);
  for (auto* x : {&q, &v}) x->attr("setflags")(py::arg("write") = false);
}

void PyTick::copy_state(const planning::Tick& from) {
  std::memcpy(const_cast<double*>(q.data()), from.q().data(), sizeof(double) * dof);
  std::memcpy(const_cast<double*>(v.data()), from.v().data(), sizeof(double) * dof);
}

py::dict goal_dict(const hamelin_goal& goal, std::size_t dof) {
  static constexpr std::array<const char*, 4> types{"joint", "position", "pose", "follow"};
  py::dict out;
  const auto type = static_cast<std::size_t>(goal.type);
  out["type"] = type < types.size() ? types[type] : "unknown";
  out["tolerance_m"] = goal.tolerance_m;
  out["tolerance_rad"] = goal.tolerance_rad;
  out["speed_max"] = goal.speed_max;
  if (goal.path_points > 0) {
    auto path =
        new_array({static_cast<py::ssize_t>(goal.path_points), static_cast<py::ssize_t>(dof)});
    std::memcpy(path.mutable_data(), goal.path, sizeof(double) * goal.path_points * dof);
    out["path"] = path;
    if (goal.path_margin_m > 0.0) out["path_margin_m"] = goal.path_margin_m;
  }
  static constexpr std::array<const char*, 4> searches{"not sought", "sought", "found",
                                                       "not found"};
  if (const auto search = static_cast<std::size_t>(goal.path_search); search < searches.size())
    out["path_search"] = searches[search];
  if (goal.q != nullptr) {
    out["q"] = numbers_at(goal.q, dof);
  } else {
    out["position_m"] = array3(goal.position_world_m);
    out["quaternion_wxyz"] = numbers_at(&goal.quaternion_wxyz[0], 4);
    out["velocity_m_s"] = array3(goal.velocity_world_m_s);
    out["angular_velocity_rad_s"] = array3(goal.angular_velocity_world_rad_s);
  }
  return out;
}

void add_tick(py::module_& module) {
  PYBIND11_NUMPY_DTYPE(TickContactRow, shape, link, obstacle, distance_m, arm_point_m,
                       obstacle_point_m, direction, obstacle_velocity_m_s);
  PYBIND11_NUMPY_DTYPE(TickSelfContactRow, shape_a, shape_b, distance_m, point_a_m, point_b_m,
                       direction);
  TickClass type(module, "Tick",
                 "The input of one tick of a planner. Valid during the call of tick().");
  type.def_property_readonly(
          "k", [](const PyTick& t) { return t.get().k(); }, "Index of the tick.")
      .def_property_readonly(
          "time_s", [](const PyTick& t) { return t.get().time_s(); }, "Time [s].")
      .def_property_readonly(
          "q", [](const PyTick& t) -> py::object { return t.q; },
          "Joint positions, shape (n,) [rad or m]. The same array at each tick, read-only; copy "
          "it\n"
          "to keep it.")
      .def_property_readonly(
          "v", [](const PyTick& t) -> py::object { return t.v; },
          "Joint velocities, shape (n,) [rad/s or m/s], as q.")
      .def_property_readonly(
          "goal", [](const PyTick& t) { return goal_dict(t.get().goal(), t.dof); },
          "The current goal as a dict: type, tolerances, path, path_margin_m (its clearance away\n"
          "from its ends, if it was searched), path_search (\"not sought\", \"sought\",\n"
          "\"found\", \"not found\"), and q or position_m, quaternion_wxyz, velocity_m_s,\n"
          "angular_velocity_rad_s; a copy.")
      .def_property_readonly(
          "goal_number", [](const PyTick& t) { return t.get().goal_number(); },
          "Another number means another goal.")
      .def_property_readonly(
          "goal_index", [](const PyTick& t) { return t.get().goal_index(); },
          "Index of the goal in its list.")
      .def_property_readonly(
          "reference", &tick_reference,
          "Where the arm should be by the trajectory of its goal: a dict with q,\n"
          "v, a, time_s, rate; None without a trajectory.");
  add_observations(type);
  type.def("__repr__", [](const PyTick&) { return "<hamelin.Tick>"; });
}

}  // namespace hamelin::python
