#pragma once
#include <Eigen/Core>
#include <cstdint>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/dynamics/frames.hpp"
#include "hamelin/geometry/se3.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/scene/environment.hpp"
#include "hamelin/scene/goal.hpp"
#include "hamelin/scene/joint_trajectory.hpp"
#include "hamelin/scene/motion.hpp"
#include "hamelin/scene/obstacles.hpp"
#include "hamelin/scene/payload.hpp"
#include "hamelin/scene/sensors.hpp"
#include "hamelin/scene/tip_constraint.hpp"

namespace hamelin::scene {

struct RobotRef {
  std::filesystem::path file;
  std::optional<std::string> tip;                ///< none: the only leaf
  std::optional<std::filesystem::path> spheres;  ///< sidecar file
  std::optional<std::filesystem::path> srdf;  ///< its disabled pairs are not checked for collision
};

/// One value per joint.
struct JointNumbers {
  bool from_robot = false;     ///< the values of the robot file
  std::vector<double> values;  ///< else one value for all joints, one per joint, or none: zero
};

/// Default speed below which dry friction becomes viscous [rad/s or m/s].
inline constexpr double default_friction_speed = 0.01;

/// Which properties of the robot are modelled. By default the limits that the robot file states are
/// kept; damping, friction, self-collision and payload are off.
struct ModelFlags {
  JointNumbers joint_damping;  ///< viscous [Nms/rad or Ns/m]
  JointNumbers friction;       ///< dry: torque −c tanh(v / friction_speed) [Nm or N]
  double friction_speed = default_friction_speed;  ///< [rad/s or m/s]
  /// Rotor inertia seen at the joint [kg m² or kg]. By default that of the robot file, as for
  /// masses: the motion would be wrong without it.
  JointNumbers armature{true, {}};
  bool joint_limits = true, velocity_limits = true, torque_limits = true;
  bool self_collision = false;
  std::optional<Payload> payload;
};

enum class ActuationType : std::int32_t { ideal, sampled, position };

[[nodiscard]] std::string_view to_string(ActuationType type) noexcept;

/// Which torques of the planner's model a servo adds to those of its gains: for the motion of the
/// set points, or only for holding them against gravity.
enum class Feedforward : std::int32_t { dynamics, gravity };

[[nodiscard]] std::string_view to_string(Feedforward feedforward) noexcept;

/// Position servos and the motion of their set points. One value for all joints, or one per joint.
struct Servo {
  std::vector<double> kp;  ///< torque per position error [Nm/rad or N/m]
  std::vector<double> kv;  ///< torque per velocity error [Nms/rad or Ns/m]
  Feedforward feedforward = Feedforward::dynamics;
  std::vector<double> acceleration_max{15.0};  ///< of set points [rad/s² or m/s²]
  std::vector<double> jerk_max{5000.0};        ///< [rad/s³ or m/s³]
};

struct Actuation {
  ActuationType type = ActuationType::ideal;
  double control_period_s = 0.001;  ///< an integer multiple of the step; one step under ideal
  double delay_s = 0.0;
  double joint_noise_rad = 0.0;
  /// Whether the controller estimates joint velocities from the measured positions.
  bool estimates_velocity = false;
  double estimator_bandwidth = 30.0;  ///< [1/s]
  double planner_mass_scale = 1.0;
  /// Sampled: of each joint's held torque [Nm/s or N/s].
  std::optional<double> torque_rate_max_Nm_s;
  double coulomb_friction_share = 0.0;  ///< of the effort limits; unknown to the planner
  /// Wall time within which a tick should be answered; none: the time between two ticks. Only
  /// reported.
  std::optional<double> deadline_s;
  Servo servo;  ///< position
};

/// How a run is kept safe. shield: each step is verified before it is made; certificate: after it
/// was made; none: only contacts are looked for.
enum class SafetyType : std::int32_t { shield, certificate, none };

[[nodiscard]] std::string_view to_string(SafetyType type) noexcept;

/// A bound of Safety that a scene does not state: NaN.
inline constexpr double unstated = std::numeric_limits<double>::quiet_NaN();

/// The safety of a run, with bounds of the errors that the shield's margins cover. What is not
/// stated depends on the scene and on the actuation in force: safety_type(), safety_bounds().
struct Safety {
  std::optional<SafetyType> type;
  double margin_m = 0.0;           ///< distance kept beyond what the bounds require
  double torque_share = unstated;  ///< of the torque limits, that a stop may use
  /// By how much a joint strays from the motion of a stop if all is as modelled [rad or m].
  double tracking_rad = unstated;
  /// Of the controller's masses and inertias, as a share of the true ones.
  double mass_error = 0.0;
  double friction_share = 0.0;  ///< dry friction that is not modelled, of the effort limits
  /// Standard deviation of measured joint positions [rad or m].
  double joint_noise_rad = unstated;
};

/// The bounds of Safety, all of them.
struct SafetyBounds {
  double margin_m, torque_share, tracking_rad, mass_error, friction_share, joint_noise_rad;
};

/// What simulates the arm: hamelin's own integrators, or MuJoCo.
enum class PlantType : std::int32_t { hamelin, mujoco };

[[nodiscard]] std::string_view to_string(PlantType type) noexcept;

/// A planner or integrator by name, with its own parameters.
struct Choice {
  std::string name;
  Json params = Json::object();
};

/// Who is given joint paths to goals, found by libs/search: planners that ask for them; nobody; or
/// every planner, at each goal.
enum class GuideType : std::int32_t { on_request, none, rrt_connect };

/// The name in a scene file, such as "rrt-connect".
[[nodiscard]] std::string_view to_string(GuideType type) noexcept;
/// @return none for a name that is not that of a guide
[[nodiscard]] std::optional<GuideType> guide_type(std::string_view name) noexcept;

/// A guide, and how it searches.
struct GuideSpec {
  GuideType type = GuideType::on_request;
  /// Clearance that paths keep away from the start and goals [m]; none: somewhat more than the
  /// planner's margin.
  std::optional<double> margin_m;
  long checks_max = 200000;    ///< after which a search ends without a path
  long improve_checks = 2000;  ///< for which a path is improved after it was found
  int searches_max = 5;        ///< of a goal, after stalls
  /// Simulated time that a check takes [s]. With real time nothing is charged.
  double check_time_s = 2e-6;
};

/// A wrench of the surroundings on the arm during a run. Controllers do not know of it.
struct WrenchSpec {
  std::string frame;  ///< name; empty: the tip
  dynamics::Reference reference = dynamics::Reference::local_world_aligned;
  Eigen::Vector3d force_N = Eigen::Vector3d::Zero(), moment_Nm = Eigen::Vector3d::Zero();
  double from_s = 0.0;
  std::optional<double> to_s;  ///< none: up to the end
};

struct StallRule {
  double speed_m_s = 0.002, distance_m = 0.2, hold_s = 1.0;
};

/// A scene file, read and checked (hamelin.scene/1). docs/schema/scene.schema.json defines each
/// field. What is empty is not modelled. The defaults are those of a scene file.
struct Scene {
  std::string name;  ///< the file it came from
  RobotRef robot;
  geometry::SE3 base;
  Quaternion base_quaternion_wxyz{1.0, 0.0, 0.0, 0.0};  ///< see Quaternion
  Eigen::Vector3d gravity_m_s2{0.0, 0.0, -9.81};        ///< in the world; zero: weightless
  Eigen::VectorXd start_q, start_v;                     ///< empty: zeros
  std::vector<Goal> goals;
  std::optional<MapSpec> map;
  std::vector<Obstacle> obstacles;
  std::vector<SensorSpec> sensors;
  std::vector<Event> events;  ///< happen in this order
  std::vector<WrenchSpec> wrenches;
  ModelFlags model;
  Actuation actuation;
  PlantType plant = PlantType::hamelin;
  Safety safety;
  std::optional<Choice> planner;
  GuideSpec guide;
  Choice integrator{"hamel-variational", Json::object()};
  std::optional<StallRule> stall;
  double step_s = 0.001, duration_s = 10.0;
  std::uint64_t seed = 1;
};

/// The bounds that the scene states, and defaults for the type of its actuation where it states
/// none: torques that act late, and are held for a period, are followed less exactly.
[[nodiscard]] SafetyBounds safety_bounds(const Scene& scene);

/// How a run of the scene is kept safe, if nothing is added to its world: what it states, else a
/// shield where the arm could hit or pass anything that is modelled.
[[nodiscard]] SafetyType safety_type(const Scene& scene);

/// The file of a follow goal's way-points or stream; empty: none.
[[nodiscard]] std::filesystem::path target_file(const Goal& goal);

/// The files that a run of the scene reads, without the scene file itself: robot, spheres, SRDF,
/// paths of goals, way-points of obstacles and targets, streams of targets, map and its changes.
[[nodiscard]] std::vector<std::filesystem::path> input_files(const Scene& scene);

/// Reads a scene file; paths in it are relative to its folder, see resolve_path().
/// @throws Error io, parse or invalid: "file: /json/pointer: what is wrong, what was expected"
[[nodiscard]] Scene read_scene(const std::filesystem::path& file);

/// @param where prefix of each message, and the name of the scene
/// @throws Error invalid
[[nodiscard]] Scene scene_from_json(const Json& document, const std::filesystem::path& base_dir,
                                    const std::string& where);

/// The scene with all defaults written out; parts that it does not have are null.
/// scene_from_json() of it gives the same scene.
[[nodiscard]] Json resolved_json(const Scene& scene);

/// Sets one value by "/json/pointer=VALUE". VALUE is JSON, or else a string. Keys that the file
/// leaves out are added if the schema defines them.
/// @throws Error usage, one line that begins with the assignment
void set_pointer(Json& document, std::string_view assignment);

/// One obstacle in the format of a scene. @throws Error invalid, "where: …"
[[nodiscard]] Obstacle obstacle_from_json(const Json& document, const std::string& where);
/// @throws Error invalid for an ObservedMotion, which scenes do not have
[[nodiscard]] Json to_json(const Obstacle& obstacle);
/// In the format of a goal's may_touch; null if nothing may be touched.
[[nodiscard]] Json to_json(const Allowance& allowance);
/// @throws Error invalid for an ObservedMotion
[[nodiscard]] Json motion_json(const Motion& motion);

/// The region of a scene's map around its robot in its start configuration, see read_region().
/// @throws Error io, parse or invalid, also if start/q does not fit the model; usage if there is no
///        map
[[nodiscard]] MapRegion make_region(const Scene& scene, const model::Model& model,
                                    double influence);

/// The environment of a scene's robot in its start configuration, see Environment.
/// @throws Error io, parse or invalid, also if start/q does not fit the model
[[nodiscard]] Environment make_environment(const Scene& scene, const model::Model& model,
                                           double influence);

}  // namespace hamelin::scene
