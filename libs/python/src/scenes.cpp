#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/scene/modelled.hpp"
#include "hamelin/scene/self_collision.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace fs = std::filesystem;

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

// Everything that an arm can hit, with the arm. Queries release Python's lock and have scratch
// memory of their own.
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

// Points of an argument, one per row; a single one has shape (3,).
struct Points {
  Points(const char* function, const char* argument, py::handle given)
      : numbers(function, argument, given), single(numbers.dimensions() == 1) {
    if (single)
      numbers.require_vector(3);
    else
      numbers.require_rows(3);
    for (py::ssize_t i = 0; i < numbers.size(); ++i)
      if (!std::isfinite(numbers.data()[i])) refuse(function, argument, "is not finite");
  }
  [[nodiscard]] py::ssize_t count() const { return single ? 1 : numbers.extent(0); }
  [[nodiscard]] Eigen::Vector3d operator[](py::ssize_t i) const {
    return Eigen::Map<const Eigen::Vector3d>(numbers.data() + 3 * i);
  }

  Numbers numbers;
  bool single;
};

// Configurations of an argument, one per row. They must be finite, as distances have no meaning
// otherwise.
struct Configurations {
  Configurations(const char* function, py::handle given, py::ssize_t dof)
      : numbers(function, "q", given), single(numbers.dimensions() == 1), dof_(dof) {
    if (single)
      numbers.require_vector(dof);
    else
      numbers.require_rows(dof);
    for (py::ssize_t i = 0; i < numbers.size(); ++i)
      if (!std::isfinite(numbers.data()[i])) refuse(function, "q", "is not finite");
  }
  [[nodiscard]] py::ssize_t count() const { return single ? 1 : numbers.extent(0); }
  [[nodiscard]] Eigen::Map<const Eigen::VectorXd> operator[](py::ssize_t i) const {
    return {numbers.data() + i * dof_, dof_};
  }

  Numbers numbers;
  bool single;

 private:
  py::ssize_t dof_;
};

py::object distance(const BoundEnvironment& e, py::handle points, double limit, double time_s,
                    const std::string& view) {
  const Points at("distance", "points", points);
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
  return number_or_array(at.single, out);
}

py::object shape_distance(const BoundEnvironment& e, py::handle from, py::handle to,
                          py::handle radius, double limit, double time_s, const std::string& view) {
  const Points a("shape_distance", "start", from);
  const Points b("shape_distance", "end", to.is_none() ? from : to);
  const py::ssize_t count = a.count();
  if (b.count() != count || b.single != a.single)
    refuse("shape_distance", "end",
           fmt::format("shape {}, expected {}", describe_shape(b.numbers.array()),
                       describe_shape(a.numbers.array())));
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
  return number_or_array(a.single, out);
}

// Calls f(shapes, i) with the arm's shapes at each configuration.
template <class F>
void for_each_placed(const BoundEnvironment& e, const Configurations& q, const F& f) {
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
  const Configurations at("clearance", q, e.model->model.dof());
  limit_of("clearance", "limit", limit);
  const scene::Moment moment(time_of("clearance", time_s));
  const scene::View seen = view_of("clearance", view);
  auto out = new_array({at.count()});
  double* const y = out.mutable_data();
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t i) {
    y[i] = e.environment.clearance(arm, moment, limit, seen);
  });
  return number_or_array(at.single, out);
}

py::object self_clearance(const BoundEnvironment& e, py::handle q, double limit) {
  const Configurations at("self_clearance", q, e.model->model.dof());
  limit_of("self_clearance", "limit", limit);
  auto out = new_array({at.count()});
  double* const y = out.mutable_data();
  for_each_placed(e, at, [&](const scene::Shapes& arm, py::ssize_t i) {
    std::array<scene::SelfContact, 1> nearest;
    y[i] = e.self.closest(arm, limit, nearest) > 0 ? nearest[0].distance : limit;
  });
  return number_or_array(at.single, out);
}

void copy3(const Eigen::Vector3d& from, double (&to)[3]) {
  std::copy_n(from.data(), 3, &to[0]);
}

py::array_t<ContactRow> contacts(const BoundEnvironment& e, py::handle q, double influence,
                                 double time_s, const std::string& view) {
  const Configurations at("contacts", q, e.model->model.dof());
  if (!at.single) refuse("contacts", "q", "is an array of states, expected one state");
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
  const Configurations at("self_contacts", q, e.model->model.dof());
  if (!at.single) refuse("self_contacts", "q", "is an array of states, expected one state");
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
  std::vector<std::string> names;
  for (const auto& obstacle : e.environment.obstacles()) names.push_back(obstacle.name);
  return names;
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

SharedEnvironment make_environment(BoundScene& scene, double influence) {
  if (!(influence >= 0.0) || !(influence <= 10.0))
    refuse("environment", "influence", fmt::format("{} m, expected 0 to 10 m", influence));
  const SharedModel& model = scene.model();
  const py::gil_scoped_release unlocked;
  return std::make_shared<BoundEnvironment>(
      model, scene::make_environment(scene.scene, model->model, influence), influence);
}

scene::Overrides overrides_of(const py::dict& given) {
  scene::Overrides o;
  for (const auto& [key_object, value] : given) {
    const auto key = key_object.cast<std::string>();
    if (value.is_none()) continue;
    if (key == "planner")
      o.planner = value.cast<std::string>();
    else if (key == "guide")
      o.guide = value.cast<std::string>();
    else if (key == "integrator")
      o.integrator = value.cast<std::string>();
    else if (key == "plant")
      o.plant = value.cast<std::string>();
    else if (key == "step")
      o.step_s = value.cast<double>();
    else if (key == "duration")
      o.duration_s = value.cast<double>();
    else if (key == "seed")
      o.seed = value.cast<std::uint64_t>();
    else if (key == "set")
      o.set = value.cast<std::vector<std::string>>();
    else
      throw py::type_error(fmt::format("Scene: unexpected keyword argument '{}'", key));
  }
  return o;
}

std::string repr_of_scene(const BoundScene& s) {
  return fmt::format("<hamelin.Scene '{}': robot '{}', {} goals, {}, {} obstacles, planner {}>",
                     s.name, s.scene.robot.file.filename().string(), s.scene.goals.size(),
                     s.scene.map && !s.scene.map->file.empty()
                         ? s.scene.map->file.filename().string()
                         : "no map file",
                     s.scene.obstacles.size(), s.scene.planner ? s.scene.planner->name : "none");
}

void add_scene(py::module_& module) {
  using py::arg;
  py::class_<BoundScene, SharedScene>(
      module, "Scene",
      "A scene: robot, map, obstacles, goals, planner, integrator.\n\n"
      "load_scene() reads one from a file. Immutable; pickles.")
      .def(py::init([](py::handle document, py::handle folder, const std::string& name) {
             return std::make_shared<BoundScene>(to_json(document), path_of(folder), name);
           }),
           arg("document"), py::kw_only(), arg("folder") = ".", arg("name") = "scene",
           "Makes a scene from a document of schema hamelin.scene/1.\n\n"
           "folder: that relative paths of the document start from. name: for messages.")
      .def_property_readonly(
          "name", [](const BoundScene& s) { return s.name; }, "The file that it came from.")
      .def_property_readonly(
          "document", [](const BoundScene& s) { return to_python(s.document); },
          "The document as it was given, as a dict; a copy.")
      .def(
          "resolved", [](const BoundScene& s) { return to_python(scene::resolved_json(s.scene)); },
          "The document with all defaults of the scene, as a dict.")
      .def_property_readonly(
          "model", [](BoundScene& s) { return s.model(); },
          "Model of the robot, with the payload of the scene.")
      .def_property_readonly(
          "step_s", [](const BoundScene& s) { return s.scene.step_s; }, "Time step [s].")
      .def_property_readonly(
          "duration_s", [](const BoundScene& s) { return s.scene.duration_s; },
          "Longest simulated time [s].")
      .def_property_readonly(
          "start_q",
          [](BoundScene& s) {
            const auto dof = s.model()->model.dof();
            return to_array(s.scene.start_q.size() > 0
                                ? s.scene.start_q
                                : Eigen::VectorXd(Eigen::VectorXd::Zero(dof)));
          },
          "Joint positions at the start, shape (n,) [rad or m].")
      .def_property_readonly(
          "modelled",
          [](BoundScene& s) {
            const Json info = scene::modelled_info(s.scene, s.model()->model);
            return fmt::format("{}", fmt::join(scene::describe_modelled(info), "\n"));
          },
          "What is modelled, in two lines: gravity, limits and self-collision; then payload, "
          "damping and dry friction.")
      .def("environment", &make_environment, py::kw_only(), arg("influence") = 0.2,
           "Everything that the arm can hit.\n\n"
           "influence: largest distance at which contacts will be asked for [m].")
      .def(
          "_with",
          [](const BoundScene& s, const py::dict& given) {
            Json document = s.document;
            scene::apply(checked_overrides(given), "planner", document);
            return std::make_shared<BoundScene>(document, s.folder, s.name);
          },
          arg("overrides"), "A copy with other values.")
      .def("__repr__", &repr_of_scene)
      .def(py::pickle(
          [](const BoundScene& s) {
            return py::make_tuple(s.document.dump(), fs::absolute(s.folder).string(), s.name);
          },
          [](const py::tuple& state) {
            if (state.size() != 3) throw py::value_error("Scene: a pickle's state has three parts");
            return std::make_shared<BoundScene>(
                parse_json(state[0].cast<std::string>(), "Scene: pickle"),
                state[1].cast<std::string>(), state[2].cast<std::string>());
          }));
  module.def(
      "_load_scene",
      [](py::handle file, const py::dict& given) {
        return read_scene(path_of(file), checked_overrides(given));
      },
      arg("file"), arg("overrides"), "Reads a scene file, with some values replaced.");
}

}  // namespace

BoundScene::BoundScene(Json given, fs::path base_dir, std::string where)
    : document(std::move(given)),
      folder(std::move(base_dir)),
      name(std::move(where)),
      scene(scene::scene_from_json(document, folder, name)) {}

const SharedModel& BoundScene::model() {
  if (!model_) model_ = std::make_shared<BoundModel>(control::load_model(scene));
  return model_;
}

// py::cast_error is a RuntimeError; a wrong argument is a TypeError.
scene::Overrides checked_overrides(const py::dict& given) {
  try {
    return overrides_of(given);
  } catch (const py::cast_error&) {
    throw py::type_error(
        "Scene: expected planner, guide, integrator, plant: str; step, duration: float; seed: "
        "a non-negative int; set: a list of str");
  }
}

SharedScene read_scene(const fs::path& file, const scene::Overrides& overrides) {
  Json document = read_json(file);
  scene::apply(overrides, "planner", document);
  return std::make_shared<BoundScene>(std::move(document), file.parent_path(), file.string());
}

SharedScene scene_of(py::handle given, const scene::Overrides& overrides) {
  if (py::isinstance<BoundScene>(given)) {
    const auto scene = given.cast<SharedScene>();
    Json document = scene->document;
    scene::apply(overrides, "planner", document);
    return std::make_shared<BoundScene>(std::move(document), scene->folder, scene->name);
  }
  if (PyDict_Check(given.ptr()) != 0) {
    Json document = to_json(given);
    scene::apply(overrides, "planner", document);
    return std::make_shared<BoundScene>(std::move(document), ".", "scene");
  }
  return read_scene(path_of(given), overrides);
}

void add_scenes(py::module_& module) {
  add_environment(module);
  add_scene(module);
}

}  // namespace hamelin::python
