#pragma once
#include <map>
#include <optional>
#include <string>

#include "hamelin/io/json.hpp"

namespace hamelin::sweep {

/// What summaries, pages, CSV and comparisons use of a record; small, so that 10⁵ of them fit into
/// memory. Without a record nothing is set.
struct RunFacts {
  bool recorded = false;
  std::string outcome, cause;   ///< with the judge: contact that it saw is a collision
  std::string own_outcome;      ///< of the run itself; empty if it crashed
  bool success = false;         ///< is_success() of `outcome`
  std::string failure;          ///< failure_class()
  std::string contact;          ///< judged_contact()
  double contact_time_s = 0.0;  ///< judged_contact_time()
  bool judge_saw_contact = false;
  /// Speed of the arm where it touched an obstacle that moves or appears [m/s].
  std::optional<double> contact_arm_speed_m_s;
  bool judged = false;  ///< whether the judge measured a distance
  std::optional<double> time_s, certified_share;
  std::optional<double> clearance_m, self_clearance_m;  ///< the judge's
  std::optional<double> recovery_work_J, filter_work_J;
  /// Mean over ticks of the change of the torque [Nm or N]; none under ideal actuation.
  std::optional<double> torque_change_mean;
  /// Contacts that the plant counted itself; none if it does not detect them.
  std::optional<double> plant_contacts;
  std::optional<double> tick_us_p50, tick_us_p99;
  std::map<std::string, double> escape;  ///< the numbers in the result's "escape"
};

/// The facts of a record, hamelin.record/1 or null.
/// @param timing whether to keep what depends on the machine: the times of ticks
[[nodiscard]] RunFacts facts_of(const Json& record, bool timing = true);

}  // namespace hamelin::sweep
