#include <fmt/format.h>

#include <cmath>
#include <memory>

#include "command_line.hpp"
#include "commands.hpp"
#include "hamelin/io/file.hpp"
#include "hamelin/log/trajectory.hpp"
#include "hamelin/optimal/scene_motion.hpp"
#include "output.hpp"
#include "scene_flags.hpp"
#include "terminal.hpp"

namespace hamelin::app {

namespace {

struct OptimizeOptions {
  std::filesystem::path file;
  SceneFlags flags;
  std::string minimize = "effort", format = "json";
  optimal::SceneMotionOptions motion;
  std::optional<double> rate_hz;
  std::optional<std::filesystem::path> output;
  bool json = false;
};

std::string goal_text(const optimal::GoalMotion& goal, std::size_t index) {
  const optimal::Optimized& f = goal.found;
  const optimal::Solution& s = f.solution;
  const std::string name = fmt::format("goal {}", index + 1);
  const bool optimal = goal.valid() && s.converged;
  const std::string state = optimal        ? "nearly optimal"
                            : goal.valid() ? "valid, not proved optimal"
                                           : "no motion";
  std::string text = fmt::format("{:<12}{} after {} iterations: {:.6g} s, cost {:.6g}\n", name,
                                 coloured(state, optimal        ? Colour::good
                                                 : goal.valid() ? Colour::fair
                                                                : Colour::bad),
                                 f.iterations, f.motion.duration_s(), s.cost);
  if (const std::string cause = optimal::cause_of(s); !cause.empty())
    text += fmt::format("{:<12}{}\n", "", cause);
  if (goal.valid())
    text += fmt::format("{:<12}limits kept{}\n", "",
                        f.torque_share > 0.0 ? fmt::format("; torques up to {:.3g} % of theirs",
                                                           100.0 * f.torque_share)
                                             : "");
  if (!f.proof.certified)
    text += f.proof.margin_m > 0.0
                ? fmt::format("{:<12}{}: proved to keep {:.3g} m\n", "",
                              coloured("the margin is not kept", Colour::bad), f.proof.margin_m)
                : fmt::format("{:<12}{} from {:.4g} s on\n", "",
                              coloured("not proved clear", Colour::bad), f.proof.first_open_s);
  else if (std::isfinite(f.proof.margin_m))
    text += fmt::format("{:<12}proved to keep {:.3g} m from obstacles and from itself\n", "",
                        f.proof.margin_m);
  return text;
}

log::Trajectory trajectory_of(const optimal::SceneMotion& motion, std::optional<double> rate_hz) {
  log::Trajectory out;
  out.joints = motion.joints;
  for (auto& point : motion.points(rate_hz))
    out.points.push_back({point.time_s, point.q, point.v, point.torque, point.a});
  return out;
}

std::string file_text(const OptimizeOptions& options, const optimal::SceneMotion& motion) {
  if (options.format == "csv") return log::to_csv(trajectory_of(motion, options.rate_hz));
  if (options.format == "ros")
    return log::to_joint_trajectory(trajectory_of(motion, options.rate_hz)).dump(1) + "\n";
  return optimal::to_json(motion, options.motion, options.rate_hz).dump(1) + "\n";
}

int optimize(OptimizeOptions options) {
  options.motion.objective =
      options.minimize == "time" ? optimal::Objective::time : optimal::Objective::effort;
  const scene::Scene scene = read_scene(options.file, options.flags);
  std::optional<std::filesystem::path> target;
  if (options.output) target = output_target(*options.output, files_of(scene));
  const optimal::SceneMotion motion = optimal::optimize_scene(scene, options.motion);
  if (target && motion.valid()) write_file_atomically(*target, file_text(options, motion));
  if (options.json) {
    print_json(optimal::to_json(motion, options.motion, options.rate_hz));
  } else {
    std::string text;
    for (std::size_t i = 0; i < motion.goals.size(); ++i) text += goal_text(motion.goals[i], i);
    report(text);
  }
  return motion.valid() ? 0 : 1;
}

void add_motion_options(CLI::App& command, OptimizeOptions& options) {
  optimal::SceneMotionOptions& motion = options.motion;
  const CLI::Range positive(1e-9, 1e12);
  restrict_values(
      command
          .add_option("--minimize", options.minimize,
                      "effort: the integral of squared torques, each as a share of its limit; or "
                      "time")
          ->capture_default_str(),
      {"effort", "time"});
  command
      .add_option("--duration", motion.duration_s,
                  "time to each goal [s]; with --minimize time the first guess (default: at half "
                  "of the velocity limits)")
      ->type_name("T")
      ->check(positive);
  command
      .add_option("--intervals", motion.intervals,
                  "intervals between knots, to each goal; more where torques between the knots "
                  "need them")
      ->type_name("N")
      ->check(CLI::Range(optimal::least_intervals, optimal::most_intervals))
      ->capture_default_str();
  command
      .add_option("--margin", motion.margin_m, "least clearance, which is proved at all times [m]")
      ->type_name("M")
      ->check(CLI::Range(0.0, 0.1))
      ->capture_default_str();
  command
      .add_option("--limit-share", motion.limit_share,
                  "share of the limits of velocity and torque that the motion may use; the rest is "
                  "for the feedback of an arm that follows it (default 1 of velocities, 0.9 of "
                  "torques)")
      ->type_name("S")
      ->check(CLI::Range(0.01, 1.0));
  command
      .add_option("--acceleration", motion.acceleration,
                  "limit of all joints [rad/s^2 or m/s^2] (default: none)")
      ->type_name("A")
      ->check(positive);
  command
      .add_option("--jerk", motion.jerk, "limit of all joints [rad/s^3 or m/s^3] (default: none)")
      ->type_name("J")
      ->check(positive);
}

void add_output_options(CLI::App& command, OptimizeOptions& options) {
  restrict_values(command
                      .add_option("--format", options.format,
                                  "of the output: json, csv, or ros for the fields of "
                                  "trajectory_msgs/msg/JointTrajectory")
                      ->capture_default_str(),
                  {"json", "csv", "ros"});
  command
      .add_option("--rate", options.rate_hz,
                  "write this number of points per second (default: the knots)")
      ->type_name("HZ")
      ->check(CLI::Range(1e-9, 1e12));
  command.add_option("-o,--output", options.output, "file to write the motion to")
      ->type_name("FILE");
  command.add_flag("--json", options.json, "print JSON");
}

void add_optimize(CLI::App& app, int& exit_code) {
  auto* command = add_command(
      app, "optimize",
      "Find the motion of least effort or time to each goal of a scene. It keeps all limits, and "
      "the margin is proved. The exit code is 1 if a goal has no such motion",
      "hamelin optimize data/scenes/shelf.json --guide rrt-connect -o shelf-motion.json\n"
      "hamelin optimize data/scenes/pillar.json --minimize time --rate 1000 --format csv "
      "-o fast.csv");
  const auto options = std::make_shared<OptimizeOptions>();
  command->add_option("scene", options->file, "scene file")->required()->type_name("SCENE.json");
  add_guide_option(*command, options->flags);
  add_motion_options(*command, *options);
  add_set_option(*command, options->flags.set,
                 "set one value of the scene, e.g. /model/torque_limits=false; may be repeated");
  add_output_options(*command, *options);
  command->callback([options, &exit_code] { exit_code = optimize(*options); });
}

const RegisteredCommand registered_optimize("optimize", add_optimize);

}  // namespace

}  // namespace hamelin::app
