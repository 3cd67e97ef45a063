#include <fmt/format.h>

#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/core/error.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/serve/client.hpp"
#include "hamelin/serve/server.hpp"
#include "output.hpp"
#include "plants.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct ServeOptions {
  std::filesystem::path scene, socket;
  SceneFlags flags;
  std::vector<std::filesystem::path> plugin_path;
  std::optional<double> patience_s;
  int lost_max = 10;
  bool lockstep = false, once = false;
};

struct PlantOptions {
  SceneFlags flags;
  std::filesystem::path scene;
  serve::SimulatedClientOptions client;
  std::optional<std::filesystem::path> result;
};

std::string times(const TimeHistogram& of) {
  if (of.count() == 0) return "none";
  return fmt::format("{:.1f} us (p50), {:.1f} us (p99), {:.1f} us at most", of.quantile(0.5),
                     of.quantile(0.99), of.largest());
}

// What a robot is sent: positions if the scene has them, else torques.
bool sends_positions(const scene::Scene& scene) {
  return scene.actuation.type == scene::ActuationType::position;
}

control::ControllerOptions controller_options(const scene::Scene& scene,
                                              const ServeOptions& options) {
  control::ControllerOptions out;
  out.position = sends_positions(scene);
  if (out.position) {
    out.acceleration_max = scene.actuation.servo.acceleration_max;
    out.jerk_max = scene.actuation.servo.jerk_max;
  }
  out.lost_measurements_max = options.lost_max;
  out.clock_s = control::steady_clock_s;
  out.late_answers_max = options.lockstep ? 0 : out.late_answers_max;
  out.log = [](std::int32_t level, std::string_view line) {
    level == HAMELIN_LOG_WARNING ? note(std::string(line)) : detail(std::string(line));
  };
  return out;
}

std::string describe(const serve::Server::Report& report) {
  const serve::Keeper::Counts& counts = report.counts;
  std::string text = fmt::format(
      "client      {} ticks; {} of {} goals reached; stopped {} times\n"
      "frames      {} lost, {} late or repeated, {} damaged\n"
      "answer      {}\n",
      counts.ticks, report.goals_reached, report.goals, counts.stops, counts.lost, counts.late,
      counts.damaged, times(report.answer_us));
  if (report.refused_requests > 0)
    text += fmt::format("requests    {} not answered, because too many were waiting\n",
                        report.refused_requests);
  return text;
}

int serve_scene(const ServeOptions& options) {
  const scene::Scene scene = read_scene(options.scene, options.flags);
  control::Controller controller(scene, plugin_path(options.plugin_path),
                                 controller_options(scene, options));
  serve::ServerOptions of_server{options.socket, sends_positions(scene),
                                 options.patience_s.value_or(controller.period_s()),
                                 options.lost_max + 1, options.scene.parent_path()};
  if (options.lockstep) of_server.patience_s = -1.0;
  serve::Server server(controller, of_server);
  report(fmt::format("serving     {}: {} joints, {}, {} s; socket {}\n", scene.name,
                     controller.model().dof(), of_server.position ? "positions" : "torques",
                     controller.period_s(), options.socket.string()));
  server.run(stop_on_signals(), [&](const serve::Server::Report& of_client) {
    report(describe(of_client));
    return !options.once;
  });
  return 0;
}

std::string describe(const serve::SimulatedClientReport& run) {
  const log::Result& r = run.result;
  std::string text = fmt::format("outcome     {}{}\n", log::to_string(r.outcome),
                                 r.cause.empty() ? "" : ": " + r.cause);
  text += fmt::format(
      "time        {:.6g} s, {} periods, {} of them stopping, {} without a set "
      "point of their own\n",
      r.time_s, run.periods, run.stopping, run.unanswered);
  if (r.min_clearance_m)
    text += fmt::format("clearance   {:.4g} m at least; {:.2f} % of the steps proved clear\n",
                        *r.min_clearance_m, 100.0 * r.certified_share.value_or(0.0));
  if (r.plant)
    text += fmt::format(
        "plant       {} {}; nodes in contact: {} by its own detection, {} by the judge\n",
        r.plant->type, r.plant->version, r.plant->contacts, r.plant->judge_contacts);
  text += fmt::format(
      "frames      {} lost, {} late or repeated, {} damaged by the server's "
      "account\n",
      run.lost, run.late, run.damaged);
  text += fmt::format("round trip  {}\n", times(run.round_trip_us));
  return text;
}

Json to_json(const serve::SimulatedClientReport& run) {
  Json out = log::to_json(run.result);
  Json& link = out["link"];
  link = {{"periods", run.periods}, {"stopping", run.stopping}, {"unanswered", run.unanswered},
          {"lost", run.lost},       {"late", run.late},         {"damaged", run.damaged}};
  if (run.round_trip_us.count() > 0)
    link["round_trip_us"] = {{"p50", run.round_trip_us.quantile(0.5)},
                             {"p99", run.round_trip_us.quantile(0.99)},
                             {"max", run.round_trip_us.largest()}};
  return out;
}

int move_plant(PlantOptions options) {
  const scene::Scene scene = read_scene(options.scene, options.flags);
  std::optional<std::filesystem::path> result;
  if (options.result) result = output_target(*options.result, files_of(scene));
  options.client.stop = &stop_on_signals();
  const serve::SimulatedClientReport run =
      serve::run_simulated_client(scene, plant_factory(), options.client);
  if (result) write_file_atomically(*result, to_json(run).dump(2) + "\n");
  report(describe(run));
  return log::exit_code(run.result.outcome);
}

void add_share(CLI::App& command, const char* name, double& value, const char* help) {
  command.add_option(name, value, help)->type_name("SHARE")->check(CLI::Range(0.0, 1.0));
}

void add_serve(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "serve", "Run the control loop of a scene as a process, for the driver of an arm",
      "hamelin serve data/scenes/shelf.json --socket /run/user/1000/arm\n"
      "chrt --fifo 50 hamelin serve arm.json --socket /run/arm");
  const auto options = std::make_shared<ServeOptions>();
  command->add_option("scene", options->scene, "scene file")->required()->type_name("SCENE.json");
  command->add_option("--socket", options->socket, "path of the socket; only its owner may connect")
      ->required()
      ->type_name("PATH");
  command
      ->add_option("--planner", options->flags.planner,
                   "planner plugin, by name or path (default the scene's)")
      ->type_name("NAME|PATH");
  command
      ->add_option("--patience", options->patience_s,
                   "how long a measurement may be overdue before its period counts as one without "
                   "[s] (default one period)")
      ->type_name("T")
      ->check(CLI::NonNegativeNumber);
  command
      ->add_option("--lost-max", options->lost_max,
                   "so many periods in a row may be without a measurement; after more of them the "
                   "arm is stopped")
      ->type_name("N")
      ->capture_default_str()
      ->check(CLI::Range(0, 1000));
  command->add_flag("--lockstep", options->lockstep,
                    "wait for each measurement as long as it takes, for simulations that are not "
                    "real-time");
  command->add_flag("--once", options->once, "end when the first client has gone");
  add_seed_option(*command, options->flags);
  add_set_option(*command, options->flags.set,
                 "set one value of the scene, e.g. /planner/params/gain=2; may be repeated");
  add_plugin_path_option(*command, options->plugin_path);
  command->callback([options, &exit_code] { exit_code = serve_scene(*options); });
}

void add_plant(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "plant", "Simulate the arm of a scene for `hamelin serve`, with faults",
      "hamelin plant data/scenes/shelf.json --socket /run/user/1000/arm --plant mujoco\n"
      "hamelin plant data/scenes/shelf.json --socket arm --real-time --lost 0.01 --late 0.01");
  const auto options = std::make_shared<PlantOptions>();
  command->add_option("scene", options->scene, "scene file, as that of the server")
      ->required()
      ->type_name("SCENE.json");
  command->add_option("--socket", options->client.socket, "path of the server's socket")
      ->required()
      ->type_name("PATH");
  restrict_values(command->add_option("--plant", options->flags.plant,
                                      "what simulates the arm (default the scene's, or hamelin)"),
                  {"hamelin", "mujoco"});
  command
      ->add_option("--duration", options->flags.duration_s,
                   "longest simulated time [s] (default the scene's)")
      ->type_name("T");
  command->add_flag("--real-time", options->client.real_time,
                    "keep to the period by the clock; else as fast as the server answers");
  serve::Faults& faults = options->client.faults;
  add_share(*command, "--lost", faults.lost, "share of measurements that are not sent");
  add_share(*command, "--late", faults.late,
            "share that is sent after the server has given up waiting");
  add_share(*command, "--repeated", faults.repeated, "share that is sent twice");
  add_share(*command, "--damaged", faults.damaged, "share that is sent with a wrong checksum");
  command->add_option("--fault-seed", faults.seed, "seed of these faults")->type_name("S");
  add_seed_option(*command, options->flags);
  add_set_option(*command, options->flags.set,
                 "set one value of the scene, e.g. /actuation/delay_s=0.001; may be repeated");
  command->add_option("--result", options->result, "write the result to a JSON file")
      ->type_name("OUT.json");
  command->callback([options, &exit_code] { exit_code = move_plant(*options); });
}

const RegisteredCommand registered_serve("serve", add_serve);
const RegisteredCommand registered_plant("plant", add_plant);

}  // namespace

}  // namespace hamelin::app
