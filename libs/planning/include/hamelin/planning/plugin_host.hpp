#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_abi.h"

/// The host's side of the plugin interface (plugin_abi.h): finding, loading and checking plugins,
/// and calling their planners. Loading a plugin runs its code, so only directories that the caller
/// named are searched.
namespace hamelin::planning {

/// An array of C structs in the memory of a planner, to be filled by the host. The planner's struct
/// may be larger than the host's, then the rest of each element is zero; or smaller, then it gets
/// the fields that it knows.
template <class T>
class ArrayOut {
 public:
  ArrayOut(T* first, std::size_t capacity, std::size_t stride)
      : first_(reinterpret_cast<std::byte*>(first)), capacity_(capacity), stride_(stride) {}
  ArrayOut(std::span<T> all)  // NOLINT(google-explicit-constructor): the host's own array
      : ArrayOut(all.data(), all.size(), sizeof(T)) {}

  [[nodiscard]] std::size_t size() const noexcept { return capacity_; }
  void set(std::size_t i, const T& value) const noexcept {
    std::byte* const at = first_ + i * stride_;
    std::memcpy(at, &value, std::min(stride_, sizeof(T)));
    if (stride_ > sizeof(T)) std::memset(at + sizeof(T), 0, stride_ - sizeof(T));
  }

 private:
  std::byte* first_;
  std::size_t capacity_, stride_;
};

/// What answers a planner's query handle; plugin_abi.h describes the functions. One thread at a
/// time.
class QueryServices {
 public:
  QueryServices() = default;
  QueryServices(const QueryServices&) = delete;
  QueryServices& operator=(const QueryServices&) = delete;
  virtual ~QueryServices() = default;
  struct Snapshot {
    std::uint64_t world = 0;
    double time_s = 0.0;
  };
  virtual Snapshot refresh() = 0;
  virtual void clearance(const double* q, std::size_t count, double time_ahead_s, double at_least_m,
                         double* out) = 0;
  virtual std::size_t contacts(const double* q, double time_ahead_s, double influence_m,
                               ArrayOut<hamelin_contact> out) = 0;
  virtual std::size_t self_contacts(const double* q, double influence_m,
                                    ArrayOut<hamelin_self_contact> out) = 0;
  /// @return whether it is proved; then `margin_m` is set
  virtual bool motion_clear(const double* q0, const double* q1, double t0_s, double t1_s,
                            double& margin_m) = 0;
  /// @param gradient null if it is not wanted
  virtual void distance(const double* points_world_m, std::size_t count, double time_ahead_s,
                        double limit_m, double* distance_m, double* gradient) = 0;
  virtual std::size_t boxes(const Eigen::Vector3d& low_world_m, const Eigen::Vector3d& high_world_m,
                            ArrayOut<hamelin_box> out) = 0;
  virtual std::size_t obstacles(double time_ahead_s, ArrayOut<hamelin_obstacle_state> out) = 0;
};

/// The services that a host provides to its planners.
class HostServices {
 public:
  HostServices() = default;
  HostServices(const HostServices&) = delete;
  HostServices& operator=(const HostServices&) = delete;
  virtual ~HostServices() = default;
  /// @param level HAMELIN_LOG_INFO or HAMELIN_LOG_WARNING
  virtual void log(std::int32_t level, std::string_view line) = 0;
  /// Finds the contacts of the control shapes at q up to influence_m [m]. Writes the nearest
  /// out.size() of them and returns their number.
  virtual std::size_t closest_points(std::span<const double> q, double influence_m,
                                     ArrayOut<hamelin_contact> out) = 0;
  /// The same with obstacles of some kinds (HAMELIN_STANDING, HAMELIN_MOVING or their sum) where
  /// they will be. In the default all stand still.
  virtual std::size_t closest_ahead(std::span<const double> q, double /*time_ahead_s*/,
                                    std::int32_t kinds, double influence_m,
                                    ArrayOut<hamelin_contact> out) {
    return (kinds & HAMELIN_STANDING) != 0 ? closest_points(q, influence_m, out) : 0;
  }
  /// The same for pairs of parts of the arm itself. The default finds none.
  virtual std::size_t closest_self(std::span<const double> /*q*/, double /*influence_m*/,
                                   ArrayOut<hamelin_self_contact> /*out*/) {
    return 0;
  }
  /// Lists the obstacles that the planner is shown. The default has none.
  virtual std::size_t obstacles(ArrayOut<hamelin_obstacle_state> /*out*/) { return 0; }
  /// Lists obstacles of some kinds where they will be. The default has none that move.
  virtual std::size_t obstacles_ahead(double /*time_ahead_s*/, std::int32_t kinds,
                                      ArrayOut<hamelin_obstacle_state> out) {
    return (kinds & HAMELIN_STANDING) != 0 ? obstacles(out) : 0;
  }
  /// Draws a line of points of the world, three numbers each [m]. The default draws nothing.
  virtual void draw_path(std::span<const double> /*points_world_m*/) {}
  /// Asks for a path to the current goal. @return whether it will be searched. The default has no
  /// search.
  virtual bool request_path() { return false; }
  /// Makes a query; may be called by any thread. The default world is empty space.
  virtual std::unique_ptr<QueryServices> open_query();
};

/// A series of numbers that a planner sets at each tick.
struct Series {
  std::string name, unit;
};

/// Owns the data that a hamelin_setup points at. Fill the fields; a planner that is made from it
/// keeps its own copy.
struct SetupData {
  SetupData() = default;
  /// Fills in robot, base, gravity and control shapes.
  /// @param nominal the model that the planner works with
  explicit SetupData(const model::Model& nominal);

  std::size_t dof = 0;
  std::string robot_json;
  Eigen::Vector3d gravity_world_m_s2 = Eigen::Vector3d::Zero();
  Eigen::Vector3d base_position_world_m = Eigen::Vector3d::Zero();
  Eigen::Vector4d base_quaternion_wxyz{1.0, 0.0, 0.0, 0.0};
  std::vector<hamelin_shape> shapes;
  std::vector<hamelin_goal> goals;       ///< view() sets their `q` from goals_q
  std::vector<Eigen::VectorXd> goals_q;  ///< one per goal; of size zero unless it is a joint goal
  std::vector<Eigen::MatrixXd> paths;    ///< one per goal: way-points as columns, or empty
  std::size_t path_points_max = 0;       ///< view() raises it to the longest path of `goals`
  /// Limits: dof numbers, or of size zero where the scene does not model them.
  Eigen::VectorXd q_lower, q_upper, velocity_max, effort_max, effort_rate_max;
  double control_period_s = 0.0, deadline_s = 0.0;
  bool sampled = false, self_collision = false;
  double delay_s = 0.0;
  double influence_m = 0.0;
  double map_resolution_m = 0.0;
  double shield_margin_m = 0.0, shield_self_margin_m = 0.0;
  std::uint64_t seed = 0;

  /// Adds a goal.
  /// @param q dof numbers for a joint goal, else of size zero
  /// @param path of a joint goal: way-points as columns, the last of them q; or empty
  void add_goal(const hamelin_goal& goal, const Eigen::VectorXd& q = {},
                const Eigen::MatrixXd& path = {});
  /// The C view, valid until the next change. Sets the goals' q.
  [[nodiscard]] hamelin_setup view();
};

/// The memory behind a hamelin_command. It is allocated once and cleared before each tick.
class CommandBuffers {
 public:
  /// @param gyroscopic_capacity at least the number of contacts of any tick
  /// @param series how many series the planner declared
  CommandBuffers(std::size_t dof, std::size_t gyroscopic_capacity, std::size_t series = 0);
  CommandBuffers(const CommandBuffers&) = delete;
  CommandBuffers& operator=(const CommandBuffers&) = delete;

  void clear() noexcept;
  [[nodiscard]] hamelin_command& raw() noexcept { return raw_; }
  [[nodiscard]] const hamelin_command& raw() const noexcept { return raw_; }
  /// The channels, as described in plugin_abi.h.
  [[nodiscard]] const Eigen::VectorXd& potential_gradient() const noexcept {
    return potential_gradient_;
  }
  [[nodiscard]] const Eigen::VectorXd& damping() const noexcept { return damping_; }
  [[nodiscard]] std::span<const hamelin_gyroscopic_term> gyroscopic() const noexcept {
    return {gyroscopic_.data(), raw_.gyroscopic_count};
  }
  [[nodiscard]] const Eigen::VectorXd& held_torque() const noexcept { return held_torque_; }
  [[nodiscard]] const Eigen::VectorXd& node_velocity() const noexcept { return node_velocity_; }
  /// One number per declared series; NaN where the planner set none.
  [[nodiscard]] std::span<const double> series() const noexcept { return series_; }

 private:
  Eigen::VectorXd potential_gradient_, damping_, held_torque_, node_velocity_;
  std::vector<hamelin_gyroscopic_term> gyroscopic_;
  std::vector<double> series_;
  hamelin_command raw_{};
};

class LoadedPlanner;

/// Parameters that a planner has prepared, see LoadedPlanner::prepare_params(). They keep the
/// plugin loaded.
class PreparedParams {
 public:
  ~PreparedParams();
  PreparedParams(PreparedParams&& other) noexcept;
  PreparedParams& operator=(PreparedParams&&) = delete;

 private:
  friend class LoadedPlanner;
  struct Data;
  explicit PreparedParams(std::unique_ptr<Data> data);
  std::unique_ptr<Data> data_;
};

/// A copyable handle of a loaded plugin. The shared object stays loaded as long as any handle or
/// planner of it exists.
class Plugin {
 public:
  /// @throws Error plugin, one line that names the file, if the file does not exist or is not a
  ///   shared object (with the system's reason), has no entry symbol, or its entry point returns
  ///   null, versions of the interface that this program does not support, a short struct, a null
  ///   function, no name, or a parameter schema that is not a JSON object
  [[nodiscard]] static Plugin load(const std::filesystem::path& file);

  [[nodiscard]] const std::filesystem::path& file() const noexcept;
  [[nodiscard]] const std::string& name() const noexcept;
  [[nodiscard]] const std::string& version() const noexcept;
  [[nodiscard]] const std::string& description() const noexcept;
  /// The JSON Schema of its parameters. Unknown keys are errors even if the plugin's text does not
  /// forbid them.
  [[nodiscard]] const Json& params_schema() const noexcept;
  /// Names of the parameters that the schema marks as files by "input_file": true.
  [[nodiscard]] std::vector<std::string> file_params() const;

  /// Whether its tick may use the heap, and whether it starts threads, by its own declaration.
  [[nodiscard]] bool tick_allocates() const noexcept;
  [[nodiscard]] bool uses_threads() const noexcept;
  /// Whether it accepts goals that follow a target.
  [[nodiscard]] bool follows_targets() const noexcept;
  /// Whether it follows the paths of joint goals.
  [[nodiscard]] bool follows_paths() const noexcept;
  /// Whether it may ask for paths.
  [[nodiscard]] bool asks_for_paths() const noexcept;
  /// Whether it needs no near points while it follows a certified reference.
  [[nodiscard]] bool trusts_certified_paths() const noexcept;
  /// Whether it accepts joint goals with a trajectory.
  [[nodiscard]] bool follows_trajectories() const noexcept;
  /// Whether its planners' parameters can be changed while they run, and whether they can be told
  /// of a new start.
  [[nodiscard]] bool can_change_params() const noexcept;
  [[nodiscard]] bool can_reset() const noexcept;
  /// The version of the interface that this program and the plugin use.
  [[nodiscard]] std::uint32_t abi_version() const noexcept;

  /// The distance up to which a planner with these (checked) parameters needs contacts [m]; none if
  /// the plugin does not specify it.
  [[nodiscard]] std::optional<double> influence_m(const Json& checked_params) const;

  /// Makes a planner.
  /// @param setup moved into the planner
  /// @param services must outlive the planner
  /// @param checked_params the result of check_params
  /// @throws Error plugin with the text of the planner's own error
  [[nodiscard]] LoadedPlanner create(SetupData setup, HostServices& services,
                                     const Json& checked_params) const;

 private:
  friend class LoadedPlanner;
  friend class PreparedParams;
  struct Library;
  explicit Plugin(std::shared_ptr<const Library> library) : library_(std::move(library)) {}
  std::shared_ptr<const Library> library_;
};

/// Checks a planner's parameters and fills in defaults.
/// @param params an object, or null for all defaults
/// @throws Error invalid naming the planner, the key and what was expected
[[nodiscard]] Json check_params(const Plugin& plugin, const Json& params);

/// A planner together with its plugin, its setup and its link to the host's services.
class LoadedPlanner {
 public:
  ~LoadedPlanner();
  LoadedPlanner(LoadedPlanner&&) noexcept;
  LoadedPlanner& operator=(LoadedPlanner&&) noexcept;

  [[nodiscard]] const Plugin& plugin() const noexcept;

  /// Clears `out` and lets the planner fill it. Does not allocate.
  /// @return false for a defect, with a line in error(): the planner's own text, or the reason why
  ///   its answer is invalid (not finite, negative damping, a gyroscopic term on a link that does
  ///   not exist, an unknown state)
  [[nodiscard]] bool tick(const hamelin_tick& tick, CommandBuffers& out) noexcept;
  /// The reason why the last tick returned false.
  [[nodiscard]] std::string_view error() const noexcept;

  /// The series that the planner declared, in order.
  [[nodiscard]] const std::vector<Series>& series() const noexcept;
  /// Prepares parameters for apply_params(). On any thread, also during tick().
  /// @param checked_params the result of check_params
  /// @throws Error invalid with the planner's reason, also if it cannot change parameters
  [[nodiscard]] PreparedParams prepare_params(const Json& checked_params) const;
  /// Makes them those of the planner from the next tick on. Does not allocate.
  void apply_params(const PreparedParams& params) noexcept;
  /// Announces a new start from this state; nothing if the planner does not need to know.
  void reset(const Eigen::VectorXd& q, const Eigen::VectorXd& v) noexcept;
  /// Announces that obstacles or the map have changed.
  void world_changed(std::uint64_t world) noexcept;

 private:
  friend class Plugin;
  struct Instance;
  explicit LoadedPlanner(std::unique_ptr<Instance> instance);
  std::unique_ptr<Instance> instance_;
};

/// The suffix of plugin files: planner NAME is loaded from NAME.hamelin.so.
inline constexpr std::string_view plugin_suffix = ".hamelin.so";

/// The directories to search, in order and without repetition: those given, those in the
/// environment variable HAMELIN_PLUGIN_PATH (separated by colons), and the program's own.
[[nodiscard]] std::vector<std::filesystem::path> plugin_directories(
    const std::vector<std::filesystem::path>& given, const std::vector<std::filesystem::path>& own);

/// Loads the planner of that name from the first directory that contains it. If the text contains a
/// slash or ends in plugin_suffix, it is the path of the file to load.
/// @throws Error plugin; if no planner is found, with every directory searched, the planners in it,
///   and the most similar name
[[nodiscard]] Plugin find_plugin(const std::string& name_or_path,
                                 const std::vector<std::filesystem::path>& directories);
/// The file that find_plugin() would load, without running its code.
/// @throws Error plugin if none is found
[[nodiscard]] std::filesystem::path find_plugin_file(
    const std::string& name_or_path, const std::vector<std::filesystem::path>& directories);

/// One plugin file of a directory, loaded or refused.
struct ListedPlugin {
  std::filesystem::path file;
  std::optional<Plugin> plugin;
  std::string refusal;  ///< one line; empty if loaded
};
/// All plugins of the directories, in the order of the directories, by file name within each.
[[nodiscard]] std::vector<ListedPlugin> list_plugins(
    const std::vector<std::filesystem::path>& directories);

}  // namespace hamelin::planning
