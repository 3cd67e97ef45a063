#include <fmt/format.h>

#include <cmath>
#include <map>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "log_fields.hpp"
#include "plots.hpp"

namespace hamelin::report {

namespace {

void add_mark(double y, const std::string& label, Json& marks) {
  for (const auto& mark : marks)
    if (mark["y"] == y) return;
  marks.push_back({{"y", y}, {"label", label}});
}

}  // namespace

Json Plots::marks(const Plot& plot) const {
  Json marks = Json::array();
  const std::string_view id = plot.id;
  if (id == "clearance") {
    mark_clearance(marks);
  } else if (id == "goal" || id == "goal_joint") {
    mark_tolerances(plot, marks);
  } else if (id == "tau_share") {
    add_mark(1.0, "limit", marks);
    add_mark(-1.0, "limit", marks);
  } else if (id == "v" || id == "tau") {
    mark_joint_limits(id == "v", marks);
  }
  return marks;
}

void Plots::mark_clearance(Json& marks) const {
  add_mark(0.0, "contact", marks);
  const auto& planner = recorded_.scene.planner;
  const Json params = planner ? planner->params : Json::object();
  for (const auto& [key, label] :
       {std::pair("margin_m", "margin"), std::pair("contact_radius_m", "search radius"),
        std::pair("rho0_m", "influence")})
    if (const Json* at = find(params, key); at != nullptr && at->is_number())
      add_mark(at->get<double>(), label, marks);
}

void Plots::mark_tolerances(const Plot& plot, Json& marks) const {
  const bool of_joints = plot.lines.front().second == 3 * plotted_joints_ + goal_rad;
  for (const auto& goal : world_.goals)
    for (const auto& option : scene::options_of(goal))
      if ((option.type == scene::GoalType::joint) == of_joints)
        add_mark(of_joints ? option.tolerance_rad : option.tolerance_m, "tolerance", marks);
}

// Joints with the same limit share its line. It is drawn if one of them comes near to it; a limit
// far away would only compress the scale.
void Plots::mark_joint_limits(bool of_rates, Json& marks) const {
  const auto& modelled = recorded_.scene.model;
  if (!(of_rates ? modelled.velocity_limits : modelled.torque_limits)) return;
  struct Limit {
    std::vector<std::string> joints;
    bool near = false;
  };
  std::map<double, Limit> limits;
  const std::size_t first = (of_rates ? 1 : 2) * plotted_joints_;
  for (std::size_t i = 0; i < plotted_joints_; ++i) {
    const auto& joint = world_.model.robot().links[i].joint;
    const auto value_max = of_rates ? joint.velocity_max : joint.effort_max;
    if (!value_max) continue;
    Limit& limit = limits[*value_max];
    limit.joints.push_back(joint.name);
    for (const double value : bins_.values(first + i))
      limit.near = limit.near || std::abs(value) > *value_max / 1.5;
  }
  for (const auto& [value_max, limit] : limits) {
    if (!limit.near) continue;
    const std::string label = limit.joints.size() == plotted_joints_ ? "limit"
                              : limit.joints.size() <= 4
                                  ? fmt::format("limit of {}", fmt::join(limit.joints, ", "))
                                  : fmt::format("limit of {} joints", limit.joints.size());
    add_mark(value_max, label, marks);
    add_mark(-value_max, label, marks);
  }
}

}  // namespace hamelin::report
