#pragma once
#include <atomic>
#include <filesystem>
#include <functional>
#include <istream>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "hamelin/integration/integrator.hpp"
#include "hamelin/log/provenance.hpp"
#include "hamelin/log/result.hpp"
#include "hamelin/log/run_log.hpp"
#include "hamelin/scene/scene.hpp"
#include "hamelin/simulation/plant.hpp"

namespace spdlog {
class logger;
}

namespace hamelin::simulation {

/// How a caller observes and controls a run.
struct Watch {
  log::LineSink* log = nullptr;   ///< null: no log, at no cost
  long every = 1;                 ///< steps between tick lines; first and last always written
  std::vector<std::string> argv;  ///< the command line, for the provenance
  /// A stream of targets for a goal that follows one, JSON lines; it takes the place of the scene's
  /// file. Null: that file.
  std::istream* target = nullptr;
  /// Set by a signal handler: the run stops, and its log ends properly.
  const std::atomic<bool>* stop = nullptr;
  std::optional<long> stop_at;  ///< stops at this step, to repeat a run that was interrupted
  /// Called at every node of a run in closed loop, including the first and the last.
  std::function<void(double time_s, const Eigen::VectorXd& q)> at_node;
  std::function<void(double time_s, double duration_s)> progress;  ///< called every 1000 steps
  /// Receives diagnostics: messages of the planner and obstacles that become visible (debug), what
  /// the scene models and goals in contact (info), warnings of the planner (warn). Null: none.
  /// Levels that are off cost nothing.
  std::shared_ptr<spdlog::logger> diagnostics;
  /// Called once before a run with a log: the largest number of tick lines, and the number of
  /// joints.
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
  std::vector<scene::WrenchSpec> wrenches;
  Json config = Json::object();    ///< a scene for the log's header, see free_motion()
  std::vector<log::Input> inputs;  ///< the files it was read from
};

/// The free motion of a scene: start, damping, wrenches, step, duration, integrator. Planner, goals
/// and obstacles are left out, also from its config.
/// @throws Error invalid for integrator parameters or numbers that do not fit the robot
[[nodiscard]] FreeMotion free_motion(const scene::Scene& scene, const model::Model& model);

/// Integrates free motion. The result's outcome is completed, diverged or interrupted. Under step
/// control (options.rtol, atol) step_s is the first step, the last step ends at the duration, and
/// the result counts the accepted steps.
/// @throws Error usage if the duration is not an integer multiple of a fixed step (to 1e-9 steps),
/// or sizes do not match
[[nodiscard]] log::Result integrate(const model::Model& model, const FreeMotion& motion,
                                    const Watch& watch);

/// Runs a scene in closed loop with its planner. Each tick consists of kinematics, closest points,
/// the planner, one integrator step, and a check that the motion between the ticks stayed clear.
/// @param plugin_directories where planners are searched for, in order
/// @param plant_factory makes the plant if the scene's is not hamelin's own; empty: such scenes are
///        refused
/// @throws Error for bad input: robot, map, planner parameters, goals that do not fit the robot, a
///         start that is beyond a limit in force
[[nodiscard]] log::Result run(const scene::Scene& scene,
                              const std::vector<std::filesystem::path>& plugin_directories,
                              const Watch& watch, const PlantFactory& plant_factory = {});

/// The scene as a document with all defaults, including the planner's and the integrator's: the
/// `config` of a log. Paths are relative to the working directory.
/// @throws Error for wrong parameters, or a planner that is not found
[[nodiscard]] Json full_config(const scene::Scene& scene,
                               const std::vector<std::filesystem::path>& plugin_directories);

}  // namespace hamelin::simulation
