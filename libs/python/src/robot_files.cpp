#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/fit/robot_fit.hpp"
#include "hamelin/fit/self_check.hpp"
#include "hamelin/fit/self_pairs.hpp"
#include "hamelin/scene/robot_info.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace {

description::RobotOptions robot_options(const std::optional<std::string>& tip, py::handle spheres,
                                        py::handle srdf, bool strict) {
  description::RobotOptions options;
  options.tip = tip;
  if (!spheres.is_none() && PyDict_Check(spheres.ptr()) != 0)
    options.sidecar = to_json(spheres);
  else
    options.spheres = optional_path(spheres);
  options.srdf = optional_path(srdf);
  options.strict = strict;
  return options;
}

SharedModel load_robot(py::handle file, const std::optional<std::string>& tip, py::handle spheres,
                       py::handle srdf, bool strict, py::handle base, py::handle gravity) {
  const Eigen::Vector3d g = gravity.is_none() ? Eigen::Vector3d(0.0, 0.0, -9.81)
                                              : vector3_of("load_robot", "gravity", gravity);
  const geometry::SE3 pose = pose_of("load_robot", "base", base);
  return std::make_shared<BoundModel>(model::Model(
      description::read_robot(path_of(file), robot_options(tip, spheres, srdf, strict)), pose, g));
}

fit::SelfCheckOptions check_options(const char* function, int samples, std::uint64_t seed) {
  if (samples < 0 || samples > 100'000'000)
    refuse(function, "samples", fmt::format("{}, expected 0 to 100000000", samples));
  return {samples, seed};
}

py::object check_robot(py::handle file, const std::optional<std::string>& tip, py::handle spheres,
                       py::handle srdf, int samples, std::uint64_t seed, bool strict) {
  const auto options = check_options("check_robot", samples, seed);
  const auto path = path_of(file);
  const auto reader = robot_options(tip, spheres, srdf, strict);
  Json out;
  {
    const py::gil_scoped_release unlocked;
    const model::Robot robot = description::read_robot(path, reader);
    std::vector<description::DisabledPair> listed;
    if (reader.srdf) listed = description::read_srdf(*reader.srdf);
    out = fit::to_json(fit::check_self(robot, listed, options), robot);
  }
  return to_python(out);
}

void check_length(const char* argument, double value, bool zero_allowed) {
  if (!(value > 0.0 || (zero_allowed && value == 0.0)) || value > 10.0)
    refuse("fit_robot", argument,
           fmt::format("{} m, expected a length {} 0 and at most 10 m", value,
                       zero_allowed ? "of at least" : "above"));
}

struct FitArguments {
  double excess_m, padding_m, tolerance_m;
  std::optional<int> total;
  int spheres_per_link;
  bool capsules, visual;
};

fit::FitOptions fit_options(const FitArguments& given, const py::dict& packages,
                            py::handle meshes) {
  check_length("excess", given.excess_m, false);
  check_length("padding", given.padding_m, true);
  check_length("tolerance", given.tolerance_m, false);
  if (given.total && (*given.total < 1 || *given.total > 100'000))
    refuse("fit_robot", "total", fmt::format("{}, expected 1 to 100000", *given.total));
  if (given.spheres_per_link < 1 || given.spheres_per_link > 1000)
    refuse("fit_robot", "spheres_per_link",
           fmt::format("{}, expected 1 to 1000", given.spheres_per_link));
  fit::FitOptions options;
  options.cover = {given.excess_m, given.spheres_per_link, given.capsules};
  options.total = given.total;
  options.padding_m = given.padding_m;
  options.visual = given.visual;
  options.tolerance_m = given.tolerance_m;
  for (const auto& [name, folder] : packages)
    options.meshes.packages.emplace_back(name.cast<std::string>(), path_of(folder));
  options.meshes.folders = paths_of(meshes);
  return options;
}

py::tuple fit_robot(py::handle file, double excess, const std::optional<int>& total,
                    int spheres_per_link, bool capsules, double padding, const py::dict& packages,
                    py::handle meshes, bool visual, py::handle srdf,
                    const std::optional<std::string>& tip, double tolerance) {
  const auto urdf = path_of(file);
  const auto options = fit_options(
      {excess, padding, tolerance, total, spheres_per_link, capsules, visual}, packages, meshes);
  const auto srdf_file = optional_path(srdf);
  Json sidecar, figures;
  {
    const py::gil_scoped_release unlocked;
    const fit::RobotFit fitted = fit::fit_robot(urdf, options);
    sidecar = fit::sidecar_json(fitted, fit::sidecar_note(fitted, urdf, capsules),
                                fit::sidecar_pairs(urdf, fitted, srdf_file, tip, {}).names());
    figures = fit::figures_json(fitted);
  }
  return py::make_tuple(to_python(sidecar), to_python(figures));
}

}  // namespace

void add_robot_files(py::module_& module) {
  using py::arg;
  module.def(
      "load_robot", &load_robot, arg("file"), py::kw_only(), arg("tip") = py::none(),
      arg("spheres") = py::none(), arg("srdf") = py::none(), arg("strict") = false,
      arg("base") = py::none(), arg("gravity") = py::none(),
      "Reads a robot from a .urdf or a .json file.\n\n"
      "tip: tip link; None: the only leaf of a URDF. spheres: file with collision spheres\n"
      "or capsules, or its content as a dict. srdf: file with pairs of links that may touch.\n"
      "strict: refuse inertias that break the triangle inequality. base: pose of the base in\n"
      "the world, shape (4, 4). gravity: shape (3,) [m/s^2]; None: (0, 0, -9.81).");
  module.def(
      "_robot_info", [](const BoundModel& m) { return to_python(scene::robot_info(m.model)); },
      arg("model"), "The document of `hamelin robot info --json`, without the name of the file.");
  module.def(
      "check_robot", &check_robot, arg("file"), py::kw_only(), arg("tip") = py::none(),
      arg("spheres") = py::none(), arg("srdf") = py::none(), arg("samples") = 10000,
      arg("seed") = 1, arg("strict") = false,
      "Checks a robot for self-collision and unusual limits, as `hamelin robot check`.\n\n"
      "samples: number of random configurations within the limits. Returns the document of\n"
      "`hamelin robot check --json`; its list 'overlaps_at_rest' is empty for a good robot.");
  module.def("_fit_robot", &fit_robot, arg("file"), arg("excess"), arg("total"),
             arg("spheres_per_link"), arg("capsules"), arg("padding"), arg("packages"),
             arg("meshes"), arg("visual"), arg("srdf"), arg("tip"), arg("tolerance"),
             "Sidecar and figures of `hamelin robot fit`.");
}

}  // namespace hamelin::python
