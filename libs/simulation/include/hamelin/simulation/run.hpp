#pragma once
#include <atomic>
#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/scene/scene.hpp"

namespace spdlog {
class logger;
}

namespace hamelin::simulation {

/// What a caller may watch and steer while a run goes on.
struct Watch {
  log::LineSink* log = nullptr;             ///< null: nothing is recorded, and nothing is paid for it
  long every = 1;                           ///< a tick line every so many steps; step 0 and the last always
  std::vector<std::string> argv;            ///< the command line, for the provenance
  const std::atomic<bool>* stop = nullptr;  ///< set by a signal handler: the record ends properly
  std::optional<long> stop_at;              ///< as if stopped at this step: repeats a run that was interrupted
  /// Called at every node of a run in closed loop, the first and the last included.
  std::function<void(double time_s, const Eigen::VectorXd& q)> at_node;
  std::function<void(double time_s, double duration_s)> progress;  ///< called about every 1000 steps
  /// Receives diagnostics: what a planner says and what comes into sight (debug), goals in contact (info), what the
  /// planner warns of (warn). Null: none. Nothing is formatted for a level that is switched off.
  std::shared_ptr<spdlog::logger> diagnostics;
  /// Called once before a run that is logged: tick lines to come at most, and joints.
  std::function<void(double ticks, int dof)> announce;
};

/// Free motion of a robot: no planner, no obstacles.
struct FreeMotion {
  std::string name;  ///< for the result's "scene"
  Eigen::VectorXd q0, v0;
  double step_s = 1e-3, duration_s = 10.0;
  std::string integrator = "hamel-variational";  ///< or with an order, "gauss:8"
  integration::Parameters options;
  Eigen::VectorXd damping;  ///< empty: none
  Eigen::VectorXd coulomb;  ///< dry friction, see integration::Channels; empty: none
  double coulomb_speed = scene::default_friction_speed;
  Json config = Json::object();    ///< for the log's header: a scene's form, see free_motion()
  std::vector<log::Input> inputs;  ///< files it was read from
};

/// What a scene says of free motion: start, damping, step, duration, integrator. Planner, goals and obstacles are left
/// out, of its config too.
/// @throws Error invalid for integrator parameters or numbers that do not fit the robot
[[nodiscard]] FreeMotion free_motion(const scene::Scene& scene, const model::Model& model);

/// Integrates free motion. The result's outcome is completed, diverged or interrupted.
/// Under step control (options.rtol, atol) step_s is the first step, the last one ends at the duration, and the result
/// counts the accepted steps.
/// @throws Error usage if the duration is no whole number of fixed steps (to 1e-9 steps), or sizes do not match
[[nodiscard]] log::Result integrate(const model::Model& model, const FreeMotion& motion, const Watch& watch);

/// Runs a scene in closed loop with its planner: every tick kinematics, closest points, planner, one integrator step,
/// and a check that the motion between the ticks stayed clear.
/// @param plugin_directories where planners are looked for, in order
/// @throws Error for bad input: robot, map, planner parameters, goals that do not fit the robot
[[nodiscard]] log::Result run(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories,
                              const Watch& watch);

/// The scene as a document with every default written out, the planner's and the integrator's too: a log's `config`.
/// Paths are as seen from here.
/// @throws Error for parameters that are wrong, or a planner that is not found
[[nodiscard]] Json full_config(const scene::Scene& scene, const std::vector<std::filesystem::path>& plugin_directories);

/// The robot of a scene as a model: file, tip, spheres, payload, base, gravity.
[[nodiscard]] model::Model load_model(const scene::Scene& scene);

}  // namespace hamelin::simulation
