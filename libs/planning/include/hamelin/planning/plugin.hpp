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
#include <utility>
#include <vector>

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

/// An array of C structs whose elements lie `stride` bytes apart, which may be more or less than
/// sizeof(T) if the other side of the interface was built with another header. Fields that were
/// appended to T after version 4 need a check by has_field().
template <class T>
class StridedArray {
 public:
  StridedArray() = default;
  StridedArray(const T* first, std::size_t count, std::size_t stride)
      : first_(reinterpret_cast<const std::byte*>(first)), count_(count), stride_(stride) {}
  /// A view of this side's own array.
  StridedArray(std::span<const T> all)  // NOLINT(google-explicit-constructor): as std::span has
      : StridedArray(all.data(), all.size(), sizeof(T)) {}
  StridedArray(const std::vector<T>& all)  // NOLINT(google-explicit-constructor)
      : StridedArray(std::span<const T>(all)) {}

  [[nodiscard]] std::size_t size() const noexcept { return count_; }
  [[nodiscard]] bool empty() const noexcept { return count_ == 0; }
  [[nodiscard]] const T& operator[](std::size_t i) const noexcept {
    return *reinterpret_cast<const T*>(first_ + i * stride_);
  }
  [[nodiscard]] const T& front() const noexcept { return (*this)[0]; }
  /// Whether the elements reach to the end of a field: has_field(offsetof(T, f), sizeof(T::f)).
  [[nodiscard]] bool has_field(std::size_t offset, std::size_t size) const noexcept {
    return stride_ >= offset + size;
  }

  class Iterator {
   public:
    using value_type = T;
    using difference_type = std::ptrdiff_t;
    Iterator() = default;
    Iterator(const std::byte* at, std::size_t stride) : at_(at), stride_(stride) {}
    const T& operator*() const { return *reinterpret_cast<const T*>(at_); }
    const T* operator->() const { return &**this; }
    Iterator& operator++() {
      at_ += stride_;
      return *this;
    }
    Iterator operator++(int) {
      const Iterator before = *this;
      ++*this;
      return before;
    }
    bool operator==(const Iterator& other) const { return at_ == other.at_; }

   private:
    const std::byte* at_ = nullptr;
    std::size_t stride_ = sizeof(T);
  };
  [[nodiscard]] Iterator begin() const { return {first_, stride_}; }
  [[nodiscard]] Iterator end() const { return {first_ + count_ * stride_, stride_}; }

 private:
  const std::byte* first_ = nullptr;
  std::size_t count_ = 0, stride_ = sizeof(T);
};

using Contacts = StridedArray<hamelin_contact>;
using SelfContacts = StridedArray<hamelin_self_contact>;
using ControlShapes = StridedArray<hamelin_shape>;
using Goals = StridedArray<hamelin_goal>;

/// Where a contact's obstacle point lies.
enum class ContactKind : std::int32_t {
  map,      ///< occupied space of the map
  unknown,  ///< space that the map does not know, in scenes where it blocks
  obstacle  ///< an obstacle; hamelin_contact::obstacle is its id
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
  [[nodiscard]] ControlShapes shapes() const {
    return {raw_->shapes, raw_->shape_count, raw_->shape_stride};
  }
  /// The goals at the start, in the order in which they must be reached. Tick::goal() is the
  /// current one, which may come from a later list.
  [[nodiscard]] Goals goals() const { return {raw_->goals, raw_->goal_count, raw_->goal_stride}; }
  /// No goal has a path of more way-points, also none of a later list.
  [[nodiscard]] std::size_t path_points_max() const { return raw_->path_points_max; }
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
  /// Time within which a tick should be answered [s].
  [[nodiscard]] double deadline_s() const { return raw_->deadline_s; }
  /// Time between two ticks [s].
  [[nodiscard]] double control_period_s() const { return raw_->control_period_s; }
  /// Ticks list contacts up to this distance [m].
  [[nodiscard]] double influence_m() const { return raw_->influence_m; }
  /// The edge of the map's smallest box [m]; zero without a map.
  [[nodiscard]] double map_resolution_m() const { return raw_->map_resolution_m; }
  /// A shield keeps so much from obstacles, and between parts of the arm, and more where the arm
  /// moves fast [m]; zero without a shield.
  [[nodiscard]] double shield_margin_m() const {
    return HAMELIN_HAS_FIELD(raw_, hamelin_setup, shield_margin_m) ? raw_->shield_margin_m : 0.0;
  }
  [[nodiscard]] double shield_self_margin_m() const {
    return HAMELIN_HAS_FIELD(raw_, hamelin_setup, shield_self_margin_m) ? raw_->shield_self_margin_m
                                                                        : 0.0;
  }
  [[nodiscard]] std::uint64_t seed() const { return raw_->seed; }
  [[nodiscard]] const hamelin_setup& raw() const { return *raw_; }

 private:
  [[nodiscard]] std::optional<ConstVectorMap> limit(const double* numbers) const {
    if (numbers == nullptr) return std::nullopt;
    return ConstVectorMap(numbers, dof());
  }
  const hamelin_setup* raw_;
};

/// Where the arm should be by the trajectory of its goal: dof numbers each. The rate, 1 or less
/// where the arm is held up, is contained in v and a.
struct Reference {
  ConstVectorMap q, v, a;
  double time_s, rate;
  bool certified;  ///< whether it is proved to be clear, and the shield can stop along it
};

/// What the tip keeps, to first order: what is left of each tolerance, but for a reserve [rad or m],
/// negative beyond that, and the derivatives by q, one column each.
struct Kept {
  ConstVectorMap slack;
  Eigen::Map<const Eigen::MatrixXd> gradient;
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
  [[nodiscard]] Contacts contacts() const {
    return {raw_->contacts, raw_->contact_count, raw_->contact_stride};
  }
  /// Near pairs of parts of the arm itself; empty unless the scene models self-collision.
  [[nodiscard]] SelfContacts self_contacts() const {
    return {raw_->self_contacts, raw_->self_contact_count, raw_->self_contact_stride};
  }
  /// The current goal. It stays valid until a tick with another goal_number().
  [[nodiscard]] const hamelin_goal& goal() const { return *raw_->goal; }
  /// Where the arm should be now by the trajectory of its goal; none without a trajectory.
  [[nodiscard]] std::optional<Reference> reference() const {
    const hamelin_goal& goal = *raw_->goal;
    if (!HAMELIN_HAS_FIELD(&goal, hamelin_goal, reference_rate) || goal.reference_q == nullptr)
      return std::nullopt;
    return Reference{ConstVectorMap(goal.reference_q, dof_),
                     ConstVectorMap(goal.reference_v, dof_),
                     ConstVectorMap(goal.reference_a, dof_),
                     goal.reference_time_s,
                     goal.reference_rate,
                     HAMELIN_HAS_FIELD(&goal, hamelin_goal, reference_certified) &&
                         goal.reference_certified != 0};
  }
  /// Another number means another goal.
  [[nodiscard]] std::uint64_t goal_number() const { return raw_->goal_number; }
  /// The index of the goal in its list.
  [[nodiscard]] std::size_t goal_index() const { return raw_->goal_index; }
  /// Number of the world's snapshot; changes with obstacles and map.
  [[nodiscard]] std::uint64_t world() const { return raw_->world; }
  /// 1, or less where the scene requires slow motion.
  [[nodiscard]] double speed_scale() const { return raw_->speed_scale; }
  /// The joint torques sent to the arm last [Nm or N]: within all limits, and not the planner's
  /// where a shield stopped the arm. None under ideal actuation.
  [[nodiscard]] std::optional<ConstVectorMap> torque() const {
    if (!HAMELIN_HAS_FIELD(raw_, hamelin_tick, torque) || raw_->torque == nullptr)
      return std::nullopt;
    return ConstVectorMap(raw_->torque, dof_);
  }
  /// The number of obstacles that move, or may move later, however far they are.
  [[nodiscard]] std::size_t moving_count() const {
    return HAMELIN_HAS_FIELD(raw_, hamelin_tick, moving_count) ? raw_->moving_count : 0;
  }
  /// The joint accelerations that the model does not explain [rad/s² or m/s²], because of friction
  /// or wrong masses. None where no torques are sent.
  [[nodiscard]] std::optional<ConstVectorMap> disturbance() const {
    if (!HAMELIN_HAS_FIELD(raw_, hamelin_tick, disturbance) || raw_->disturbance == nullptr)
      return std::nullopt;
    return ConstVectorMap(raw_->disturbance, dof_);
  }
  /// What the tip keeps on the way to the goal; of no rows where nothing is kept.
  [[nodiscard]] Kept kept() const {
    const bool any = HAMELIN_HAS_FIELD(raw_, hamelin_tick, kept_gradient) && raw_->kept_count > 0;
    const auto count = any ? static_cast<Eigen::Index>(raw_->kept_count) : 0;
    return {{any ? raw_->kept_slack : nullptr, count},
            {any ? raw_->kept_gradient : nullptr, dof_, count}};
  }
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
    auto& term = gyroscopic(raw_->gyroscopic_count++);
    term.link = link;
    VectorMap(term.point_link_m, 3) = point_link;
    VectorMap(term.w_world, 3) = w_world;
  }
  /// The number of gyroscopic terms added so far, and each of them.
  [[nodiscard]] std::size_t gyroscopic_count() const { return raw_->gyroscopic_count; }
  [[nodiscard]] hamelin_gyroscopic_term& gyroscopic(std::size_t i) {
    return *reinterpret_cast<hamelin_gyroscopic_term*>(
        reinterpret_cast<std::byte*>(raw_->gyroscopic) + i * raw_->gyroscopic_stride);
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
  /// Sets the number of a series at this tick. @param series what Host::declare_series returned
  void set_series(std::int32_t series, double value) {
    if (series >= 0 && static_cast<std::size_t>(series) < raw_->series_count)
      raw_->series[series] = value;
  }
  /// Disables the scene's stall rule, for planners that detect their stalls themselves.
  void disable_stall_rule() { raw_->state = HAMELIN_PLANNER_DETECTS_STALLS; }
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

/// Services of the host. They may be called in the planner's constructor, in tick and in the other
/// functions of a planner that run on the thread of tick; a Query on any thread.
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
    return raw_->closest_points(raw_->context, q.data(), influence_m, out.data(), out.size(),
                                sizeof(hamelin_contact));
  }
  /// Finds the contacts at any q with obstacles of some kinds, where they will be by what is known
  /// of their future.
  /// @param kinds HAMELIN_STANDING, HAMELIN_MOVING or their sum. Hosts that are older than this
  /// function count all obstacles as standing
  [[nodiscard]] std::size_t closest_ahead(std::span<const double> q, double time_ahead_s,
                                          std::int32_t kinds, double influence_m,
                                          std::span<hamelin_contact> out) const {
    if (!HAMELIN_HAS_FIELD(raw_, hamelin_host, closest_ahead))
      return (kinds & HAMELIN_STANDING) != 0 ? closest_points(q, influence_m, out) : 0;
    return raw_->closest_ahead(raw_->context, q.data(), time_ahead_s, kinds, influence_m,
                               out.data(), out.size(), sizeof(hamelin_contact));
  }
  /// Finds the self contacts at any q, in the same way.
  [[nodiscard]] std::size_t closest_self(std::span<const double> q, double influence_m,
                                         std::span<hamelin_self_contact> out) const {
    return raw_->closest_self(raw_->context, q.data(), influence_m, out.data(), out.size(),
                              sizeof(hamelin_self_contact));
  }
  /// Lists the obstacles that the planner is shown, at their present positions.
  /// @return their number, even if out is smaller
  [[nodiscard]] std::size_t obstacles(std::span<hamelin_obstacle_state> out) const {
    return raw_->obstacles(raw_->context, out.data(), out.size(), sizeof(hamelin_obstacle_state));
  }
  /// Lists obstacles of some kinds where they will be by what is known of their future.
  /// @param kinds HAMELIN_STANDING, HAMELIN_MOVING or their sum; hosts that are older than this
  /// function have no moving ones
  [[nodiscard]] std::size_t obstacles_ahead(double time_ahead_s, std::int32_t kinds,
                                            std::span<hamelin_obstacle_state> out) const {
    if (!HAMELIN_HAS_FIELD(raw_, hamelin_host, obstacles_ahead))
      return (kinds & HAMELIN_STANDING) != 0 ? obstacles(out) : 0;
    return raw_->obstacles_ahead(raw_->context, time_ahead_s, kinds, out.data(), out.size(),
                                 sizeof(hamelin_obstacle_state));
  }
  /// Draws a line of points of the world [m], one after the other, for log and report. The lines of
  /// a tick are drawn together, until a later tick draws others. Hosts that are older than this
  /// function draw nothing. For the planner's tick.
  void draw_path(std::span<const Eigen::Vector3d> points_world) const {
    static_assert(sizeof(Eigen::Vector3d) == 3 * sizeof(double));
    if (HAMELIN_HAS_FIELD(raw_, hamelin_host, draw_path))
      raw_->draw_path(raw_->context, reinterpret_cast<const double*>(points_world.data()),
                      points_world.size());
  }
  /// Asks for a path to the current goal, see hamelin_host.request_path. For the planner's tick.
  /// @return whether one will be searched; hosts that are older than this function search none
  [[nodiscard]] bool request_path() const {
    return HAMELIN_HAS_FIELD(raw_, hamelin_host, request_path) &&
           raw_->request_path(raw_->context) != 0;
  }
  /// Declares a series of numbers for log and report, for Command::set_series(). For the planner's
  /// constructor.
  /// @param unit may be empty
  /// @throws Error plugin if the name is empty or in use
  [[nodiscard]] std::int32_t declare_series(const std::string& name,
                                            const std::string& unit) const {
    const std::int32_t series = raw_->declare_series(raw_->context, name.c_str(), unit.c_str());
    if (series < 0)
      throw Error(ErrorCode::plugin, "series '" + name + "': its name is empty or in use");
    return series;
  }
  [[nodiscard]] const hamelin_host& raw() const { return *raw_; }

 private:
  void log(std::int32_t level, std::string_view line) const {
    raw_->log(raw_->context, level, line.data(), line.size());
  }
  const hamelin_host* raw_;
};

/// A handle for questions about the world at any configuration, from any thread; plugin_abi.h has
/// the details. One thread at a time may use a handle. It must be destroyed before the planner.
class Query {
 public:
  /// @throws Error plugin if memory is missing
  explicit Query(const Host& host)
      : host_(&host.raw()), handle_(host_->open_query(host_->context)) {
    if (handle_ == nullptr) throw Error(ErrorCode::plugin, "the host cannot open a query");
  }
  Query(Query&& other) noexcept
      : host_(other.host_), handle_(std::exchange(other.handle_, nullptr)) {}
  Query& operator=(Query&& other) noexcept {
    std::swap(host_, other.host_);
    std::swap(handle_, other.handle_);
    return *this;
  }
  ~Query() {
    if (handle_ != nullptr) host_->close_query(handle_);
  }

  struct Snapshot {
    std::uint64_t world;  ///< its number
    double time_s;        ///< of the last tick
  };
  /// Takes the newest snapshot of the world. All times below count from the time of the last tick
  /// before.
  /// @throws Error plugin if memory is missing
  Snapshot refresh() {
    Snapshot out{};
    if (host_->query_refresh(handle_, &out.world, &out.time_s) != 0)
      throw Error(ErrorCode::plugin, "the host cannot refresh a query");
    return out;
  }
  /// The smallest distance at q from obstacles and of the arm from itself, exact from `at_least` up
  /// to Setup::influence_m() [m].
  [[nodiscard]] double clearance(std::span<const double> q, double time_ahead_s = 0.0,
                                 double at_least_m = -1.0e9) const {
    double out = 0.0;
    host_->query_clearance(handle_, q.data(), 1, time_ahead_s, at_least_m, &out);
    return out;
  }
  /// The same for out.size() configurations, one after the other in q.
  void clearance(std::span<const double> q, double time_ahead_s, double at_least_m,
                 std::span<double> out) const {
    host_->query_clearance(handle_, q.data(), out.size(), time_ahead_s, at_least_m, out.data());
  }
  [[nodiscard]] std::size_t contacts(std::span<const double> q, double time_ahead_s,
                                     double influence_m, std::span<hamelin_contact> out) const {
    return host_->query_contacts(handle_, q.data(), time_ahead_s, influence_m, out.data(),
                                 out.size(), sizeof(hamelin_contact));
  }
  [[nodiscard]] std::size_t self_contacts(std::span<const double> q, double influence_m,
                                          std::span<hamelin_self_contact> out) const {
    return host_->query_self_contacts(handle_, q.data(), influence_m, out.data(), out.size(),
                                      sizeof(hamelin_self_contact));
  }
  /// Whether the straight joint motion from q0 to q1 is proved clear. By default the obstacles
  /// stand still.
  [[nodiscard]] bool motion_clear(std::span<const double> q0, std::span<const double> q1,
                                  double t0_s = 0.0, double t1_s = 0.0,
                                  double* margin_m = nullptr) const {
    return host_->query_motion_clear(handle_, q0.data(), q1.data(), t0_s, t1_s, margin_m) == 1;
  }
  /// Distance of a point from the nearest obstacle, at most `limit_m`, and its gradient.
  [[nodiscard]] double distance(const Eigen::Vector3d& point_world, double time_ahead_s,
                                double limit_m, Eigen::Vector3d* gradient = nullptr) const {
    double out = 0.0;
    host_->query_distance(handle_, point_world.data(), 1, time_ahead_s, limit_m, &out,
                          gradient != nullptr ? gradient->data() : nullptr);
    return out;
  }
  [[nodiscard]] std::size_t boxes(const Eigen::Vector3d& low_world,
                                  const Eigen::Vector3d& high_world,
                                  std::span<hamelin_box> out) const {
    return host_->query_boxes(handle_, low_world.data(), high_world.data(), out.data(), out.size(),
                              sizeof(hamelin_box));
  }
  [[nodiscard]] std::size_t obstacles(double time_ahead_s,
                                      std::span<hamelin_obstacle_state> out) const {
    return host_->query_obstacles(handle_, time_ahead_s, out.data(), out.size(),
                                  sizeof(hamelin_obstacle_state));
  }

 private:
  const hamelin_host* host_;
  hamelin_query* handle_;
};

/// Base class of planners. A planner has a constructor (const Host&, const Setup&, const Json&
/// params), which reports bad input by throwing Error; params are complete and checked against the
/// plugin's schema. It may also have any of these, which are found by their names:
/// - `static double influence_m(const Json& params)`: distance up to which it needs contacts [m].
/// - `static constexpr std::uint32_t properties = HAMELIN_TICK_ALLOCATES | HAMELIN_USES_THREADS`.
/// - `T prepare_params(const Json& params) const`: on any thread, while tick() runs; throws Error.
/// - `void apply_params(const T& params)`: before a tick; does not allocate or throw.
/// - `void reset(ConstVectorMap q, ConstVectorMap v)`: a new start; does not throw.
/// - `void world_changed(std::uint64_t world)`: before a tick; does not throw.
class Planner {
 public:
  Planner() = default;
  Planner(const Planner&) = delete;
  Planner& operator=(const Planner&) = delete;
  virtual ~Planner() = default;
  /// Answers a tick. It must not allocate, unless `properties` say so. An exception ends the run as
  /// a defect.
  virtual void tick(const Tick& tick, Command& command) = 0;
};

/// Checks new parameters of a running planner: those with these names must be the initial ones.
/// @throws Error invalid, naming the first that differs
void check_fixed_params(const Json& params, const Json& initial, std::span<const char* const> keys);

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
  /// Runs f; an exception becomes a line and the result 1.
  template <class F>
  static std::int32_t guarded(char* error, std::size_t error_size, F&& f) noexcept {
    try {
      f();
      return 0;
    } catch (...) {
      write_current_exception(error, error_size);
      return 1;
    }
  }
  static Type& planner_of(void* instance) { return static_cast<Instance*>(instance)->planner; }

  static std::int32_t create(const hamelin_host* host, const hamelin_setup* setup,
                             const char* params_json, std::size_t params_size, void** out,
                             char* error, std::size_t error_size) noexcept {
    return guarded(error, error_size, [&] {
      take_instruction_set(*setup);
      const Json params = parse_json({params_json, params_size}, "params");
      *out = std::make_unique<Instance>(setup->dof, Host(*host), Setup(*setup), params).release();
    });
  }
  static std::int32_t tick(void* instance, const hamelin_tick* tick, hamelin_command* command,
                           char* error, std::size_t error_size) noexcept {
    return guarded(error, error_size, [&] {
      const std::size_t dof = static_cast<Instance*>(instance)->dof;
      Command view(*command, dof);
      planner_of(instance).tick(Tick(*tick, dof), view);
    });
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

  static void add_params_functions(hamelin_plugin& plugin) noexcept {
    if constexpr (requires(const Type& planner, const Json& params) {
                    planner.prepare_params(params);
                  }) {
      using Params = decltype(std::declval<const Type&>().prepare_params(std::declval<Json&>()));
      plugin.prepare_params = [](const void* instance, const char* params_json,
                                 std::size_t params_size, void** out, char* error,
                                 std::size_t error_size) noexcept {
        return guarded(error, error_size, [&] {
          const auto& planner = static_cast<const Instance*>(instance)->planner;
          *out = std::make_unique<Params>(
                     planner.prepare_params(parse_json({params_json, params_size}, "params")))
                     .release();
        });
      };
      plugin.apply_params = [](void* instance, const void* params) noexcept {
        planner_of(instance).apply_params(*static_cast<const Params*>(params));
      };
      plugin.free_params = [](void* params) noexcept { delete static_cast<Params*>(params); };
    }
  }

  static hamelin_plugin plugin(const char* name, const char* version, const char* description,
                               const char* params_schema) noexcept {
    hamelin_plugin out{};
    out.struct_size = sizeof out;
    out.abi_version = HAMELIN_PLUGIN_ABI_VERSION;
    out.abi_version_min = HAMELIN_PLUGIN_ABI_VERSION_MIN;
    if constexpr (requires { Type::properties; }) out.properties = Type::properties;
    out.name = name;
    out.version = version;
    out.description = description;
    out.params_schema = params_schema;
    out.create = &create;
    out.tick = &tick;
    out.destroy = &destroy;
    out.influence_m = &influence_m;
    add_params_functions(out);
    if constexpr (requires(Type & planner, ConstVectorMap x) { planner.reset(x, x); })
      out.reset = [](void* instance, const double* q, const double* v) noexcept {
        const auto dof = static_cast<Eigen::Index>(static_cast<Instance*>(instance)->dof);
        planner_of(instance).reset(ConstVectorMap(q, dof), ConstVectorMap(v, dof));
      };
    if constexpr (requires(Type & planner) { planner.world_changed(std::uint64_t{}); })
      out.world_changed = [](void* instance, std::uint64_t world) noexcept {
        planner_of(instance).world_changed(world);
      };
    return out;
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
    static const hamelin_plugin plugin = ::hamelin::planning::detail::Glue<Type>::plugin(          \
        plugin_name, plugin_version, plugin_description, schema_text);                             \
    return &plugin;                                                                                \
  }                                                                                                \
  static_assert(true, "")
