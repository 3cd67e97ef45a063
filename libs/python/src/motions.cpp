#include <fmt/format.h>
#include <pybind11/eigen.h>
#include <pybind11/stl.h>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/control/plan_paths.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/optimal/scene_motion.hpp"
#include "hamelin/simulation/explain.hpp"
#include "hamelin/task/task.hpp"
#include "interrupts.hpp"
#include "module.hpp"

namespace hamelin::python {

namespace {

py::object plan(const BoundScene& scene, bool motions) {
  control::PathPlan found;
  InterruptCheck interrupts;
  {
    const py::gil_scoped_release unlocked;
    found = control::plan_paths(
        scene.scene, {.motions = motions, .poll = [&interrupts] { interrupts.raise(); }});
  }
  return to_python(control::to_json(found));
}

py::dict postures(const BoundScene& scene, std::size_t goal, std::size_t count, double apart,
                  long attempts) {
  search::Postures found;
  {
    const py::gil_scoped_release unlocked;
    found = control::find_postures(scene.scene, goal, {count, apart, attempts});
  }
  const auto n = static_cast<Eigen::Index>(found.found.size());
  Eigen::MatrixXd q(n, n > 0 ? found.found.front().q.size() : 0);
  Eigen::VectorXd clearance(n);
  std::vector<std::size_t> options;
  for (Eigen::Index i = 0; i < n; ++i) {
    const search::Posture& each = found.found[static_cast<std::size_t>(i)];
    q.row(i) = each.q.transpose();
    clearance[i] = each.clearance_m;
    options.push_back(each.goal);
  }
  const search::GoalFigures& figures = found.figures;
  return py::dict(py::arg("q") = q, py::arg("clearance_m") = clearance, py::arg("option") = options,
                  py::arg("tried") = figures.tried, py::arg("reached") = figures.reached,
                  py::arg("clear") = figures.clear, py::arg("repeated") = found.repeated);
}

SharedScene task_scene(py::handle given, const py::dict& overrides) {
  const bool is_file = PyDict_Check(given.ptr()) == 0;
  const std::filesystem::path file = is_file ? path_of(given) : std::filesystem::path("task");
  Json document = is_file ? read_json(file) : to_json(given);
  if (document.is_object() && document.contains("scene"))
    scene::apply(checked_overrides(overrides), "planner", document["scene"]);
  const auto folder = is_file ? file.parent_path() : std::filesystem::path(".");
  task::TaskPlan plan;
  InterruptCheck interrupts;
  {
    const py::gil_scoped_release unlocked;
    const task::Task task = task::task_from_json(document, folder, file.string());
    plan = task::plan_task(task, [&interrupts] { interrupts.raise(); });
  }
  if (!plan.found())
    throw Error(ErrorCode::invalid, fmt::format("{}: {}", file.string(), plan.cause));
  return std::make_shared<BoundScene>(scene::resolved_json(plan.scene), ".", file.string());
}

// The value of an option, within what `hamelin optimize` accepts.
template <class T>
T within(const char* argument, T value, T least, T most) {
  if (!(value >= least && value <= most))
    refuse("optimize", argument, fmt::format("{}, expected {} to {}", value, least, most));
  return value;
}

std::optional<double> positive(const char* argument, const std::optional<double>& value) {
  return value ? std::optional(within(argument, *value, 1e-9, 1e12)) : value;
}

template <class T>
T one_of(const char* argument, const std::string& given, const char* first, T a, const char* second,
         T b) {
  if (given == first) return a;
  if (given == second) return b;
  refuse("optimize", argument, fmt::format("'{}', expected {} or {}", given, first, second));
}

optimal::SceneMotionOptions options_of(const py::dict& given) {
  const auto number = [&](const char* key) {
    return positive(key, given[key].cast<std::optional<double>>());
  };
  optimal::SceneMotionOptions options;
  options.objective = one_of("minimize", given["minimize"].cast<std::string>(), "effort",
                             optimal::Objective::effort, "time", optimal::Objective::time);
  options.intervals = within("intervals", given["intervals"].cast<int>(), optimal::least_intervals,
                             optimal::most_intervals);
  options.margin_m = within("margin", given["margin"].cast<double>(), 0.0, 0.1);
  if (const auto share = given["limit_share"].cast<std::optional<double>>())
    options.limit_share = within("limit_share", *share, 0.01, 1.0);
  options.duration_s = number("duration");
  options.acceleration = number("acceleration");
  options.jerk = number("jerk");
  return options;
}

py::tuple optimize(const BoundScene& scene, const py::dict& given) {
  optimal::SceneMotionOptions options = options_of(given);
  const auto rate = positive("rate", given["rate"].cast<std::optional<double>>());
  InterruptCheck interrupts;
  options.solve.stop = [&interrupts] { return interrupts.check(); };
  Json document;
  bool valid = false;
  {
    const py::gil_scoped_release unlocked;
    const optimal::SceneMotion motion = optimal::optimize_scene(scene.scene, options);
    valid = motion.valid();
    document = optimal::to_json(motion, options, rate);
  }
  interrupts.rethrow();
  return py::make_tuple(to_python(document), valid);
}

py::tuple explain(py::handle log, int motions, std::uint64_t seed, const py::object& progress) {
  if (motions < 1 || motions > 1'000'000)
    refuse("explain", "motions", fmt::format("{}, expected 1 to 1000000", motions));
  InterruptCheck interrupts;
  simulation::ExplainOptions options;
  options.motions = motions;
  options.seed = seed;
  options.progress = [&](double done, double all) {
    interrupts.raise();
    if (progress.is_none()) return;
    const py::gil_scoped_acquire locked;
    progress(done, all);
  };
  const auto file = path_of(log);
  Json document;
  std::string nothing;
  {
    const py::gil_scoped_release unlocked;
    const simulation::Explanation explanation = simulation::explain(file, options);
    nothing = explanation.nothing;
    document = simulation::to_json(explanation);
  }
  return py::make_tuple(to_python(document), nothing);
}

}  // namespace

void add_motions(py::module_& module) {
  using py::arg;
  module.def("_plan", &plan, arg("scene"), arg("motions"), "The document of `hamelin plan`.");
  module.def("_postures", &postures, arg("scene"), arg("goal"), arg("count"), arg("apart"),
             arg("attempts"), "Clear configurations at a goal, and how many were tried.");
  module.def("_task", &task_scene, arg("task"), arg("overrides"),
             "The scene of `hamelin task`; raises Error if a step cannot be done.");
  module.def("_optimize", &optimize, arg("scene"), arg("options"),
             "The document of `hamelin optimize`, and whether the motion is valid.");
  module.def("_explain", &explain, arg("log"), arg("motions"), arg("seed"), arg("progress"),
             "The document of `hamelin explain`, and why there is nothing to explain.");
}

}  // namespace hamelin::python
