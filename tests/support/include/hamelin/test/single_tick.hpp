#pragma once
#include <catch2/catch.hpp>
#include <string>
#include <utility>

#include "hamelin/test/arm_loop.hpp"
#include "hamelin/test/robots.hpp"

namespace hamelin::test {

/// A single tick of a planner with any goal, with or without a path, and with self contacts, which
/// ArmLoop does not offer. A spatial arm of four joints moves among three balls. The planner must
/// have a parameter rho0_m.
class SingleTick : public planning::HostServices {
 public:
  explicit SingleTick(std::string plugin_file) : plugin_file_(std::move(plugin_file)) {}

  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }

  /// @param self whether the tick lists a self contact of two parts that nearly touch
  /// @return the held torque, followed by the gradient of the control potential
  Eigen::VectorXd answer(Json params, const hamelin_goal& goal, const Eigen::VectorXd& q_goal = {},
                         const Eigen::MatrixXd& path = {}, bool self = false) {
    const double influence = 5.0;
    params["rho0_m"] = influence;
    const model::Robot robot = random_robot(11, 4);
    ArmLoop near(plugin_file_, Json{{"rho0_m", influence}}, robot, {0.3, 0.4, -0.2}, three_balls);
    near.q << 0.3, -0.5, 0.8, 0.4;
    near.v << 0.7, 0.2, -0.4, 0.5;
    const auto& contacts = near.contacts();
    const model::Model model(robot, geometry::SE3{}, Eigen::Vector3d::Zero());
    planning::SetupData setup(model);
    setup.influence_m = influence;
    setup.self_collision = self;
    setup.add_goal(goal, q_goal, path);
    const auto plugin = planning::Plugin::load(plugin_file_);
    auto planner = plugin.create(std::move(setup), *this, planning::check_params(plugin, params));
    hamelin_self_contact touching{};
    touching.shape_a = 3;
    touching.shape_b = 0;
    touching.distance_m = 1e-3;
    touching.direction_world[0] = 1.0;
    hamelin_tick tick{};
    tick.struct_size = sizeof tick;
    tick.q = near.q.data();
    tick.v = near.v.data();
    tick.contacts = contacts.data();
    tick.contact_count = contacts.size();
    tick.contact_stride = sizeof(hamelin_contact);
    hamelin_goal current = goal;
    current.struct_size = sizeof current;
    if (q_goal.size() > 0) current.q = q_goal.data();
    tick.goal = &current;
    tick.speed_scale = 1.0;
    tick.self_contacts = &touching;
    tick.self_contact_count = self ? 1 : 0;
    tick.self_contact_stride = sizeof touching;
    planning::CommandBuffers buffers(4, contacts.size());
    REQUIRE(planner.tick(tick, buffers));
    Eigen::VectorXd all(8);
    all << buffers.held_torque(), buffers.potential_gradient();
    return all;
  }

 private:
  std::string plugin_file_;
};

/// Checks that a planner aims at the end of a path and at the position of a pose, and ignores
/// way-points and self contacts.
inline void check_ignores_path_and_self_contacts(const std::string& plugin_file,
                                                 const Json& params) {
  SingleTick tick(plugin_file);
  hamelin_goal joint{}, position{}, pose{};
  joint.type = HAMELIN_GOAL_JOINT;
  position.type = HAMELIN_GOAL_POSITION;
  pose.type = HAMELIN_GOAL_POSE;
  for (auto* goal : {&position, &pose})
    Eigen::Map<Eigen::Vector3d>(goal->position_world_m) << 0.3, 0.4, -0.2;
  pose.quaternion_wxyz[1] = 1.0;
  const Eigen::Vector4d end(0.5, -0.2, 0.1, 1.0);
  Eigen::MatrixXd path(4, 3);
  path << Eigen::Vector4d::Constant(2.0), Eigen::Vector4d::Constant(-1.0), end;
  const Eigen::VectorXd to_end = tick.answer(params, joint, end),
                        to_position = tick.answer(params, position);
  CHECK(to_end.norm() > 1.0);
  CHECK((to_end - to_position).norm() > 1.0);
  CHECK(tick.answer(params, joint, end, path) == to_end);
  CHECK(tick.answer(params, pose) == to_position);
  CHECK(tick.answer(params, position, {}, {}, true) == to_position);
}

}  // namespace hamelin::test
