#include <fmt/format.h>
#include <pybind11/stl.h>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/simulation/run.hpp"
#include "hamelin/sweep/judge.hpp"
#include "hamelin/sweep/make_plan.hpp"
#include "hamelin/sweep/merge.hpp"
#include "hamelin/sweep/run_sweep.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#ifdef HAMELIN_WITH_MUJOCO
#include "hamelin/mujoco/plant.hpp"
#endif

namespace hamelin::python {

namespace {

// Progress of work that is counted, with Ctrl-C.
class Counter {
 public:
  explicit Counter(py::object progress) : progress_(std::move(progress)) {}
  void show(std::size_t done, std::size_t all) {
    if (interrupts.check() || progress_.is_none()) return;
    const py::gil_scoped_acquire locked;
    try {
      progress_(done, all);
    } catch (py::error_already_set& error) {
      interrupts.keep(error);
    }
  }
  InterruptCheck interrupts;

 private:
  py::object progress_;
};

py::tuple measure(const BoundModel& bound, const std::string& name, py::handle q0, py::handle v0,
                  py::handle damping, double duration, const std::string& integrators,
                  const std::vector<double>& steps, const std::vector<double>& rtols,
                  const std::vector<double>& tolerances, const std::optional<double>& atol,
                  long every, bool reference, const py::object& progress) {
  const int dof = bound.model.dof();
  accuracy::Options options;
  options.name = name;
  options.q0 = q0.is_none() ? Eigen::VectorXd(Eigen::VectorXd::Zero(dof))
                            : vector_of("accuracy", "q0", q0, dof);
  options.v0 = v0.is_none() ? Eigen::VectorXd(Eigen::VectorXd::Zero(dof))
                            : vector_of("accuracy", "v0", v0, dof);
  options.channels.damping = optional_vector("accuracy", "damping", damping, dof);
  options.duration_s = duration;
  options.schemes = accuracy::read_schemes(integrators);
  options.steps_s = steps;
  options.rtols = rtols;
  options.tolerances = tolerances;
  options.atol = atol;
  if (every < 0) refuse("accuracy", "every", fmt::format("{}, expected 0 or more", every));
  options.every = every;
  options.reference = reference;
  Counter counter(progress);
  // A row cannot be interrupted, but the next one is not begun.
  options.progress = [&counter](std::size_t done, std::size_t all) {
    counter.show(done, all);
    if (counter.interrupts.stop) counter.interrupts.raise();
  };
  accuracy::Measurement measurement;
  {
    const py::gil_scoped_release unlocked;
    measurement = accuracy::measure(bound.model, options);
  }
  counter.interrupts.rethrow();
  return py::make_tuple(to_python(accuracy::to_json(measurement)), accuracy::to_table(measurement));
}

py::dict plan_sweep(py::handle directory, py::handle scenes,
                    const std::vector<std::string>& planners, const std::vector<std::string>& set,
                    const std::vector<std::string>& vary, const std::vector<std::uint64_t>& seeds,
                    const std::optional<double>& duration, py::handle plugins) {
  sweep::PlanOptions options;
  options.files = paths_of(scenes);
  options.planners = planners;
  options.set = set;
  options.vary = vary;
  options.seeds = seeds;
  options.duration_s = duration;
  options.plugin_directories = plugin_path(paths_of(plugins));
  std::vector<std::string> notes;
  options.on_note = [&notes](const std::string& text) { notes.push_back(text); };
  const auto folder = path_of(directory);
  sweep::Plan plan;
  {
    const py::gil_scoped_release unlocked;
    plan = sweep::make_plan(folder, options);
  }
  py::dict out;
  out["directory"] = folder.string();
  out["scenes"] = plan.scenes.size();
  out["runs"] = plan.runs.size();
  out["sha256"] = plan.sha256;
  out["notes"] = notes;
  return out;
}

py::dict run_sweep(py::handle directory, const std::vector<std::string>& command, std::size_t jobs,
                   const std::string& only, const std::optional<std::size_t>& limit, bool fresh,
                   const std::optional<double>& timeout, py::handle plugins,
                   const py::object& progress) {
  if (jobs > 1024) refuse("sweep", "jobs", fmt::format("{}, expected 1 to 1024", jobs));
  sweep::RunOptions options;
  options.command = command;
  options.jobs = jobs;
  options.only = only;
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
    merged = sweep::merge(folders, by);
  }
  return py::make_tuple(to_python(sweep::to_json(merged)), sweep::to_table(merged));
}

// One run of a sweep under its judge, as the program's `sweep one`.
std::string sweep_one(const BoundScene& scene, py::handle plugins,
                      const std::vector<std::string>& argv) {
  sweep::Judge judge(scene.scene);
  InterruptCheck interrupts;
  simulation::Watch watch;
  watch.argv = argv;
  watch.stop = &interrupts.stop;
  watch.progress = [&interrupts](double, double) { interrupts.check(); };
  watch.at_node = [&judge](double time_s, const Eigen::VectorXd& q) { judge.add_node(time_s, q); };
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
    const log::Result result = simulation::run(scene.scene, folders, watch, plants);
    const Json document{{"result", log::to_json(result)},
                        {"judge", sweep::to_json(judge.verdict())}};
    line = document.dump(-1, ' ', false, Json::error_handler_t::replace);
  }
  interrupts.rethrow();
  return line;
}

}  // namespace

void add_studies(py::module_& module) {
  using py::arg;
  module.def("_measure", &measure, arg("model"), arg("name"), arg("q0"), arg("v0"), arg("damping"),
             arg("duration"), arg("integrators"), arg("steps"), arg("rtols"), arg("tolerances"),
             arg("atol"), arg("every"), arg("reference"), arg("progress"),
             "Document and table of `hamelin accuracy`.");
  module.def("_plan_sweep", &plan_sweep, arg("directory"), arg("scenes"), arg("planners"),
             arg("set"), arg("vary"), arg("seeds"), arg("duration"), arg("plugin_path"),
             "Writes the plan of a sweep.");
  module.def("_run_sweep", &run_sweep, arg("directory"), arg("command"), arg("jobs"), arg("only"),
             arg("limit"), arg("fresh"), arg("timeout"), arg("plugin_path"), arg("progress"),
             "Executes the plan of a sweep.");
  module.def("_merge_sweeps", &merge_sweeps, arg("directories"), arg("by"),
             "Document and table of `hamelin sweep merge`.");
  module.def("_sweep_one", &sweep_one, arg("scene"), arg("plugin_path"), arg("argv"),
             "One run of a sweep under its judge, as a line of JSON.");
}

}  // namespace hamelin::python
