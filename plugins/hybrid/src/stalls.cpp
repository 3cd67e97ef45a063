#include "stalls.hpp"

#include <algorithm>
#include <cstddef>
#include <string>

namespace hamelin::hybrid {

namespace {

// The near point whose row holds the arm back most; below 0 if none does.
int worst_point(Shared& s) {
  const SafetyFilter& filter = s.drive.filter();
  int worst = -1;
  for (int i = 0; i < std::min<int>(filter.row_count(), static_cast<int>(s.drive.points().size()));
       ++i)
    if (filter.row_multiplier(i) > 0.0 &&
        (worst < 0 || filter.row_multiplier(i) > filter.row_multiplier(worst)))
      worst = i;
  return worst;
}

std::string cause_at_point(const Shared& s, const NearPoint& point) {
  const auto& name = s.model.robot().links[static_cast<std::size_t>(point.link)].name;
  if (s.margins.tight_at_goal(point) && point.margin < s.margins.params().full_m)
    return "margin around the goal: link '" + name +
           "' keeps its margin from an obstacle that is near the goal";
  return "force balance: the obstacle next to link '" + name +
         "' balances the attraction to the goal";
}

// The cause of a stall, from the multipliers of the filter.
std::string stall_cause(Shared& s) {
  if (const int worst = worst_point(s); worst >= 0)
    return cause_at_point(s, s.drive.points()[static_cast<std::size_t>(worst)]);
  const auto& links = s.model.robot().links;
  for (int k = 0; k < s.setup.dof(); ++k) {
    if (s.setup.effort_max() && s.drive.filter().momentum_multiplier(k) > 0.0)
      return "torque limit of joint '" + links[static_cast<std::size_t>(k)].joint.name + "'";
    const double at_limit = 0.02;
    if ((s.setup.q_lower() && s.drive.q()[k] - (*s.setup.q_lower())[k] < at_limit) ||
        (s.setup.q_upper() && (*s.setup.q_upper())[k] - s.drive.q()[k] < at_limit))
      return "joint limit: joint '" + links[static_cast<std::size_t>(k)].joint.name +
             "' is at its limit";
  }
  return "unreachable goal: no obstacle is in the way, but the distance from the goal does not "
         "decrease";
}

}  // namespace

bool has_stalled(Shared& s, const TickEnd& end) {
  if (s.asks || s.steering) end.command.disable_stall_rule();
  return s.stall.stalled(s.moment(end.time_s, end.closing_speed));
}

Next leave_stall(Shared& s, const TickEnd& end) {
  if (!s.searches) {
    end.command.give_up(stall_cause(s));
    return std::nullopt;
  }
  if (s.request_path()) {
    s.host.info("stalled: asks for another path");
    return Wait{};
  }
  s.stall.extend(end.time_s);
  return std::nullopt;
}

}  // namespace hamelin::hybrid
