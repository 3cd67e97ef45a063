#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "arguments.hpp"
#include "bound_model.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/description/srdf.hpp"
#include "hamelin/description/urdf_geometry.hpp"
#include "hamelin/fit/robot_fit.hpp"
#include "hamelin/fit/self_check.hpp"
#include "hamelin/fit/self_pairs.hpp"
#include "hamelin/scene/self_collision.hpp"
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

Json optional_number(const std::optional<double>& value) {
  return value ? Json(*value) : Json(nullptr);
}

std::size_t capsules_of(const model::Link& link) {
  return static_cast<std::size_t>(
      std::count_if(link.segments.begin(), link.segments.end(),
                    [](const model::Segment& segment) { return segment.is_capsule(); }));
}

// The document of `hamelin robot info --json`, without the name of the file.
Json describe_model(const model::Model& model) {
  const auto& robot = model.robot();
  Json links = Json::array();
  double mass = 0.0;
  std::size_t spheres = 0, capsules = 0;
  for (const auto& link : robot.links) {
    mass += link.mass_kg;
    spheres += link.spheres.size();
    capsules += capsules_of(link);
    const auto& joint = link.joint;
    links.push_back({{"name", link.name},
                     {"joint", joint.name},
                     {"type", joint.type == model::JointType::revolute ? "revolute" : "prismatic"},
                     {"lower", optional_number(joint.lower)},
                     {"upper", optional_number(joint.upper)},
                     {"velocity_max", optional_number(joint.velocity_max)},
                     {"effort_max", optional_number(joint.effort_max)},
                     {"damping", joint.damping},
                     {"mass_kg", link.mass_kg},
                     {"spheres", link.spheres.size()},
                     {"capsules", capsules_of(link)},
                     {"lines", link.segments.size() - capsules_of(link)}});
  }
  const scene::SelfField self(model);
  Json notes = robot.notes;
  if (!self.note().empty()) notes.push_back(self.note());
  return {{"name", robot.name},
          {"dof", robot.dof()},
          {"planar", model.planar()},
          {"tip", robot.tip.name},
          {"tip_link", robot.links[static_cast<std::size_t>(robot.tip.link)].name},
          {"mass_kg", mass},
          {"reach_m", model.reach()},
          {"spheres", spheres},
          {"capsules", capsules},
          {"base_spheres", robot.base_spheres.size()},
          {"base_capsules", robot.base_segments.size()},
          {"self_collision_disabled", robot.self_collision_disabled.size()},
          {"self_collision_parts", self.parts().size()},
          {"self_collision_pairs", self.pairs().size()},
          {"links", links},
          {"notes", notes},
          {"warnings", model::warnings(robot)}};
}

Json describe_check(const fit::SelfCheck& check, const model::Robot& robot) {
  Json pairs = Json::array(), faults = Json::array();
  for (const auto& pair : check.pairs)
    pairs.push_back({{"parts", {pair.part_a, pair.part_b}},
                     {"checked", pair.checked},
                     {"reason", pair.checked ? Json(nullptr) : Json(pair.reason)},
                     {"neighbours", pair.neighbours},
                     {"rest_m", pair.rest_m},
                     {"least_m", pair.least_m},
                     {"contacts", pair.contacts}});
  for (const auto& pair : check.contacts_at_rest())
    faults.push_back({{"parts", {pair.part_a, pair.part_b}}, {"rest_m", pair.rest_m}});
  return {{"name", robot.name},
          {"rest_q", check.rest_q},
          {"samples", check.samples},
          {"overlaps_at_rest", faults},
          {"pairs", pairs},
          {"links_without_shapes", check.links_without_shapes},
          {"odd_limits", check.suspicious_limits},
          {"notes", robot.notes},
          {"warnings", model::warnings(robot)}};
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
    out = describe_check(fit::check_self(robot, listed, options), robot);
  }
  return to_python(out);
}

void check_length(const char* argument, double value, bool zero_allowed) {
  if (!(value > 0.0 || (zero_allowed && value == 0.0)) || value > 10.0)
    refuse("fit_robot", argument,
           fmt::format("{} m, expected a length {} 0 and at most 10 m", value,
                       zero_allowed ? "of at least" : "above"));
}

// The pairs of the SRDF, then those that the shapes require, each once.
std::vector<std::pair<std::string, std::string>> disabled_pairs(
    const std::filesystem::path& urdf, const fit::RobotFit& fitted,
    const std::optional<std::filesystem::path>& srdf, const std::optional<std::string>& tip,
    const fit::SelfCheckOptions& options) {
  std::vector<std::pair<std::string, std::string>> out;
  if (srdf) {
    std::vector<std::string> links;
    for (const auto& link : description::read_urdf_geometry(urdf)) links.push_back(link.name);
    for (const auto& pair : description::read_srdf(*srdf, links))
      out.emplace_back(pair.link_a, pair.link_b);
  }
  for (const auto& pair :
       fit::pairs_to_disable(urdf, fit::sidecar_json(fitted, "", {}), tip, options).pairs) {
    const bool listed = std::any_of(out.begin(), out.end(), [&](const auto& old) {
      return std::minmax(old.first, old.second) == std::minmax(pair.link_a, pair.link_b);
    });
    if (!listed) out.emplace_back(pair.link_a, pair.link_b);
  }
  return out;
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
    const std::string note = fmt::format(
        "{} that cover the collision geometry of {} [m, link frames]: coverage gap {:.3g} mm, "
        "excess up to {:.1f} mm",
        capsules ? "Capsules" : "Spheres", urdf.filename().string(), 1e3 * fitted.gap_bound_m(),
        1e3 * fitted.excess_max_m());
    sidecar = fit::sidecar_json(fitted, note, disabled_pairs(urdf, fitted, srdf_file, tip, {}));
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
      "_robot_info", [](const BoundModel& m) { return to_python(describe_model(m.model)); },
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
