#include "hamelin/accuracy/accuracy.hpp"

#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "document.hpp"
#include "free_motion.hpp"
#include "hamelin/control/preparation.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/report/report.hpp"
#include "hamelin/simulation/run.hpp"
#include "output.hpp"
#include "page.hpp"
#include "robot_notes.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct AccuracyFlags {
  MotionFlags motion;
  std::string integrators;
  std::optional<std::string> steps, rtols, tolerances;
  std::optional<double> atol, duration_s;
  long every = 0;
  bool no_reference = false, json = false, markdown = false;
  std::optional<std::filesystem::path> output, page;
};

int run_accuracy(const AccuracyFlags& flags) {
  scene::Scene scene = read_motion(flags.motion);
  const model::Model model = control::load_model(scene);
  note_warnings(model.robot(), scene.robot.file);
  set_start(flags.motion, model.dof(), scene);
  scene.integrator = {};  // the integrators of the command line are measured instead
  const auto motion = simulation::free_motion(scene, model);

  accuracy::Options options;
  options.name = motion.name;
  options.q0 = motion.q0;
  options.v0 = motion.v0;
  options.channels.damping = motion.damping;
  options.channels.coulomb = motion.coulomb;
  options.channels.coulomb_speed = motion.coulomb_speed;
  options.duration_s = flags.duration_s.value_or(motion.duration_s);
  options.schemes = accuracy::read_schemes(flags.integrators);
  if (flags.steps) options.steps_s = number_list("--steps", *flags.steps);
  if (flags.rtols) options.rtols = number_list("--rtol", *flags.rtols);
  if (flags.tolerances) options.tolerances = number_list("--tolerance", *flags.tolerances);
  options.atol = flags.atol;
  options.every = flags.every;
  options.reference = !flags.no_reference;
  std::optional<std::filesystem::path> output, page, template_file;
  if (flags.output) output = output_target(*flags.output, files_of(scene));
  if (flags.page) page = output_target(*flags.page, files_of(scene));
  if (page) template_file = page_template("accuracy");  // before the long measurement

  const auto progress = std::make_shared<Progress>("rows measured");
  options.progress = [progress](std::size_t done, std::size_t all) {
    progress->show(static_cast<double>(done), static_cast<double>(all));
  };
  const accuracy::Measurement measurement = accuracy::measure(model, options);
  const Json document = accuracy::to_json(measurement);
  if (output) write_file_atomically(*output, document.dump(2) + "\n");
  if (page) write_page(*template_file, report::pack(accuracy::page_json({measurement})), *page);
  for (const auto& text : measurement.notes) note(text);
  if (flags.json)
    print_json(document);
  else
    report(flags.markdown ? accuracy::to_markdown(measurement) : accuracy::to_table(measurement));
  return 0;
}

void add_measurement_options(CLI::App& command, AccuracyFlags& flags) {
  command
      .add_option(
          "--integrators", flags.integrators,
          fmt::format(
              "comma-separated list such as gauss:8,rk4, with the order after a colon; one of {}",
              fmt::join(integration::integrator_names(), ", ")))
      ->required()
      ->type_name("a,b,..");
  command
      .add_option("--steps", flags.steps,
                  "fixed steps [s]; the duration is an integer multiple of each")
      ->type_name("H,H,..");
  command.add_option("--rtol", flags.rtols, "relative tolerances of integrators with step control")
      ->type_name("E,E,..");
  command
      .add_option("--atol", flags.atol,
                  "absolute tolerance of step control (default equal to --rtol)")
      ->type_name("E");
  command
      .add_option("--tolerance", flags.tolerances,
                  "tolerance of root-finding with fixed steps, see `hamelin integrate` (default "
                  "depends on the integrator)")
      ->type_name("E,E,..");
  command
      .add_option("--duration", flags.duration_s, "simulated time [s] (default the scene's, or 10)")
      ->type_name("T");
  command
      .add_option("--every", flags.every,
                  "sample the energy every K fixed steps (default: the smallest K that gives at "
                  "most 131072 samples)")
      ->type_name("K")
      ->check(CLI::Range(1L, 1000000000L));
  command.add_flag("--no-reference", flags.no_reference,
                   "measure energy and time only, without a reference, for long motions");
}

void add_output_flags(CLI::App& command, AccuracyFlags& flags) {
  command.add_flag("--json", flags.json, "print JSON (hamelin.accuracy/1)");
  command.add_flag("--markdown", flags.markdown, "print tables in Markdown")->excludes("--json");
  command.add_option("-o,--output", flags.output, "write the JSON document to a file")
      ->type_name("ACCURACY.json");
  command
      .add_option("--page", flags.page,
                  "write an HTML page with plots and tables; `hamelin report` combines several "
                  "measurements")
      ->type_name("PAGE.html");
}

void add_accuracy(CLI::App& app, int& exit_code) {
  auto* command = add_command(app, "accuracy",
                              "Measure speed against error of integrators on a robot. Every "
                              "integrator computes the same free motion with each "
                              "fixed step and, if it has step control, with each relative "
                              "tolerance. The error is the difference at the end "
                              "from a reference. Two independent schemes compute the reference, "
                              "and their difference estimates its own error",
                              "hamelin accuracy data/robots/planar3.json --integrators gauss:8,rk4 "
                              "--steps 0.05,0.02 --duration 1\n"
                              "hamelin accuracy arm.urdf --integrators gauss,dop853 --rtol "
                              "1e-4,1e-8 --duration 1 --page p.html\n"
                              "hamelin accuracy scene.json --integrators rk4 --steps 1e-3 "
                              "--duration 100 --no-reference --json");
  const auto flags = std::make_shared<AccuracyFlags>();
  add_motion_flags(*command, flags->motion);
  add_measurement_options(*command, *flags);
  add_output_flags(*command, *flags);
  command->callback([flags, &exit_code] { exit_code = run_accuracy(*flags); });
}

// What `hamelin report` shows of measurements.
std::string page_of_measurements(const std::vector<std::filesystem::path>& files) {
  std::vector<accuracy::Measurement> all;
  for (const auto& file : files) {
    if (kind_of(file) != Kind::accuracy)
      throw Error(ErrorCode::invalid, fmt::format("{}: is not a measurement of accuracy, expected "
                                                  "either measurements only or logs only",
                                                  file.string()));
    all.push_back(accuracy::measurement_from_json(read_json(file), file.string()));
  }
  return report::pack(accuracy::page_json(all));
}

const RegisteredCommand registered_accuracy("accuracy", add_accuracy);
const RegisteredPage registered_page(Kind::accuracy, "accuracy", page_of_measurements);

}  // namespace

}  // namespace hamelin::app
