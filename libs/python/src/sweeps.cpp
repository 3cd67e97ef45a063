#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>
#include <limits>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "counter.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/sweep/compare.hpp"
#include "hamelin/sweep/csv.hpp"
#include "hamelin/sweep/judged_run.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "hamelin/sweep/merge.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "module.hpp"
#ifdef HAMELIN_WITH_MUJOCO
#include "hamelin/mujoco/plant.hpp"
#endif

namespace hamelin::python {

namespace {

template <class T>
T value_of(const py::dict& given, const char* key) {
  try {
    return given[key].cast<T>();
  } catch (const py::cast_error&) {
    throw py::type_error(fmt::format("plan_sweep(): {} has a wrong type", key));
  }
}

// A vector of an argument that has so many numbers.
Eigen::VectorXd numbers_of(const py::dict& given, const char* key, py::ssize_t size) {
  return vector_of("plan_sweep", key, given[key], size);
}

std::size_t count_of(const py::dict& given, const char* key, std::size_t least, std::size_t most) {
  const auto count = value_of<std::size_t>(given, key);
  if (count < least || count > most)
    refuse("plan_sweep", key, fmt::format("{}, expected {} to {}", count, least, most));
  return count;
}

sweep::SphereOnPath sphere_of(const py::dict& given, double radius_m, std::uint64_t seed) {
  sweep::SphereOnPath sphere;
  sphere.radius_m = radius_m;
  sphere.seed = seed;
  sphere.visible_within_m = value_of<std::optional<double>>(given, "visible_within");
  if (!given["swing"].is_none()) {
    const Eigen::VectorXd swing = numbers_of(given, "swing", 2);
    if (!(swing.array() > 0.0).all()) refuse("plan_sweep", "swing", "expected two numbers above 0");
    sphere.swing_m = swing[0];
    sphere.swing_period_s = swing[1];
  }
  sphere.prediction =
      sweep::prediction_from(value_of<std::string>(given, "prediction"), "plan_sweep: prediction");
  return sphere;
}

void read_clutter(const py::dict& given, std::uint64_t seed, sweep::ClutterScenes& clutter) {
  clutter.maps = count_of(given, "clutter", 0, 100'000);
  clutter.pairs = count_of(given, "pairs", 1, 100'000);
  clutter.clutter.count = count_of(given, "primitives", 1, 10'000);
  clutter.clutter.seed = clutter.draw.seed = seed;
  const Eigen::VectorXd sizes = numbers_of(given, "sizes", 2), b = numbers_of(given, "bounds", 6);
  clutter.clutter.size_min_m = sizes[0];
  clutter.clutter.size_max_m = sizes[1];
  clutter.clutter.bounds = {{b[0], b[1], b[2]}, {b[3], b[4], b[5]}};
  for (const auto& ball : given["keep_out"]) {
    const Eigen::VectorXd k = vector_of("plan_sweep", "keep_out", ball, 4);
    clutter.clutter.keep_out.push_back({{k[0], k[1], k[2]}, k[3]});
  }
}

void read_problem(const py::dict& given, scene::ProblemOptions& problem) {
  if (const auto robot = optional_path(given["robot"])) problem.robot = *robot;
  if (const auto spheres = optional_path(given["spheres"])) problem.spheres = *spheres;
  problem.tip = value_of<std::optional<std::string>>(given, "tip").value_or("");
  problem.resolution_m = value_of<double>(given, "resolution");
  problem.mark = scene::mark_from(value_of<std::string>(given, "mark"));
}

sweep::PlanOptions plan_options_of(const py::dict& given) {
  sweep::PlanOptions options;
  const auto seed = value_of<std::uint64_t>(given, "draw_seed");
  options.files = paths_of(given["scenes"]);
  options.base = optional_path(given["base"]);
  read_clutter(given, seed, options.clutter);
  read_problem(given, options.problem);
  options.gains.sets = count_of(given, "gain_sets", 0, 1'000'000);
  options.gains.seed = seed;
  for (const auto& goal : value_of<std::vector<std::string>>(given, "goal"))
    options.goals.push_back(sweep::goal_type_from(goal, "plan_sweep: goal"));
  if (const auto radius = value_of<std::optional<double>>(given, "sphere_on_path"))
    options.sphere_on_path = sphere_of(given, *radius, seed);
  options.planners = value_of<std::vector<std::string>>(given, "planner");
  options.set = value_of<std::vector<std::string>>(given, "set");
  options.vary = value_of<std::vector<std::string>>(given, "vary");
  options.seeds = value_of<std::vector<std::uint64_t>>(given, "seeds");
  options.duration_s = value_of<std::optional<double>>(given, "duration");
  options.plugin_directories = plugin_path(paths_of(given["plugin_path"]));
  return options;
}

py::dict plan_sweep(py::handle directory, const py::dict& given, const py::object& progress) {
  sweep::PlanOptions options = plan_options_of(given);
  std::vector<std::string> notes;
  options.on_note = [&notes](const std::string& text) { notes.push_back(text); };
  Counter counter(progress);
  options.on_scene = [&counter](std::size_t done, std::size_t all) {
    counter.show(done, all);
    if (counter.interrupts.stop) counter.interrupts.raise();
  };
  const auto folder = path_of(directory);
  sweep::Plan plan;
  {
    const py::gil_scoped_release unlocked;
    plan = sweep::make_plan(folder, options);
  }
  py::dict out;
  out["directory"] = folder.string();
  out["scenes"] = plan.scenes.size();
  out["feasible"] = std::count_if(plan.scenes.begin(), plan.scenes.end(),
                                  [](const auto& scene) { return scene.feasible; });
  out["runs"] = plan.runs.size();
  out["sha256"] = plan.sha256;
  out["notes"] = notes;
  return out;
}

py::dict run_sweep(py::handle directory, const std::vector<std::string>& command, std::size_t jobs,
                   const std::string& only, const std::optional<std::string>& shard,
                   const std::optional<std::size_t>& limit, bool fresh,
                   const std::optional<double>& timeout, py::handle plugins,
                   const py::object& progress) {
  if (jobs > 1024) refuse("sweep", "jobs", fmt::format("{}, expected 1 to 1024", jobs));
  sweep::RunOptions options;
  options.command = command;
  options.jobs = jobs;
  options.only = only;
  if (shard) options.shard = sweep::parse_shard(*shard, "sweep: shard");
  options.limit = limit;
  options.fresh = fresh;
  options.timeout_s = timeout;
  options.plugin_directories = plugin_path(paths_of(plugins));
  Counter counter(progress);
  options.stop = &counter.interrupts.stop;
  options.on_done = [&counter](std::size_t done, std::size_t all) { counter.show(done, all); };
  const auto folder = path_of(directory);
  sweep::RunOutcome outcome;
  {
    const py::gil_scoped_release unlocked;
    outcome = sweep::run_sweep(folder, options);
  }
  counter.interrupts.rethrow();
  py::dict out;
  out["planned"] = outcome.planned;
  out["recorded"] = outcome.recorded;
  out["run"] = outcome.run;
  out["crashed"] = outcome.crashed;
  out["stopped"] = outcome.stopped;
  return out;
}

py::tuple merge_sweeps(py::handle directories, const std::vector<std::string>& by) {
  const auto folders = paths_of(directories);
  sweep::Merged merged;
  {
    const py::gil_scoped_release unlocked;
    merged = sweep::merge(sweep::read_sweeps(folders), by);
  }
  return py::make_tuple(to_python(sweep::to_json(merged)), sweep::to_table(merged));
}

py::object compare_sweeps(py::handle directories, const std::string& label,
                          const std::vector<std::string>& ignore) {
  const auto folders = paths_of(directories);
  std::vector<sweep::Comparison> comparisons;
  {
    const py::gil_scoped_release unlocked;
    const auto runs = sweep::read_sweeps_apart(folders).runs;
    if (folders.size() == 1)
      comparisons =
          sweep::compare_values(runs, {label, ignore}, std::numeric_limits<std::size_t>::max());
    else
      comparisons = {sweep::compare_sweeps(runs, folders[0], folders[1], {label, ignore})};
  }
  return to_python(sweep::to_json(comparisons));
}

std::string sweep_csv(py::handle directories) {
  const auto folders = paths_of(directories);
  const py::gil_scoped_release unlocked;
  std::string text;
  sweep::write_csv(sweep::read_sweeps(folders), [&text](std::string_view line) { text += line; });
  return text;
}

void write_records(py::handle directories, py::handle file) {
  const auto folders = paths_of(directories);
  const auto to = path_of(file);
  const py::gil_scoped_release unlocked;
  sweep::write_records(sweep::read_sweeps(folders), to, true);
}

// One run of a sweep under its judge, as the program's `sweep one`.
std::string sweep_one(const BoundScene& scene, py::handle plugins,
                      const std::vector<std::string>& argv) {
  InterruptCheck interrupts;
  simulation::Watch watch;
  watch.argv = argv;
  watch.stop = &interrupts.stop;
  watch.progress = [&interrupts](double, double) { interrupts.check(); };
  const auto folders = plugin_path(paths_of(plugins));
#ifdef HAMELIN_WITH_MUJOCO
  const simulation::PlantFactory plants = mujoco::make_plant;
#else
  const simulation::PlantFactory plants;
#endif
  std::string line;
  {
    const InterruptScope scope(interrupts);
    const py::gil_scoped_release unlocked;
    line = sweep::to_line(sweep::run_under_judge(scene.scene, folders, watch, plants));
  }
  interrupts.rethrow();
  return line;
}

}  // namespace

void add_sweeps(py::module_& module) {
  using py::arg;
  module.def("_plan_sweep", &plan_sweep, arg("directory"), arg("options"), arg("progress"),
             "Writes the plan of a sweep; returns a summary.");
  module.def("_run_sweep", &run_sweep, arg("directory"), arg("command"), arg("jobs"), arg("only"),
             arg("shard"), arg("limit"), arg("fresh"), arg("timeout"), arg("plugin_path"),
             arg("progress"), "Executes the plan of a sweep.");
  module.def("_merge_sweeps", &merge_sweeps, arg("directories"), arg("by"),
             "Document and table of `hamelin sweep merge`.");
  module.def("_compare_sweeps", &compare_sweeps, arg("directories"), arg("label"), arg("ignore"),
             "Document of `hamelin sweep compare`.");
  module.def("_sweep_csv", &sweep_csv, arg("directories"), "CSV of `hamelin sweep merge --csv`.");
  module.def("_write_records", &write_records, arg("directories"), arg("file"),
             "Writes the records of all runs in the order of the plans.");
  module.def("_sweep_one", &sweep_one, arg("scene"), arg("plugin_path"), arg("argv"),
             "One run of a sweep under its judge, as a line of JSON.");
}

}  // namespace hamelin::python
