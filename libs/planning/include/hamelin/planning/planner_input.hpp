#pragma once
#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string_view>

#include "hamelin/model/model.hpp"
#include "hamelin/planning/plugin_abi.h"
#include "hamelin/planning/views.hpp"

/// What a planner is given: once, and at each tick.
namespace hamelin::planning {

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

/// What the tip keeps, to first order: what is left of each tolerance, but for a reserve [rad or
/// m], negative beyond that, and the derivatives by q, one column each.
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

}  // namespace hamelin::planning
