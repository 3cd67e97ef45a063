#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pybind11/stl.h>

#include <memory>
#include <string>
#include <utility>
#include <vector>

#include "arguments.hpp"
#include "bound_environment.hpp"
#include "bound_scene.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/scene/modelled.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace fs = std::filesystem;

namespace {

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

using SceneClass = py::class_<BoundScene, SharedScene>;

void add_scene_properties(SceneClass& type) {
  type.def_property_readonly(
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
          "damping and dry friction.");
}

void add_scene(py::module_& module) {
  using py::arg;
  SceneClass type(module, "Scene",
                  "A scene: robot, map, obstacles, goals, planner, integrator.\n\n"
                  "load_scene() reads one from a file. Immutable; pickles.");
  type.def(py::init([](py::handle document, py::handle folder, const std::string& name) {
             return std::make_shared<BoundScene>(to_json(document), path_of(folder), name);
           }),
           arg("document"), py::kw_only(), arg("folder") = ".", arg("name") = "scene",
           "Makes a scene from a document of schema hamelin.scene/1.\n\n"
           "folder: that relative paths of the document start from. name: for messages.");
  add_scene_properties(type);
  type.def("environment", &make_environment, py::kw_only(), arg("influence") = 0.2,
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
