#include "plugin_check.hpp"

#include <fmt/format.h>

#include <array>

#include "hamelin/core/error.hpp"
#include "hamelin/model/make_chain.hpp"

namespace hamelin::app {

namespace {

// A host without obstacles, which discards messages.
class EmptyHost final : public planning::HostServices {
 public:
  void log(std::int32_t, std::string_view) override {}
  std::size_t closest_points(std::span<const double>, double,
                             planning::ArrayOut<hamelin_contact>) override {
    return 0;
  }
};

planning::SetupData setup_for(const model::Model& arm, std::int32_t goal_type) {
  planning::SetupData data(arm);
  hamelin_goal goal{};
  goal.type = goal_type;
  goal.position_world_m[1] = 0.3;
  goal.quaternion_wxyz[0] = 1.0;
  goal.tolerance_m = 0.01;
  goal.tolerance_rad = 0.05;
  goal.speed_max = 0.05;
  data.add_goal(goal, goal_type == HAMELIN_GOAL_JOINT ? Eigen::VectorXd::Constant(arm.dof(), 0.2)
                                                      : Eigen::VectorXd());
  data.control_period_s = 1e-3;
  data.influence_m = 0.2;
  data.seed = 1;
  return data;
}

// All numbers of an answer, for comparison.
std::vector<double> numbers_of(const planning::CommandBuffers& out) {
  std::vector<double> numbers{out.raw().potential_J, static_cast<double>(out.raw().state)};
  for (const auto* x :
       {&out.potential_gradient(), &out.damping(), &out.held_torque(), &out.node_velocity()})
    numbers.insert(numbers.end(), x->begin(), x->end());
  for (const auto& term : out.gyroscopic())
    numbers.insert(numbers.end(), term.w_world, term.w_world + 3);
  return numbers;
}

std::vector<double> answers_of(const planning::Plugin& plugin, const Json& params,
                               const model::Model& arm, std::int32_t goal_type) {
  EmptyHost host;
  planning::SetupData setup = setup_for(arm, goal_type);
  const Eigen::Vector2d q_goal = Eigen::Vector2d::Constant(0.2);
  hamelin_goal goal = setup.goals.front();
  goal.struct_size = sizeof goal;
  goal.q = goal_type == HAMELIN_GOAL_JOINT ? q_goal.data() : nullptr;
  auto planner = plugin.create(std::move(setup), host, params);
  planning::CommandBuffers out(static_cast<std::size_t>(arm.dof()), 8, planner.series().size());
  hamelin_contact contact{};
  contact.distance_m = 0.05;
  contact.direction_world[1] = 1.0;
  contact.obstacle = HAMELIN_OBSTACLE_MAP;
  std::vector<double> all;
  const std::array<double, 2> q{0.1, 0.2}, still{0.0, 0.0}, moving{0.3, -0.4};
  for (std::uint64_t k = 0; k < 3; ++k) {
    hamelin_tick tick{};
    tick.struct_size = sizeof tick;
    tick.k = k;
    tick.time_s = 1e-3 * static_cast<double>(k);
    tick.q = q.data();
    tick.v = k == 0 ? still.data() : moving.data();
    tick.contacts = &contact;
    tick.contact_count = k == 2 ? 1 : 0;
    tick.contact_stride = sizeof contact;
    tick.goal = &goal;
    tick.speed_scale = 1.0;
    if (!planner.tick(tick, out))
      throw Error(ErrorCode::plugin, fmt::format("tick {}: {}", k, planner.error()));
    const auto numbers = numbers_of(out);
    all.insert(all.end(), numbers.begin(), numbers.end());
  }
  return all;
}

}  // namespace

std::vector<PluginCheck> check_plugin(const planning::Plugin& plugin) {
  std::vector<PluginCheck> checks;
  const auto attempt = [&](std::string name, auto&& action) {
    try {
      action();
      checks.push_back({std::move(name), ""});
    } catch (const Error& e) {
      checks.push_back({std::move(name), e.what()});
    }
  };
  checks.push_back(
      {fmt::format("{} {} loads from {}", plugin.name(), plugin.version(), plugin.file().string()),
       ""});
  Json params;
  attempt("default parameters fit the schema",
          [&] { params = planning::check_params(plugin, Json()); });
  if (!checks.back().failure.empty()) return checks;

  model::ChainOptions chain;
  chain.links = 2;
  const model::Model arm(model::make_chain(chain));
  const std::array<std::pair<std::int32_t, const char*>, 3> goals{
      {{HAMELIN_GOAL_JOINT, "joint"},
       {HAMELIN_GOAL_POSITION, "position"},
       {HAMELIN_GOAL_POSE, "pose"}}};
  for (const auto& goal : goals)
    attempt(
        fmt::format("answers ticks towards a {} goal, identically in two runs", goal.second), [&] {
          if (answers_of(plugin, params, arm, goal.first) !=
              answers_of(plugin, params, arm, goal.first))
            throw Error(ErrorCode::plugin, "two runs with the same seed gave different answers");
        });
  return checks;
}

}  // namespace hamelin::app
