#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <utility>

#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin_abi.h"

/// What a planner may ask its host.
namespace hamelin::planning {

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

}  // namespace hamelin::planning
