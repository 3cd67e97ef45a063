// Loads the plugin at the given path and lets its planner answer one tick.
#include <iostream>

#include "hamelin/core/error.hpp"
#include "hamelin/planning/plugin_host.hpp"

namespace {

struct Services : hamelin::planning::HostServices {
  void log(std::int32_t, std::string_view line) override { std::cout << line << '\n'; }
  std::size_t closest_points(std::span<const double>, double,
                             hamelin::planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }
};

hamelin::model::Model pendulum() {
  hamelin::model::Link link;
  link.name = "rod";
  link.joint.name = "hinge";
  link.joint.screw << 1.0, 0.0, 0.0, 0.0, 0.0, 0.0;
  link.com = hamelin::geometry::SE3{Eigen::Matrix3d::Identity(), Eigen::Vector3d{0.0, 0.5, 0.0}};
  link.mass_kg = 2.0;
  link.inertia_kg_m2 = Eigen::Matrix3d::Identity();
  hamelin::model::Robot robot;
  robot.name = "pendulum";
  robot.links.push_back(link);
  robot.tip = {"tip", 0, link.com};
  return hamelin::model::Model(robot);
}

}  // namespace

int main(int argc, char** argv) try {
  using namespace hamelin::planning;
  if (argc != 2) return 2;
  const Plugin plugin = Plugin::load(argv[1]);
  SetupData setup(pendulum());
  hamelin_goal goal{};
  goal.struct_size = sizeof goal;
  goal.type = HAMELIN_GOAL_POSITION;
  goal.position_world_m[2] = 0.5;
  setup.add_goal(goal);
  Services services;
  auto planner = plugin.create(std::move(setup), services, check_params(plugin, {}));
  CommandBuffers out(1, 0);
  const double q = 0.1, v = 0.2;
  hamelin_tick tick{};
  tick.struct_size = sizeof tick;
  tick.q = &q;
  tick.v = &v;
  tick.goal = &goal;
  tick.speed_scale = 1.0;
  if (!planner.tick(tick, out)) {
    std::cerr << planner.error() << '\n';
    return 1;
  }
  std::cout << plugin.name() << ' ' << plugin.version() << ": torque " << out.held_torque()[0]
            << '\n';
  return 0;
} catch (const hamelin::Error& e) {
  std::cerr << e.what() << '\n';
  return 2;
}
