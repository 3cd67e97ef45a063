#include "bound_environment.hpp"

#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <string>
#include <vector>

#include "arguments.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/core/text.hpp"

namespace hamelin::python {

// A contact as an element of an array of numpy.
struct ContactRow {
  std::int32_t shape, obstacle;
  double distance_m;
  double arm_point_m[3], obstacle_point_m[3], direction[3], obstacle_velocity_m_s[3];
};

struct SelfContactRow {
  std::int32_t pair, shape_a, shape_b;
  double distance_m;
  double point_a_m[3], point_b_m[3], direction[3];
};

namespace {

scene::View view_of(const char* function, const std::string& name) {
  if (name == "judge") return scene::View::judge;
  if (name == "planner") return scene::View::planner;
  if (name == "hidden") return scene::View::hidden;
  refuse(function, "view", fmt::format("'{}', expected judge, planner or hidden", name));
}

double limit_of(const char* function, const char* argument, double value) {
  if (!(value >= 0.0)) refuse(function, argument, fmt::format("{}, expected at least 0", value));
  return value;
}

double time_of(const char* function, double time_s) {
  if (!std::isfinite(time_s)) refuse(function, "time", "is not finite");
  return time_s;
}

py::object distance(const BoundEnvironment& e, py::handle points, double limit, double time_s,
                    const std::string& view) {
  const FiniteRows at("distance", "points", points, 3);
  limit_of("distance", "limit", limit);
  const scene::Moment moment(time_of("distance", time_s));
  const scene::View seen = view_of("distance", view);
  auto out = new_array({at.count()});
  double* const y = out.mutable_data();
  {
    const py::gil_scoped_release unlocked;
    const double radius = 0.0;
    for (py::ssize_t i = 0; i < at.count(); ++i) {
      const Eigen::Vector3d center = at[i];
      y[i] = e.environment.clearance({{&center, 1}, {&radius, 1}}, moment, limit, seen);
    }
  }
  return number_or_array(at.single(), out);
}

py::object shape_distance(const BoundEnvironment& e, py::handle from, py::handle to,
                          py::handle radius, double limit, double time_s, const std::string& view) {
  const FiniteRows a("shape_distance", "start", from, 3);
  const FiniteRows b("shape_distance", "end", to.is_none() ? from : to, 3);
  const py::ssize_t count = a.count();
  if (b.count() != count || b.single() != a.single())
    refuse(
        "shape_distance", "end",
        fmt::format("shape {}, expected {}", describe_shape(b.array()), describe_shape(a.array())));
  const Numbers radii("shape_distance", "radius", radius);
  const bool one = radii.dimensions() == 0;
  if (!one) radii.require_vector(count);
  for (py::ssize_t i = 0; i < radii.size(); ++i)
    limit_of("shape_distance", "radius", radii.data()[i]);
  limit_of("shape_distance", "limit", limit);
  const scene::Moment moment(time_of("shape_distance", time_s));
  const scene::View seen = view_of("shape_distance", view);
  auto out = new_array({count});
  double* const y = out.mutable_data();
  {
    const py::gil_scoped_release unlocked;
    for (py::ssize_t i = 0; i < count; ++i) {
      const Eigen::Vector3d center = 0.5 * (a[i] + b[i]), half_axis = 0.5 * (b[i] - a[i]);
      const double r = radii.data()[one ? 0 : i];
      y[i] = e.environment.clearance({{&center, 1}, {&r, 1}, {&half_axis, 1}}, moment, limit, seen);
    }
  }
  return number_or_array(a.single(), out);
}

// Calls f(shapes, i) with the arm's shapes at each configuration.
template <class F>
void for_each_placed(const BoundEnvironment& e, const FiniteRows& q, const F& f) {
  const py::gil_scoped_release unlocked;
  const model::Model& model = e.model->model;
  dynamics::Workspace ws(model);
  scene::PlacedShapes arm(model);
  for (py::ssize_t i = 0; i < q.count(); ++i) {
    dynamics::forward_kinematics(model, ws, q[i]);
    arm.place(model, ws);
    f(arm.view(), i);
  }
}

py::object clearance(const BoundEnvironment& e, py::handle q, double limit, double time_s,
                     const std::string& view) {
  const FiniteRows at("clearance", "q", q, e.model->model.dof());
  limit_of("clearance", "limit", limit);
  const scene::Moment moment(time_of("clearance", time_s));
  const scene::View seen = view_of("clearance", view);
  auto out = new_array({at.count()});
  double* const y = out.mutable_data();
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t i) {
    y[i] = e.environment.clearance(arm, moment, limit, seen);
  });
  return number_or_array(at.single(), out);
}

py::object self_clearance(const BoundEnvironment& e, py::handle q, double limit) {
  const FiniteRows at("self_clearance", "q", q, e.model->model.dof());
  limit_of("self_clearance", "limit", limit);
  auto out = new_array({at.count()});
  double* const y = out.mutable_data();
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t i) {
    std::array<scene::SelfContact, 1> nearest;
    y[i] = e.self.closest(arm, limit, nearest) > 0 ? nearest[0].distance : limit;
  });
  return number_or_array(at.single(), out);
}

void copy3(const Eigen::Vector3d& from, double (&to)[3]) {
  std::copy_n(from.data(), 3, &to[0]);
}

py::array_t<ContactRow> contacts(const BoundEnvironment& e, py::handle q, double influence,
                                 double time_s, const std::string& view) {
  const FiniteRows at("contacts", "q", q, e.model->model.dof());
  if (!at.single()) refuse("contacts", "q", "is an array of states, expected one state");
  if (!(influence >= 0.0) || influence > e.influence_m)
    refuse(
        "contacts", "influence",
        fmt::format("{}, expected 0 to {}, the environment's influence", influence, e.influence_m));
  const scene::Moment moment(time_of("contacts", time_s));
  const scene::View seen = view_of("contacts", view);
  const std::size_t shapes = e.model->model.shapes().size();
  std::vector<scene::Contact> found(e.environment.contacts_max(shapes));
  std::size_t count = 0;
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t) {
    scene::Environment::Scratch scratch(e.environment, shapes);
    count = e.environment.closest(arm, influence, moment, scratch, found, seen);
  });
  py::array_t<ContactRow> out(static_cast<py::ssize_t>(count));
  for (std::size_t i = 0; i < count; ++i) {
    const scene::Contact& from = found[i];
    ContactRow& row = out.mutable_data()[i];
    row.shape = from.sphere;
    row.obstacle = from.obstacle;
    row.distance_m = from.distance;
    copy3(from.arm_point, row.arm_point_m);
    copy3(from.obstacle_point, row.obstacle_point_m);
    copy3(from.direction, row.direction);
    copy3(from.obstacle_velocity, row.obstacle_velocity_m_s);
  }
  return out;
}

py::array_t<SelfContactRow> self_contacts(const BoundEnvironment& e, py::handle q, double limit) {
  const FiniteRows at("self_contacts", "q", q, e.model->model.dof());
  if (!at.single()) refuse("self_contacts", "q", "is an array of states, expected one state");
  limit_of("self_contacts", "limit", limit);
  std::vector<scene::SelfContact> found(e.self.pairs().size());
  std::size_t count = 0;
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t) {
    count = e.self.closest(arm, limit, found);
  });
  py::array_t<SelfContactRow> out(static_cast<py::ssize_t>(count));
  for (std::size_t i = 0; i < count; ++i) {
    const scene::SelfContact& from = found[i];
    SelfContactRow& row = out.mutable_data()[i];
    row.pair = from.pair;
    row.shape_a = from.sphere_a;
    row.shape_b = from.sphere_b;
    row.distance_m = from.distance;
    copy3(from.point_a, row.point_a_m);
    copy3(from.point_b, row.point_b_m);
    copy3(from.direction, row.direction);
  }
  return out;
}

py::tuple boxes(const BoundEnvironment& e) {
  std::vector<scene::Box> alive;
  e.environment.map_field().boxes().for_each_alive(
      [&](const scene::Box& box) { alive.push_back(box); });
  const auto count = static_cast<py::ssize_t>(alive.size());
  auto low = new_array({count, 3}), high = new_array({count, 3});
  for (py::ssize_t i = 0; i < count; ++i) {
    Eigen::Map<Eigen::Vector3d>(low.mutable_data() + 3 * i) = alive[static_cast<std::size_t>(i)].lo;
    Eigen::Map<Eigen::Vector3d>(high.mutable_data() + 3 * i) =
        alive[static_cast<std::size_t>(i)].hi;
  }
  return py::make_tuple(low, high);
}

std::vector<std::string> obstacle_names(const BoundEnvironment& e) {
  return names_of(e.environment.obstacles());
}

}  // namespace

SharedEnvironment make_environment(BoundScene& scene, double influence) {
  if (!(influence >= 0.0) || !(influence <= 10.0))
    refuse("environment", "influence", fmt::format("{} m, expected 0 to 10 m", influence));
  const SharedModel& model = scene.model();
  const py::gil_scoped_release unlocked;
  return std::make_shared<BoundEnvironment>(
      model, scene::make_environment(scene.scene, model->model, influence), influence);
}

void add_environment(py::module_& module) {
  using py::arg;
  PYBIND11_NUMPY_DTYPE(ContactRow, shape, obstacle, distance_m, arm_point_m, obstacle_point_m,
                       direction, obstacle_velocity_m_s);
  PYBIND11_NUMPY_DTYPE(SelfContactRow, pair, shape_a, shape_b, distance_m, point_a_m, point_b_m,
                       direction);
  py::class_<BoundEnvironment, SharedEnvironment>(
      module, "Environment",
      "Everything that the arm of a scene can hit, cropped to the space that it can reach.\n\n"
      "Scene.environment() makes one. Distances are signed [m]: zero or below is contact. Farther\n"
      "than `limit`, a query returns the limit. Outside of what the arm can reach, plus the\n"
      "influence, the map is not known. `view` is 'judge' (everything), 'planner' (what a planner\n"
      "is shown) or 'hidden' (what it is not shown).")
      .def("distance", &distance, arg("points"), py::kw_only(), arg("limit") = 1.0,
           arg("time") = 0.0, arg("view") = "judge",
           "Distances of points in the world, shape (3,) or (N, 3) [m]: a number, or shape (N,).")
      .def("shape_distance", &shape_distance, arg("start"), arg("end") = py::none(), py::kw_only(),
           arg("radius"), arg("limit") = 1.0, arg("time") = 0.0, arg("view") = "judge",
           "Distances of capsules about the segments from start to end, or of spheres if end is\n"
           "None. start, end: shape (3,) or (N, 3), in the world [m]; radius: a number or shape\n"
           "(N,) [m]. Returns a number, or shape (N,).")
      .def("clearance", &clearance, arg("q"), py::kw_only(), arg("limit") = 1.0, arg("time") = 0.0,
           arg("view") = "judge",
           "Smallest distance of the arm from all obstacles, for q of shape (n,) or (N, n):\n"
           "a number, or shape (N,) [m].")
      .def("self_clearance", &self_clearance, arg("q"), py::kw_only(), arg("limit") = 1.0,
           "Smallest distance between parts of the arm that may not touch, for q of shape (n,) or\n"
           "(N, n): a number, or shape (N,) [m].")
      .def("contacts", &contacts, arg("q"), py::kw_only(), arg("influence") = 0.1,
           arg("time") = 0.0, arg("view") = "planner",
           "Near obstacle points of all shapes of the arm at q, shape (n,): a structured array "
           "with\n"
           "shape (index in Model.shapes), obstacle (index; -1: the map, -2: unknown space),\n"
           "distance_m, arm_point_m, obstacle_point_m, direction, obstacle_velocity_m_s; in world\n"
           "axes, shape by shape, nearest first.")
      .def("self_contacts", &self_contacts, arg("q"), py::kw_only(), arg("limit") = 0.1,
           "Nearest shapes of pairs of parts of the arm no farther apart than `limit` [m], q of\n"
           "shape (n,): a structured array with pair, shape_a, shape_b, distance_m, point_a_m,\n"
           "point_b_m, direction.")
      .def("boxes", &boxes,
           "Lower and upper corners of the map's boxes in the map's frame, each of shape (M, 3) "
           "[m].")
      .def_property_readonly(
          "map_pose", [](const BoundEnvironment& e) { return to_array(e.environment.map_pose()); },
          "Pose of the map's frame in the world, shape (4, 4).")
      .def_property_readonly("obstacle_names", &obstacle_names, "Names of the obstacles.")
      .def_property_readonly(
          "influence_m", [](const BoundEnvironment& e) { return e.influence_m; },
          "The largest influence of contacts() [m].")
      .def_property_readonly(
          "model", [](const BoundEnvironment& e) { return e.model; }, "The arm.")
      .def("__repr__", [](const BoundEnvironment& e) {
        return fmt::format("<hamelin.Environment {} boxes, {} obstacles, for '{}'>",
                           e.environment.summary().boxes, e.environment.obstacles().size(),
                           e.model->model.robot().name);
      });
}

}  // namespace hamelin::python
