#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <array>
#include <limits>
#include <optional>
#include <string>

#include "bound_controller.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/scene/parts.hpp"

namespace hamelin::python {

namespace {

const std::filesystem::path& folder_of(const BoundWorld& w) {
  return w.owner->scene->folder;
}

using PointArray = py::array_t<float, py::array::c_style | py::array::forcecast>;

control::PointFrame frame_of(const PointArray& points, py::handle pose, double time_s,
                             const std::string& mount, const std::optional<std::string>& frame_name,
                             double range_m) {
  if (points.ndim() != 2 || points.shape(1) != 3)
    throw Error(ErrorCode::usage, "insert_points: points: expected an array of shape (N, 3)");
  control::PointFrame frame;
  frame.points = Eigen::Map<const Eigen::Matrix3Xf>(points.data(), 3, points.shape(0));
  frame.sensor = pose_of("insert_points", "pose", pose);
  frame.time_s = time_s;
  frame.range_m = range_m;
  if (frame_name) {
    if (mount != "world")
      throw Error(ErrorCode::usage, "insert_points: mount and frame given, expected one of them");
    frame.mount = scene::Mount::frame;
    frame.frame = *frame_name;
    return frame;
  }
  constexpr std::array mounts{scene::Mount::world, scene::Mount::base, scene::Mount::tip};
  const auto* const found = std::find_if(
      mounts.begin(), mounts.end(), [&](scene::Mount m) { return scene::to_string(m) == mount; });
  if (found == mounts.end())
    throw Error(
        ErrorCode::usage,
        fmt::format("insert_points: mount: '{}' given, expected 'world', 'base' or 'tip'", mount));
  frame.mount = *found;
  return frame;
}

py::dict insert_points(const BoundWorld& w, const PointArray& points, py::handle pose,
                       double time_s, const std::string& mount,
                       const std::optional<std::string>& frame_name, std::int32_t source,
                       double range_m) {
  control::PointFrame frame = frame_of(points, pose, time_s, mount, frame_name, range_m);
  frame.source = source;
  control::FrameReport report;
  {
    const py::gil_scoped_release unlocked;
    report = w.get().insert_points(frame);
  }
  py::dict out;
  out["snapshot"] = report.snapshot;
  out["points"] = report.points;
  out["on_arm"] = report.on_arm;
  out["on_obstacles"] = report.on_obstacles;
  out["movers"] = report.movers;
  out["occupied"] = report.occupied;
  out["cleared"] = report.cleared;
  return out;
}

using WorldClass = py::class_<BoundWorld, std::shared_ptr<BoundWorld>>;

void add_obstacle_updates(WorldClass& type) {
  using py::arg;
  type.def(
          "set_obstacle",
          [](const BoundWorld& w, py::handle obstacle) {
            const auto read =
                scene::obstacle_from_json(to_json(obstacle), folder_of(w), "obstacle");
            const py::gil_scoped_release unlocked;
            return w.get().set_obstacle(read);
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
          arg("name"), "Time of the last observation [s]; None without one.");
}

void add_map_updates(WorldClass& type) {
  using py::arg;
  type.def(
          "set_map",
          [](const BoundWorld& w, py::handle map, py::handle q) {
            const auto read = scene::map_from_json(to_json(map), folder_of(w), "map");
            const Eigen::VectorXd at =
                optional_vector("set_map", "q", q, w.owner->controller->model().dof());
            const py::gil_scoped_release unlocked;
            return w.get().set_map(read, at);
          },
          arg("map"), arg("q") = py::none(),
          "Replaces the map by that of a dict as in a scene; None removes it. q: configuration in\n"
          "which a self-filter finds the arm, shape (n,); None: the scene's start. Changes that "
          "it\n"
          "lists are not made: change_map() makes them.")
      .def(
          "change_map",
          [](const BoundWorld& w, py::handle change) {
            const auto read = scene::map_change_from_json(to_json(change), folder_of(w), "change");
            const py::gil_scoped_release unlocked;
            return w.get().change_map(read);
          },
          arg("change"),
          "Frees and occupies voxels of the map now: a dict as in /map/changes of a scene, whose\n"
          "time_s may be left out and is not used.")
      .def(
          "insert_points", &insert_points, arg("points"), arg("pose"), py::kw_only(), arg("time"),
          arg("mount") = "world", arg("frame") = py::none(), arg("source") = 0,
          arg("range") = std::numeric_limits<double>::infinity(),
          "Makes what a depth sensor saw part of the map, which must exist. points: shape (N, 3),\n"
          "in the sensor's frame, finite [m]. pose: of the sensor in the frame of its mount,\n"
          "\"world\", \"base\" or \"tip\", or in the robot's frame of that name, shape (4, 4). "
          "time: when they were seen [s]. source:\n"
          "the same for all frames of a sensor. range: of points that are farther only the way up\n"
          "to there is free [m]. Points on the arm, its load or a known obstacle are left out, "
          "rays\n"
          "to the others free what they pass, and bodies that move become obstacles.\n"
          "Returns the number of the snapshot that knows the frame, and counts of points and\n"
          "voxels.");
}

}  // namespace

void add_world(py::module_& module) {
  WorldClass type(module, "World",
                  "The surroundings of a controller. Any thread may update them; an update\n"
                  "takes effect at the next tick and returns the number of its snapshot.");
  add_obstacle_updates(type);
  add_map_updates(type);
  type.def_property_readonly(
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

}  // namespace hamelin::python
