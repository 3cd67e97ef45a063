#pragma once
#include <Eigen/Core>
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>

#include "hamelin/core/error.hpp"
#include "hamelin/io/json.hpp"
#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_abi.h"

/// The header for authors of planners: thin C++ views of the C structs of plugin_abi.h, a base
/// class, and the macro that makes a plugin of it. Views own nothing and are cheap to copy. A view
/// is valid as long as the struct behind it: a Tick and a Command during one call, a Setup and a
/// Host as long as the planner. Keep a copy of the view, not a reference to it.
namespace hamelin::planning {

using ConstVectorMap = Eigen::Map<const Eigen::VectorXd>;
using VectorMap = Eigen::Map<Eigen::VectorXd>;

/// Converts three numbers of a C struct to a vector.
[[nodiscard]] inline Eigen::Vector3d vec3(const double (&x)[3]) {
  return {x[0], x[1], x[2]};
}

/// Where a contact's obstacle point lies.
enum class ContactKind : std::int32_t {
  map,      ///< occupied space of the map
  unknown,  ///< space that the map does not know, in scenes where it blocks
  obstacle  ///< an obstacle of the scene; hamelin_contact::obstacle is its index
};

[[nodiscard]] inline ContactKind kind_of(const hamelin_contact& contact) noexcept {
  if (contact.obstacle == HAMELIN_OBSTACLE_MAP) return ContactKind::map;
  return contact.obstacle == HAMELIN_OBSTACLE_UNKNOWN ? ContactKind::unknown
                                                      : ContactKind::obstacle;
}

/// The data that are fixed for a whole run.
class Setup {
 public:
  explicit Setup(const hamelin_setup& raw) : raw_(&raw) {}

  [[nodiscard]] int dof() const { return static_cast<int>(raw_->dof); }
  /// The nominal robot as resolved JSON (hamelin.robot/1).
  [[nodiscard]] std::string_view robot_json() const {
    return {raw_->robot_json, raw_->robot_json_size};
  }
  /// The nominal robot at its base pose, with the scene's gravity. Each call builds a new model.
  /// @throws Error invalid if the robot's JSON violates the plugin interface
  [[nodiscard]] model::Model model() const;
  /// Control shapes, spheres and capsules, in their link's COM frame [m].
  [[nodiscard]] std::span<const hamelin_sphere> spheres() const {
    return {raw_->spheres, raw_->sphere_count};
  }
  /// The goals, in the order in which they must be reached.
  [[nodiscard]] std::span<const hamelin_goal> goals() const {
    return {raw_->goals, raw_->goal_count};
  }
  /// The goal of that index. @throws Error plugin if there is none
  [[nodiscard]] const hamelin_goal& goal(std::size_t index) const {
    if (index >= raw_->goal_count)
      throw Error(ErrorCode::plugin, "no goal of index " + std::to_string(index));
    return raw_->goals[index];
  }
  /// Position limits [rad or m]. This and the other limits are absent if the scene does not model
  /// them.
  [[nodiscard]] std::optional<ConstVectorMap> q_lower() const { return limit(raw_->q_lower); }
  [[nodiscard]] std::optional<ConstVectorMap> q_upper() const { return limit(raw_->q_upper); }
  /// Speed limits [rad/s or m/s].
  [[nodiscard]] std::optional<ConstVectorMap> velocity_max() const {
    return limit(raw_->velocity_max);
  }
  /// Torque limits [Nm or N].
  [[nodiscard]] std::optional<ConstVectorMap> effort_max() const { return limit(raw_->effort_max); }
  /// Limits of the rate of change of the held torque [Nm/s or N/s].
  [[nodiscard]] std::optional<ConstVectorMap> effort_rate_max() const {
    return limit(raw_->effort_rate_max);
  }
  /// Whether all channels are summed into one torque, held over the control period, and its delay
  /// [s].
  [[nodiscard]] bool sampled() const { return raw_->sampled != 0; }
  [[nodiscard]] double delay_s() const { return raw_->delay_s; }
  /// Whether ticks list self contacts.
  [[nodiscard]] bool self_collision() const { return raw_->self_collision != 0; }
  /// A joint goal's path: one column per way-point, the goal itself last; no columns without a
  /// path.
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> path(const hamelin_goal& goal) const {
    return {goal.path, dof(), static_cast<Eigen::Index>(goal.path_points)};
  }
  /// Time between two ticks [s].
  [[nodiscard]] double control_period_s() const { return raw_->control_period_s; }
  /// Ticks list contacts up to this distance [m].
  [[nodiscard]] double influence_m() const { return raw_->influence_m; }
  /// The edge of the map's smallest box [m]; zero without a map.
  [[nodiscard]] double map_resolution_m() const { return raw_->map_resolution_m; }
  [[nodiscard]] std::uint64_t seed() const { return raw_->seed; }
  [[nodiscard]] const hamelin_setup& raw() const { return *raw_; }

 private:
  [[nodiscard]] std::optional<ConstVectorMap> limit(const double* numbers) const {
    if (numbers == nullptr) return std::nullopt;
    return ConstVectorMap(numbers, dof());
  }
  const hamelin_setup* raw_;
};

/// The input of one tick.
class Tick {
 public:
  Tick(const hamelin_tick& raw, std::size_t dof)
      : raw_(&raw), dof_(static_cast<Eigen::Index>(dof)) {}

  [[nodiscard]] std::uint64_t k() const { return raw_->k; }
  [[nodiscard]] double time_s() const { return raw_->time_s; }
  /// Joint positions [rad or m] and velocities [rad/s or m/s].
  [[nodiscard]] ConstVectorMap q() const { return {raw_->q, dof_}; }
  [[nodiscard]] ConstVectorMap v() const { return {raw_->v, dof_}; }
  /// Near obstacle points, shape by shape, nearest first within a shape.
  [[nodiscard]] std::span<const hamelin_contact> contacts() const {
    return {raw_->contacts, raw_->contact_count};
  }
  /// Near pairs of parts of the arm itself; empty unless the scene models self-collision.
  [[nodiscard]] std::span<const hamelin_self_contact> self_contacts() const {
    return {raw_->self_contacts, raw_->self_contact_count};
  }
  /// The current goal, an index into Setup::goals().
  [[nodiscard]] std::size_t goal_index() const { return raw_->goal_index; }
  /// 1, or less where the scene requires slow motion.
  [[nodiscard]] double speed_scale() const { return raw_->speed_scale; }
  [[nodiscard]] const hamelin_tick& raw() const { return *raw_; }

 private:
  const hamelin_tick* raw_;
  Eigen::Index dof_;
};

/// The answer of one tick, in the channels that plugin_abi.h describes. All of them are zero at
/// first; channels that are not set have no effect.
class Command {
 public:
  Command(hamelin_command& raw, std::size_t dof)
      : raw_(&raw), dof_(static_cast<Eigen::Index>(dof)) {}

  /// Channel `potential`: value [J] and gradient [Nm or N] of a control potential at q.
  void set_potential(double value_J) { raw_->potential_J = value_J; }
  [[nodiscard]] VectorMap potential_gradient() { return {raw_->potential_gradient, dof_}; }
  /// Channel `damping`: non-negative coefficients [Nm s/rad or N s/m].
  [[nodiscard]] VectorMap damping() { return {raw_->damping, dof_}; }
  /// Channel `gyroscopic`: adds the force w × (velocity of the point), docs/theory.md (2.22).
  /// @param point_link in the link's COM frame [m] @param w_world in world axes [N s/m]
  /// @throws Error plugin if the capacity is used up; the host provides at least one term per
  ///   contact
  void add_gyroscopic(int link, const Eigen::Vector3d& point_link, const Eigen::Vector3d& w_world) {
    if (raw_->gyroscopic_count == raw_->gyroscopic_capacity)
      throw Error(ErrorCode::plugin, "more gyroscopic terms than the host's capacity");
    auto& term = raw_->gyroscopic[raw_->gyroscopic_count++];
    term.link = link;
    VectorMap(term.point_link_m, 3) = point_link;
    VectorMap(term.w_world, 3) = w_world;
  }
  /// The gyroscopic terms added so far.
  [[nodiscard]] std::span<hamelin_gyroscopic_term> gyroscopic() {
    return {raw_->gyroscopic, raw_->gyroscopic_count};
  }
  /// Channel `held torque`: constant over the step [Nm or N].
  [[nodiscard]] VectorMap held_torque() { return {raw_->held_torque, dof_}; }
  /// Channel `node velocity`: the velocity right after this node. A call switches the channel on.
  [[nodiscard]] VectorMap node_velocity() {
    raw_->has_node_velocity = 1;
    return {raw_->node_velocity, dof_};
  }
  /// Sets the work of the planner's own safety filter at this node [J], for the log:
  /// docs/theory.md (10.16), (10.17).
  void set_accounts(double filter_work_J, double recovery_work_J) {
    raw_->filter_work_J = filter_work_J;
    raw_->recovery_work_J = recovery_work_J;
  }
  /// Disables the scene's stall rule, for planners that detect their stalls themselves.
  void disable_stall_rule() { raw_->state = HAMELIN_PLANNER_OWN_STALL_RULE; }
  /// Ends the run because the planner cannot continue. The cause is one line, truncated if too
  /// long.
  void give_up(std::string_view cause) {
    raw_->state = HAMELIN_PLANNER_GAVE_UP;
    const std::size_t size = std::min(cause.size(), sizeof raw_->cause - 1);
    std::copy_n(cause.data(), size, raw_->cause);
    raw_->cause[size] = '\0';
  }
  [[nodiscard]] hamelin_command& raw() { return *raw_; }

 private:
  hamelin_command* raw_;
  Eigen::Index dof_;
};

/// Services of the host. They may be called in the planner's constructor and in tick.
class Host {
 public:
  explicit Host(const hamelin_host& raw) : raw_(&raw) {}

  void info(std::string_view line) const { log(HAMELIN_LOG_INFO, line); }
  void warning(std::string_view line) const { log(HAMELIN_LOG_WARNING, line); }
  /// Finds the contacts of the control shapes at any q, with the obstacles at their present
  /// positions.
  /// @param q dof numbers
  /// @return the number of contacts; if it exceeds out.size(), the farthest are left out
  [[nodiscard]] std::size_t closest_points(std::span<const double> q, double influence_m,
                                           std::span<hamelin_contact> out) const {
    return raw_->closest_points(raw_->context, q.data(), influence_m, out.data(), out.size());
  }
  /// Finds the self contacts at any q, in the same way.
  [[nodiscard]] std::size_t closest_self(std::span<const double> q, double influence_m,
                                         std::span<hamelin_self_contact> out) const {
    return raw_->closest_self(raw_->context, q.data(), influence_m, out.data(), out.size());
  }

 private:
  void log(std::int32_t level, std::string_view line) const {
    raw_->log(raw_->context, level, line.data(), line.size());
  }
  const hamelin_host* raw_;
};

/// Base class of planners. A planner has a constructor (const Host&, const Setup&, const Json&
/// params), which reports bad input by throwing Error; params are complete and checked against the
/// plugin's schema. It may have a function `static double influence_m(const Json& params)`: the
/// distance up to which it needs contacts [m].
class Planner {
 public:
  Planner() = default;
  Planner(const Planner&) = delete;
  Planner& operator=(const Planner&) = delete;
  virtual ~Planner() = default;
  /// Answers a tick. It must not allocate. An exception ends the run as a defect.
  virtual void tick(const Tick& tick, Command& command) = 0;
};

namespace detail {

/// Makes the host's instruction set the default of this plugin's copy of the libraries.
void take_instruction_set(const hamelin_setup& setup) noexcept;

/// Writes the message of the current exception, which must not cross the plugin interface, as one
/// line: truncated to error_size and nul-terminated.
void write_current_exception(char* error, std::size_t error_size) noexcept;

template <class Type>
struct Glue {
  struct Instance {
    template <class... Args>
    explicit Instance(std::size_t n, const Args&... args) : dof(n), planner(args...) {}
    std::size_t dof;
    Type planner;
  };

  static std::int32_t create(const hamelin_host* host, const hamelin_setup* setup,
                             const char* params_json, std::size_t params_size, void** out,
                             char* error, std::size_t error_size) noexcept {
    try {
      take_instruction_set(*setup);
      const Json params = parse_json({params_json, params_size}, "params");
      *out = std::make_unique<Instance>(setup->dof, Host(*host), Setup(*setup), params).release();
      return 0;
    } catch (...) {
      write_current_exception(error, error_size);
      return 1;
    }
  }
  static std::int32_t tick(void* instance, const hamelin_tick* tick, hamelin_command* command,
                           char* error, std::size_t error_size) noexcept {
    try {
      auto& self = *static_cast<Instance*>(instance);
      Command view(*command, self.dof);
      self.planner.tick(Tick(*tick, self.dof), view);
      return 0;
    } catch (...) {
      write_current_exception(error, error_size);
      return 1;
    }
  }
  static void destroy(void* instance) noexcept { delete static_cast<Instance*>(instance); }
  static double influence_m(const char* params_json, std::size_t params_size) noexcept {
    try {
      if constexpr (requires(const Json& params) { Type::influence_m(params); })
        return Type::influence_m(parse_json({params_json, params_size}, "params"));
    } catch (...) {
      // create gets the same parameters next and can report the error.
    }
    return -1.0;
  }
};

}  // namespace detail
}  // namespace hamelin::planning

/// Defines the entry point of a plugin. Use it once, in one file of the plugin, outside any
/// namespace. The entry point catches all exceptions, so that none crosses the plugin interface.
/// The texts must have static storage duration, as string literals do.
#define HAMELIN_PLANNER_PLUGIN(Type, plugin_name, plugin_version, plugin_description, schema_text) \
  extern "C" __attribute__((visibility("default"))) const hamelin_plugin* hamelin_plugin_entry(    \
      void);                                                                                       \
  extern "C" const hamelin_plugin* hamelin_plugin_entry(void) {                                    \
    using HamelinGlue = ::hamelin::planning::detail::Glue<Type>;                                   \
    static const hamelin_plugin plugin = {                                                         \
        sizeof(hamelin_plugin),   HAMELIN_PLUGIN_ABI_VERSION, plugin_name,                         \
        plugin_version,           plugin_description,         schema_text,                         \
        &HamelinGlue::create,     &HamelinGlue::tick,         &HamelinGlue::destroy,               \
        &HamelinGlue::influence_m};                                                                \
    return &plugin;                                                                                \
  }                                                                                                \
  static_assert(true, "")
