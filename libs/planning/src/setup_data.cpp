#include <Eigen/Geometry>
#include <algorithm>

#include "hamelin/core/isa.hpp"
#include "hamelin/description/robot_io.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace hamelin::planning {

SetupData::SetupData(const model::Model& nominal)
    : dof(static_cast<std::size_t>(nominal.dof())),
      robot_json(description::robot_to_json(nominal.robot()).dump()),
      gravity_world_m_s2(nominal.gravity()),
      base_position_world_m(nominal.base().p()) {
  const Eigen::Quaterniond quaternion(nominal.base().R());
  base_quaternion_wxyz << quaternion.w(), quaternion.vec();
  for (const auto& shape : nominal.shapes()) {
    const auto& link = nominal.robot().links[static_cast<std::size_t>(shape.link)];
    const auto index = static_cast<std::size_t>(shape.index_in_link);
    hamelin_shape out{};
    out.link = shape.link;
    out.index_in_link = shape.index_in_link;
    out.radius_m = shape.radius;
    for (int i = 0; i < 3; ++i) {
      if (shape.is_capsule) {
        const auto& capsule = link.segments[index];
        out.center_link_m[i] = 0.5 * (capsule.from_m[i] + capsule.to_m[i]);
        out.half_axis_link_m[i] = 0.5 * (capsule.to_m[i] - capsule.from_m[i]);
      } else {
        out.center_link_m[i] = link.spheres[index].center_m[i];
      }
    }
    shapes.push_back(out);
  }
}

void SetupData::add_goal(const hamelin_goal& goal, const Eigen::VectorXd& q,
                         const Eigen::MatrixXd& path) {
  goals.push_back(goal);
  goals_q.push_back(q);
  paths.push_back(path);
}

hamelin_setup SetupData::view() {
  for (std::size_t i = 0; i < goals.size(); ++i) {
    goals[i].struct_size = sizeof goals[i];
    goals[i].q = goals_q[i].size() > 0 ? goals_q[i].data() : nullptr;
    goals[i].path = paths[i].size() > 0 ? paths[i].data() : nullptr;
    goals[i].path_points = static_cast<std::size_t>(paths[i].cols());
    path_points_max = std::max(path_points_max, goals[i].path_points);
  }
  hamelin_setup raw{};
  raw.struct_size = sizeof raw;
  raw.dof = dof;
  raw.robot_json = robot_json.c_str();
  raw.robot_json_size = robot_json.size();
  std::copy_n(gravity_world_m_s2.data(), 3, raw.gravity_world_m_s2);
  std::copy_n(base_position_world_m.data(), 3, raw.base_position_world_m);
  std::copy_n(base_quaternion_wxyz.data(), 4, raw.base_quaternion_wxyz);
  raw.shapes = shapes.data();
  raw.shape_count = shapes.size();
  raw.shape_stride = sizeof(hamelin_shape);
  raw.goals = goals.data();
  raw.goal_count = goals.size();
  raw.goal_stride = sizeof(hamelin_goal);
  raw.path_points_max = path_points_max;
  const auto numbers = [](const Eigen::VectorXd& x) { return x.size() > 0 ? x.data() : nullptr; };
  raw.q_lower = numbers(q_lower);
  raw.q_upper = numbers(q_upper);
  raw.velocity_max = numbers(velocity_max);
  raw.effort_max = numbers(effort_max);
  raw.effort_rate_max = numbers(effort_rate_max);
  raw.control_period_s = control_period_s;
  raw.deadline_s = deadline_s;
  raw.sampled = sampled ? 1 : 0;
  raw.delay_s = delay_s;
  raw.self_collision = self_collision ? 1 : 0;
  raw.influence_m = influence_m;
  raw.map_resolution_m = map_resolution_m;
  raw.shield_margin_m = shield_margin_m;
  raw.shield_self_margin_m = shield_self_margin_m;
  raw.seed = seed;
  raw.instruction_set = name_of(default_isa()).data();  // views a literal, so it is nul-terminated
  return raw;
}

}  // namespace hamelin::planning
