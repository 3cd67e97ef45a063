#pragma once
#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "hamelin/control/controller.hpp"
#include "hamelin/control/planner_setup.hpp"
#include "hamelin/scene/self_collision.hpp"

namespace hamelin::test {

/// What an embedded controller must never let happen.
enum class Fault {
  contact,       ///< with the map or an obstacle that stands still
  self_contact,  ///< where the scene models it
  position,      ///< beyond a joint limit
  speed,         ///< of the arm, or of a set point
  torque,        ///< beyond a limit
  torque_rate,   ///< faster than the drives can
  acceleration,  ///< of a set point
  jerk,          ///< of a set point
  jump,          ///< of a set point's position
  not_finite,
  strayed  ///< from the motion of a stop, by more than the shield's margins cover
};
inline constexpr std::size_t faults = 11;
[[nodiscard]] std::string_view to_string(Fault fault) noexcept;

/// Bounds of what a controller sends.
struct Bounds {
  control::ModelledLimits limits;
  std::optional<double> torque_rate_Nm_s;
  bool position = false;  ///< whether set points are sent
  double acceleration = 0.0, jerk = 0.0, period_s = 0.001;
};

/// Watches an arm and what it is sent, without the shield's checks: distances come from the
/// published snapshots at dense samples of the motion between ticks.
class Judge {
 public:
  Judge(Bounds bounds, const model::Model& model, bool self_collision);

  /// The arm carries something else now.
  void set_arm(const model::Model& model);
  /// The next output follows a new start at a configuration at rest.
  void expect_start(const Eigen::VectorXd& q);
  /// Set points may go on from where the arm is measured to be, if it rests there.
  void expect_resumption(const Eigen::VectorXd& q, const Eigen::VectorXd& v);
  /// @param at what a line about it begins with
  void check_output(const control::Answer& answer, const std::string& at);
  /// The motion of a period. @param world in which it was made
  void check_motion(const Eigen::VectorXd& q, const Eigen::VectorXd& v, const Eigen::VectorXd& q_to,
                    const Eigen::VectorXd& v_to, const control::WorldSnapshot& world, double time_s,
                    const std::string& at);

  /// @param share of the bound, of the shield that is in force
  void check_straying(double share, const std::string& at);

  [[nodiscard]] long count(Fault fault) const { return counts_[static_cast<std::size_t>(fault)]; }
  /// One line per kind of fault, about its first.
  [[nodiscard]] const std::vector<std::string>& findings() const noexcept { return findings_; }
  [[nodiscard]] double least_clearance_m() const noexcept { return least_clearance_m_; }

 private:
  void note(Fault fault, const std::string& at, double value, double bound);
  /// Notes the joint that exceeds a bound by the most.
  void check_bound(Fault fault, const Eigen::VectorXd& values, const Eigen::VectorXd& bounds,
                   const std::string& at);
  void check_positions(const Eigen::VectorXd& q, const std::string& at);
  void check_set_point(const control::Answer& answer, const std::string& at);
  void check_clearance(const Eigen::VectorXd& q, const scene::Environment& world, double time_s,
                       const std::string& at);

  Bounds bounds_;
  bool self_collision_;
  std::optional<model::Model> model_;
  std::optional<dynamics::Workspace> ws_;
  scene::PlacedShapes arm_;
  std::optional<scene::SelfField> self_;
  Eigen::VectorXd torque_, q_, v_, a_;  ///< sent last
  bool torque_known_ = false, rate_known_ = true;
  double clear_until_m_ = 0.0;  ///< no contact before a point of the arm has moved so far
  double self_clear_until_m_ = 0.0;
  std::uint64_t snapshot_ = 0;
  std::array<long, faults> counts_{};
  std::vector<std::string> findings_;
  double least_clearance_m_ = 1.0;
};

}  // namespace hamelin::test
