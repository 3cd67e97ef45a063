#include <fmt/format.h>
#include <pybind11/stl.h>

#include <algorithm>

#include "arguments.hpp"
#include "bound_scene.hpp"
#include "hamelin/accuracy/accuracy.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/simulation/replay.hpp"
#include "hamelin/simulation/run.hpp"
#include "interrupts.hpp"
#include "module.hpp"
#include "planner_object.hpp"
#ifdef HAMELIN_WITH_MUJOCO
#include "hamelin/mujoco/plant.hpp"
#endif

namespace hamelin::python {

namespace fs = std::filesystem;

namespace {

simulation::PlantFactory plant_factory() {
#ifdef HAMELIN_WITH_MUJOCO
  return mujoco::make_plant;
#else
  return {};
#endif
}

void check_output(const std::optional<fs::path>& output, const scene::Scene& scene) {
  if (!output) return;
  std::vector<fs::path> inputs = scene::input_files(scene);
  inputs.emplace_back(scene.name);
  for (const auto& input : inputs) {
    std::error_code ec;
    if (fs::equivalent(*output, input, ec))
      throw Error(ErrorCode::usage,
                  fmt::format("{}: is an input of the run, expected another path for its output",
                              output->string()));
  }
}

// What a caller wants of a run: its files, and to see its progress.
struct Record {
  std::optional<fs::path> log, result;
  long every;
  std::vector<std::string> argv;
  py::object progress;
};

Record record_of(const py::dict& given) {
  Record record;
  record.log = optional_path(given["log"]);
  record.result = optional_path(given["result"]);
  record.every = given["every"].cast<long>();
  if (record.every < 1 || record.every > 1'000'000'000)
    refuse("run", "every", fmt::format("{}, expected 1 to 1000000000", record.every));
  record.argv = given["argv"].cast<std::vector<std::string>>();
  record.progress = given["progress"];
  if (record.log && record.result && fs::absolute(*record.log) == fs::absolute(*record.result))
    throw Error(
        ErrorCode::usage,
        fmt::format("log and result are both {}, expected different paths", record.log->string()));
  return record;
}

// A run that releases Python's lock, shows its progress and ends at Ctrl-C.
class WatchedRun {
 public:
  explicit WatchedRun(const Record& record) : record_(record) {
    if (record.log) log_.emplace(*record.log);
    watch.log = log_ ? &*log_ : nullptr;
    watch.every = record.every;
    watch.argv = record.argv;
    watch.stop = &interrupts_.stop;
    watch.progress = [this](double time_s, double duration_s) { show(time_s, duration_s); };
  }

  // Calls f without Python's lock; the exception of Ctrl-C or of a callback is raised afterwards.
  template <class F>
  auto call(const F& f) {
    const InterruptScope scope(interrupts_);
    auto result = [&] {
      const py::gil_scoped_release unlocked;
      return f();
    }();
    interrupts_.rethrow();
    return result;
  }
  py::object finish(const log::Result& result) const {
    const Json document = log::to_json(result);
    if (record_.result)
      write_file_atomically(*record_.result,
                            document.dump(2, ' ', false, Json::error_handler_t::replace) + "\n");
    return to_python(document);
  }

  simulation::Watch watch;

 private:
  void show(double time_s, double duration_s) {
    if (interrupts_.check() || record_.progress.is_none()) return;
    const py::gil_scoped_acquire locked;
    try {
      record_.progress(time_s, duration_s);
    } catch (py::error_already_set& error) {
      interrupts_.keep(error);
    }
  }

  const Record& record_;
  std::optional<log::RunLog> log_;
  InterruptCheck interrupts_;
};

py::object run(const BoundScene& scene, py::handle plugins, py::handle planner,
               py::handle trajectory, py::handle target, const py::dict& files) {
  const Record record = record_of(files);
  scene::Scene chosen = scene.scene;
  if (const auto file = optional_path(trajectory)) chosen.goals = {scene::trajectory_goal(*file)};
  if (const auto file = optional_path(target)) scene::set_target_file(chosen, *file, "run: target");
  check_output(record.log, chosen);
  check_output(record.result, chosen);
  const auto folders = plugin_path(paths_of(plugins));
  const PlannerObjectScope object(planner, chosen);
  WatchedRun watched(record);
  return watched.finish(watched.call(
      [&] { return simulation::run(chosen, folders, watched.watch, plant_factory()); }));
}

py::object full_config(const BoundScene& scene, py::handle plugins) {
  const auto folders = plugin_path(paths_of(plugins));
  return to_python(simulation::full_config(scene.scene, folders));
}

// The scene of a free motion: of a scene, or of a robot file that falls under gravity.
scene::Scene motion_scene(py::handle source, const std::optional<std::string>& tip) {
  scene::Scene scene;
  if (py::isinstance<BoundScene>(source)) {
    scene = source.cast<SharedScene>()->scene;
  } else {
    const fs::path file = path_of(source);
    const bool is_robot = file.extension() == ".urdf" || [&] {
      const Json document = read_json(file);
      return document.is_object() && document.value("schema", Json()) == "hamelin.robot/1";
    }();
    if (is_robot) {
      scene.name = file.string();
      scene.robot.file = file;
    } else {
      scene = scene::read_scene(file);
    }
  }
  if (tip) scene.robot.tip = tip;
  return scene;
}

void set_start(scene::Scene& scene, const char* function, int dof, py::handle q0, py::handle v0) {
  if (!q0.is_none()) scene.start_q = vector_of(function, "q0", q0, dof);
  if (!v0.is_none()) scene.start_v = vector_of(function, "v0", v0, dof);
}

py::object integrate(py::handle source, const std::optional<std::string>& tip, py::handle q0,
                     py::handle v0, const std::optional<std::string>& integrator,
                     const py::dict& options, const std::optional<double>& step,
                     const std::optional<double>& duration, const py::dict& files) {
  const Record record = record_of(files);
  scene::Scene scene = motion_scene(source, tip);
  const model::Model model = control::load_model(scene);
  set_start(scene, "integrate", model.dof(), q0, v0);
  scene.step_s = step.value_or(scene.step_s);
  scene.duration_s = duration.value_or(scene.duration_s);
  const std::string name = integrator.value_or(scene.integrator.name);
  if (name != scene.integrator.name) scene.integrator = {name, Json::object()};
  const Json given = to_json(options);
  for (const auto& [key, value] : given.items()) scene.integrator.params[key] = value;
  check_output(record.log, scene);
  check_output(record.result, scene);
  const auto motion = simulation::free_motion(scene, model);
  WatchedRun watched(record);
  return watched.finish(
      watched.call([&] { return simulation::integrate(model, motion, watched.watch); }));
}

py::dict difference(const std::optional<simulation::Verdict::Difference>& d) {
  py::dict out;
  if (!d) return out;
  out["line"] = d->line;
  out["type"] = d->type;
  out["k"] = d->k;
  out["time_s"] = d->time_s;
  out["field"] = d->field;
  out["logged"] = d->logged;
  out["replayed"] = d->replayed;
  return out;
}

py::dict verify(py::handle file, const std::optional<double>& tolerance, py::handle plugins,
                py::handle planner, const py::object& progress) {
  const fs::path log = path_of(file);
  const auto folders = plugin_path(paths_of(plugins));
  auto recorded = simulation::read_header(log, folders);
  const PlannerObjectScope object(planner, recorded.scene);
  // As `hamelin replay --verify`: rounding differs between builds and machines.
  const double bound = tolerance.value_or(recorded.other_build.empty() ? 0.0 : 1e-6);
  const Record record{{}, {}, 1, {}, progress};
  WatchedRun watched(record);
  const auto verdict = watched.call([&] {
    return simulation::verify(recorded, log, bound, folders, watched.watch, plant_factory());
  });
  py::dict out;
  out["equal"] = !verdict.beyond_tolerance && !verdict.stopped;
  out["to_the_bit"] = !verdict.first_difference && !verdict.stopped;
  out["tolerance"] = bound;
  out["finished"] = verdict.finished;
  out["lines"] = verdict.lines;
  out["ticks"] = verdict.ticks;
  out["largest"] = verdict.largest;
  out["first_difference"] = difference(verdict.first_difference);
  out["other_build"] = recorded.other_build;
  return out;
}

py::tuple make_report(py::handle logs, std::size_t frames) {
  const auto files = paths_of(logs);
  const fs::path page = prefix() / "share" / "hamelin" / "report" / "page.html";
  std::error_code ec;
  if (!fs::is_regular_file(page, ec))
    throw Error(ErrorCode::io,
                fmt::format("{}: is missing, because Node.js with npm was missing when hamelin was "
                            "built; install them and build hamelin again",
                            page.string()));
  report::Options options;
  options.frames_max = frames;
  report::Data data;
  std::string text;
  {
    const py::gil_scoped_release unlocked;
    data = report::make_data(files, options);
    text = report::make_page(read_file(page), data.bytes, page.string());
  }
  py::list runs;
  for (const auto& one : data.runs) {
    py::dict summary;
    summary["name"] = one.name;
    summary["log"] = one.log.string();
    summary["outcome"] = one.outcome;
    summary["time_s"] = one.time_s;
    summary["ticks"] = one.ticks;
    summary["frames"] = one.frames;
    summary["notes"] = one.notes;
    runs.append(summary);
  }
  return py::make_tuple(text, runs);
}

}  // namespace

void add_runs(py::module_& module) {
  using py::arg;
  module.def("_run", &run, arg("scene"), arg("plugin_path"), arg("planner"), arg("trajectory"),
             arg("target"), arg("files"), "Runs a scene in closed loop; returns the result.");
  module.def("_full_config", &full_config, arg("scene"), arg("plugin_path"),
             "The document of `hamelin run --print-config`.");
  module.def("_integrate", &integrate, arg("source"), arg("tip"), arg("q0"), arg("v0"),
             arg("integrator"), arg("options"), arg("step"), arg("duration"), arg("files"),
             "Integrates free motion; returns the result.");
  module.def("_verify", &verify, arg("log"), arg("tolerance"), arg("plugin_path"), arg("planner"),
             arg("progress"), "Repeats the run of a log and compares.");
  module.def("_make_report", &make_report, arg("logs"), arg("frames"),
             "The page of logs as text, and a summary of each run.");
}

}  // namespace hamelin::python
